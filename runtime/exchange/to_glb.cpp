// Method: one mesh primitive, whose positions and indices are also the sample points and the interpolation surface of the single modal
// model.
//   The bank's other arrays are stored as in a bank file (runtime/bank/layout.hpp). Shapes are exact as float: an integer of up to 15 bits
//   times the mode's scale.
// Source: KHR_audio_rigid_bodies, draft of 2026 (K. Hiner); glTF 2.0 specification.
// Deviations: one normal per vertex, the area-weighted mean of its triangles: sharp edges are shaded smoothly.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/bank/blows.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/sort_order.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/base/version.hpp"
#include "runtime/exchange/damped.hpp"
#include "runtime/exchange/glb.hpp"
#include "runtime/exchange/glb_multipoles.hpp"
#include "runtime/exchange/gltf/writer.hpp"

namespace carillon::exchange {
namespace {

using base::Json;

std::vector<float> to_floats(const std::vector<Vec3>& rows) {
  std::vector<float> values;
  values.reserve(3 * rows.size());
  for (const Vec3& row : rows)
    for (const double x : row) values.push_back(static_cast<float>(x));
  return values;
}

/// Mode with its playing values.
struct Played {
  std::size_t mode = 0;  // index in the bank
  double omega_rad_s = 0.0, decay_per_s = 0.0;
};

/// By descending audibility.
std::vector<Played> list_played(const bank::Bank& bank) {
  const std::vector<std::size_t> modes = bank::sort_played_modes(bank);
  const bank::Bank played = bank::choose_frequencies(bank, bank::Frequencies::kCorrected);
  std::vector<double> silence = bank::calc_audibility(played);
  for (double& audibility : silence) audibility = -audibility;
  std::vector<Played> list;
  for (const std::size_t k : base::find_sort_order(silence))
    list.push_back({modes[k], std::sqrt(played.eigenvalue_rad2_s2[k]), played.decay_per_s[k]});
  return list;
}

Json describe_mass(const bank::RigidBody& rigid) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> inertia(rigid.inertia_kg_m2.data());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(0.5 * (inertia + inertia.transpose()));
  Eigen::Matrix3d axes = solver.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) = -axes.col(0);
  const Eigen::Quaterniond turn = Eigen::Quaterniond(axes).normalized();
  Json mass = Json::object();
  mass.set("mass", rigid.mass_kg).set("centerOfMass", Json::array(rigid.centre_m));
  mass.set("inertiaDiagonal", Json::array(std::vector<double>(solver.eigenvalues().data(), solver.eigenvalues().data() + 3)));
  mass.set("inertiaOrientation", Json::array(std::vector<double>{turn.x(), turn.y(), turn.z(), turn.w()}));
  return mass;
}

Json describe_material(const bank::Bank& bank, const std::string& name) {
  const bank::Material& own = bank.material;
  Json material = Json::object();
  material.set("name", name).set("density", own.density_kg_m3).set("youngsModulus", own.young_modulus_pa);
  material.set("poissonRatio", own.poisson_ratio);
  if (bank.damping.law == "rayleigh") material.set("alpha", own.alpha2_per_s).set("beta", own.alpha1_s);
  return material;
}

/// Adds the shapes of modes, mode by mode; returns the accessor.
int add_shapes(const bank::Bank& bank, const std::vector<Played>& modes, gltf::Writer& writer) {
  return writer.add_rows(modes.size(), bank.vertex_count(), [&](std::size_t k, std::span<float> numbers) {
    for (std::size_t v = 0; v < bank.vertex_count(); ++v) {
      const Vec3 phi = bank.shape_at(v, modes[k].mode);
      for (std::size_t c = 0; c < 3; ++c) numbers[3 * v + c] = static_cast<float>(phi[c]);
    }
  });
}

Json list_modes(const std::vector<Played>& modes) {
  Json list = Json::array();
  for (const Played& played : modes) list.add(played.mode);
  return list;
}

/// Extras for lossless import: all arrays of the bank file except triangles and shapes.
Json add_extras(const bank::Bank& bank, const std::vector<Played>& swinging, const std::vector<Played>& still, gltf::Writer& writer) {
  Json own = Json::object(), fields = Json::array();
  own.set("version", fmt::format("{}", fmt::join(bank::find_version(bank), ".")));
  const bank::FileForm form = bank::make_file_form(bank);
  for (const bank::Field& field : bank::list_fields(bank, form)) {
    if (field.name == "mesh/triangles") continue;
    Json entry = Json::object();
    entry.set("name", field.name).set("type", field.dtype).set("shape", Json::array(field.shape)).set("units", field.units);
    entry.set("meaning", field.meaning);
    if (field.name != "modes/shape" && bank::calc_bytes(field) > 0)
      entry.set("view", writer.add_bytes({static_cast<const std::byte*>(field.data), bank::calc_bytes(field)}));
    fields.add(entry);
  }
  own.set("fields", fields).set("modes", list_modes(swinging));
  if (!still.empty()) own.set("still", Json::object().set("shapes", add_shapes(bank, still, writer)).set("modes", list_modes(still)));
  return Json::object().set("carillon", own);
}

}  // namespace

void write_glb(const bank::Bank& bank, const GlbOptions& options, const std::function<void(std::string_view)>& sink) {
  std::vector<Played> swinging, still;
  for (const Played& played : list_played(bank))
    (calc_damped_hz(played.omega_rad_s, played.decay_per_s) > 0.0 ? swinging : still).push_back(played);
  if (swinging.empty())
    throw InputError(fmt::format("the bank has no under-damped mode ({} in all), and {} needs one", bank.mode_count(), kExtension));

  gltf::Writer writer(base::describe("carillon-bank"));
  const int positions = writer.add_vertices(to_floats(bank.vertices_m), true);
  std::vector<Vec3> normals_of_vertices = bank::calc_vertex_normals(bank);
  for (Vec3& normal : normals_of_vertices)
    if (!(norm(normal) > 0.0)) normal = {0.0, 1.0, 0.0};  // glTF requires unit vectors
  const int normals = writer.add_vertices(to_floats(normals_of_vertices), false);
  std::vector<std::int32_t> corners;
  for (const auto& triangle : bank.triangles) corners.insert(corners.end(), triangle.begin(), triangle.end());
  const int indices = writer.add_indices(corners, bank.vertex_count());
  std::vector<float> freq_hz, decay_per_s;
  for (const Played& played : swinging) {
    freq_hz.push_back(static_cast<float>(calc_damped_hz(played.omega_rad_s, played.decay_per_s)));
    decay_per_s.push_back(static_cast<float>(played.decay_per_s));
  }
  Json model = Json::object();
  model.set("name", options.name).set("frequencies", writer.add_scalars(freq_hz)).set("decayRates", writer.add_scalars(decay_per_s));
  model.set("positions", positions).set("shapes", add_shapes(bank, swinging, writer)).set("indices", indices).set("material", 0);
  std::vector<std::string> used{kExtension};
  if (!bank.multipoles.is_empty()) {
    std::vector<std::size_t> modes;
    for (const Played& played : swinging) modes.push_back(played.mode);
    model.set("extensions", Json::object().set(kMultipoles, describe_multipoles(bank, modes, writer)));
    used.emplace_back(kMultipoles);
  }
  model.set("massProperties", describe_mass(bank.rigid)).set("extras", add_extras(bank, swinging, still, writer));

  const auto list = [](const Json& only) { return Json::array().add(only); };
  Json attributes = Json::object(), primitive = Json::object(), mesh = Json::object(), node = Json::object();
  attributes.set("POSITION", positions).set("NORMAL", normals);
  primitive.set("attributes", attributes).set("indices", indices);
  mesh.set("name", options.name).set("primitives", list(primitive));
  node.set("name", options.name).set("mesh", 0);
  if (options.is_z_up) {  // -90 degrees about x
    const double half = std::numbers::sqrt2 / 2.0;
    node.set("rotation", Json::array(std::vector<double>{-half, 0.0, 0.0, half}));
  }
  node.set("extensions", Json::object().set(kExtension, Json::object().set("modalModel", 0)));
  Json extension = Json::object();
  extension.set("acousticMaterials", list(describe_material(bank, options.name))).set("modalModels", list(model));
  writer.json().set("extensionsUsed", Json::array(used));
  writer.json().set("extensions", Json::object().set(kExtension, extension));
  writer.json().set("scene", 0).set("scenes", list(Json::object().set("nodes", Json::array(std::vector<int>{0}))));
  writer.json().set("nodes", list(node)).set("meshes", list(mesh));
  writer.write_glb(sink);
}

}  // namespace carillon::exchange
