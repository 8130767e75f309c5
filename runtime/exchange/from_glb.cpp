// Method: files with Carillon's extras: arrays from the extras, triangles and shapes from the extension, assembled as for a bank file
//   (bank::assemble_bank); values present in both must agree. Other programs' files: lambda = (2 pi f)^2 + d^2, shapes rounded to 16 bits,
//   mass properties by the divergence theorem if the model has none.
// Source: KHR_audio_rigid_bodies, draft of 2026 (K. Hiner).
// Deviations: the node's scale applies to the body, and to modes and mass given for the unscaled body; its rotation and translation are
//   ignored.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numbers>
#include <vector>

#include "runtime/bank/corrected.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/radiation_gain.hpp"
#include "runtime/bank/report.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/sort_order.hpp"
#include "runtime/base/used_points.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/exchange/damped.hpp"
#include "runtime/exchange/glb.hpp"
#include "runtime/exchange/gltf/file.hpp"
#include "runtime/exchange/gltf/nodes.hpp"
#include "runtime/exchange/solid.hpp"

namespace carillon::exchange {
namespace {

using gltf::Component;

constexpr std::size_t kMaxFields = 1000, kMaxListed = 10'000'000, kMaxNodes = 10'000'000;
constexpr double kFreqTolerance = 1e-6;    // relative error of a frequency in float, through a sum of squares
constexpr double kStepTolerance = 0.02;    // steps of a shape: rounding of an integer stored as float
constexpr double kDecayTolerance = 1e-5;   // relative error of a decay in float against its law
constexpr double kScaleTolerance = 1e-4;   // relative difference between the axes of a node
constexpr double kInertiaTolerance = 0.3;  // relative difference for uneven bodies and coarse surfaces
constexpr const char* kChanged = "was changed since carillon-bank wrote it; --plain reads the extension alone";

/// Model in the extension.
struct Model {
  std::vector<double> freq_hz, decay_per_s;            // (M)
  std::vector<Vec3> positions;                         // (P)
  std::vector<std::array<std::int32_t, 3>> triangles;  // (T)
  gltf::Numbers shapes;                                // (M, P) rows of three
};

class Reader {
 public:
  Reader(std::string_view bytes, const std::string& name, const GlbReading& reading)
      : file_(gltf::parse(bytes, name)), reading_(&reading), root_(file_.root()) {}

  const std::vector<std::string>& get_notes() const { return notes_; }

  bank::Bank read() {
    base::Object extension = find_extension();
    base::Object model = choose_model(extension);
    read_model(model);
    std::optional<base::Object> extras = model.object_if("extras");
    std::optional<base::Object> own = extras && !reading_->ignores_extras ? extras->object_if("carillon") : std::nullopt;
    return own ? assemble(*own) : make(extension, model);
  }

 private:
  base::Object find_extension() {
    std::optional<base::Object> extensions = root_.object_if("extensions");
    if (!extensions || !extensions->has(kExtension))
      throw InputError(fmt::format("{}: it has no {}, hence no modes; compute them with carillon hear", file_.name(), kExtension));
    return extensions->object(kExtension);
  }

  base::Object choose_model(base::Object& extension) {
    std::vector<base::Object> models = extension.objects("modalModels");
    if (models.empty()) extension.fail("modalModels", "this file has no modal model; export it with one");
    if (!reading_->model && models.size() > 1)
      extension.fail("modalModels", fmt::format("there are {} models; choose one with --model, from 0", models.size()));
    number_ = reading_->model.value_or(0);
    if (number_ >= models.size())
      extension.fail("modalModels", fmt::format("there is no model {}; there are {}, numbered from 0", number_, models.size()));
    return models[number_];
  }

  std::vector<double> read_scalars(base::Object& model, const char* key) {
    const gltf::Numbers numbers = file_.read(model, key, "SCALAR", {Component::kFloat});
    std::vector<double> values(numbers.count());
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = numbers.get(i, 0);
      if (!(std::isfinite(values[i]) && values[i] >= 0.0))
        model.fail(key, fmt::format("number {} is {}; it must be finite and not negative", i, values[i]));
    }
    return values;
  }

  std::vector<Vec3> read_rows(base::Object& owner, const char* key, double scale = 1.0) {
    const gltf::Numbers numbers = file_.read(owner, key, "VEC3", {Component::kFloat});
    std::vector<Vec3> rows(numbers.count());
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t c = 0; c < 3; ++c) {
        rows[i][c] = scale * numbers.get(i, c);
        if (!std::isfinite(rows[i][c])) owner.fail(key, fmt::format("row {} has a coordinate that is not finite: {}", i, rows[i][c]));
      }
    return rows;
  }

  void read_model(base::Object& model) {
    model_.freq_hz = read_scalars(model, "frequencies");
    model_.decay_per_s = read_scalars(model, "decayRates");
    const std::size_t modes = model_.freq_hz.size();
    if (model_.decay_per_s.size() != modes)
      model.fail("decayRates", fmt::format("has {} numbers, but there are {} frequencies", model_.decay_per_s.size(), modes));
    for (std::size_t m = 0; m < modes; ++m)
      if (!(model_.freq_hz[m] > 0.0)) model.fail("frequencies", fmt::format("number {} is 0; a frequency must be above 0", m));
    model_.positions = read_rows(model, "positions");
    const std::size_t points = model_.positions.size();
    model_.shapes = file_.read(model, "shapes", "VEC3", {Component::kFloat});
    if (model_.shapes.count() / points != modes || model_.shapes.count() % points != 0)
      model.fail("shapes",
                 fmt::format("has {} rows, but {} modes at {} points need {}", model_.shapes.count(), modes, points, modes * points));
    if (!model.has("indices")) model.fail("", "the model has no \"indices\", and a bank needs a surface; export it with them");
    const gltf::Numbers corners = file_.read(model, "indices", "SCALAR", gltf::kIndexTypes);
    if (corners.count() % 3 != 0) model.fail("indices", fmt::format("{} corners are no whole number of triangles", corners.count()));
    model_.triangles.resize(corners.count() / 3);
    for (std::size_t i = 0; i < corners.count(); ++i) {
      const double v = corners.get(i, 0);
      if (!(v < static_cast<double>(points)))
        model.fail("indices", fmt::format("index {} is {}, but there are only {} points", i, v, points));
      model_.triangles[i / 3][i % 3] = static_cast<std::int32_t>(v);
    }
  }

  // ---- files written by Carillon ----

  /// Mode indices of the rows of some shapes.
  std::vector<std::size_t> read_modes(base::Object& object, std::size_t count, std::size_t modes) {
    std::vector<std::size_t> list;
    for (const double number : object.number_list("modes", kMaxListed)) {
      if (!(number >= 0.0 && number < static_cast<double>(modes) && number == std::floor(number)))
        object.fail("modes", fmt::format("{:g} is not a mode; there are {}", number, modes));
      list.push_back(static_cast<std::size_t>(number));
    }
    if (list.size() != count) object.fail("modes", fmt::format("lists {} modes, but there are shapes of {}", list.size(), count));
    return list;
  }

  static double get_double(const bank::FieldBytes& field, std::size_t i) {
    double value = 0.0;
    std::memcpy(&value, field.bytes.data() + i * sizeof value, sizeof value);
    return value;
  }

  /// Field of that name with `count` numbers of 8 bytes.
  const bank::FieldBytes& find_field(const char* name, std::size_t count) const {
    const auto found = fields_.find(name);
    if (found == fields_.end() || found->second.bytes.size() != count * sizeof(double) || found->second.field.dtype != "<f8")
      throw InputError(fmt::format("{}: its extras have no \"{}\" of {} numbers: it {}", file_.name(), name, count, kChanged));
    return found->second;
  }

  void read_fields(base::Object& own) {
    for (base::Object& entry : own.objects("fields")) {
      if (fields_.size() > kMaxFields) own.fail("fields", "there are more fields than a bank can have");
      bank::FieldBytes array;
      array.field.name = entry.string("name");
      array.field.dtype = entry.string("type");
      // An empty shape is a scalar, which Object::number_list() rejects.
      for (const std::int64_t extent : read_extents(entry)) array.field.shape.push_back(static_cast<std::uint64_t>(extent));
      if (entry.has("view")) {
        const std::string_view view = file_.read_view(entry, "view");
        array.bytes = std::as_bytes(std::span(view.data(), view.size()));
      }
      const std::string name = array.field.name;
      if (!fields_.emplace(name, array).second) entry.fail("name", fmt::format("\"{}\" occurs twice: the file {}", name, kChanged));
    }
  }

  static std::vector<std::int64_t> read_extents(base::Object& entry) {
    std::vector<std::int64_t> extents;
    if (entry.is_empty_list("shape")) return extents;
    for (const double n : entry.number_list("shape", 4)) {
      if (!(n >= 0.0 && n <= 9e15 && n == std::floor(n))) entry.fail("shape", fmt::format("{:g} is not a number of rows", n));
      extents.push_back(static_cast<std::int64_t>(n));
    }
    return extents;
  }

  /// Copies the steps of some modes' shapes into (V, m, 3).
  void read_steps(base::Object& owner, const gltf::Numbers& shapes, const std::vector<std::size_t>& modes, std::size_t mode_count,
                  std::vector<std::int16_t>& steps, std::vector<bool>& is_known) {
    const std::size_t points = model_.positions.size();
    const bank::FieldBytes& scales = find_field("modes/shape_scale", mode_count);
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const std::size_t m = modes[k];
      if (is_known[m]) owner.fail("modes", fmt::format("mode {} occurs twice: the file {}", m, kChanged));
      is_known[m] = true;
      const double scale = get_double(scales, m);
      for (std::size_t v = 0; v < points; ++v)
        for (std::size_t c = 0; c < 3; ++c) {
          const double exact = scale > 0.0 ? shapes.get(k * points + v, c) / scale : shapes.get(k * points + v, c),
                       step = std::round(exact);
          if (!(std::abs(exact - step) <= kStepTolerance && std::abs(step) <= 32767.0))
            owner.fail("shapes", fmt::format("mode {} at point {} is not a whole number of steps: the file {}", k, v, kChanged));
          steps[(v * mode_count + m) * 3 + c] = static_cast<std::int16_t>(step);
        }
    }
  }

  void compare_vertices(const bank::FieldBytes& vertices) {
    for (std::size_t v = 0; v < model_.positions.size(); ++v)
      for (std::size_t c = 0; c < 3; ++c)
        if (static_cast<double>(static_cast<float>(get_double(vertices, 3 * v + c))) != model_.positions[v][c])
          throw InputError(fmt::format("{}: point {} differs from its extras: the file {}", file_.name(), v, kChanged));
  }

  /// Frequencies and decays of the extension must equal the playing values of the bank from the extras.
  void compare_modes(const bank::Bank& bank, const std::vector<std::size_t>& modes) {
    const bank::Bank played = bank::calc_corrected(bank);
    const std::vector<std::size_t> order = bank::sort_played_modes(bank);
    std::vector<std::size_t> place(order.size());  // rank of each mode among the played ones
    for (std::size_t i = 0; i < order.size(); ++i) place[order[i]] = i;
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const double omega = std::sqrt(played.eigenvalue_rad2_s2[place[modes[k]]]), decay = played.decay_per_s[place[modes[k]]];
      const double hz = calc_damped_hz(omega, decay);
      if (!(std::abs(model_.freq_hz[k] - hz) <= kFreqTolerance * hz && std::abs(model_.decay_per_s[k] - decay) <= kFreqTolerance * decay))
        throw InputError(fmt::format("{}: mode {} has {:.7g} Hz, but {:.7g} Hz in its extras: the file {}", file_.name(), k,
                                     model_.freq_hz[k], hz, kChanged));
    }
  }

  bank::Bank assemble(base::Object& own) {
    read_fields(own);
    const auto eigenvalues = fields_.find("modes/eigenvalue"), shape = fields_.find("modes/shape");
    if (eigenvalues == fields_.end() || shape == fields_.end() || shape->second.field.shape.size() != 3)
      own.fail("fields", fmt::format("eigenvalues or shapes are missing: the file {}", kChanged));
    const std::size_t mode_count = eigenvalues->second.bytes.size() / sizeof(double), points = model_.positions.size();
    compare_vertices(find_field("mesh/vertices", 3 * points));
    std::optional<base::Object> still = own.object_if("still");
    gltf::Numbers still_shapes;
    if (still) still_shapes = file_.read(*still, "shapes", "VEC3", {Component::kFloat});
    const std::size_t still_count = still_shapes.count() / points;
    if (still_shapes.count() % points != 0 || model_.freq_hz.size() + still_count != mode_count)
      own.fail("modes", fmt::format("there are shapes of {} modes, but {} modes: the file {}", model_.freq_hz.size() + still_count,
                                    mode_count, kChanged));
    std::vector<std::int16_t> steps(3 * mode_count * points);
    std::vector<bool> is_known(mode_count, false);
    const std::vector<std::size_t> swinging = read_modes(own, model_.freq_hz.size(), mode_count);
    read_steps(own, model_.shapes, swinging, mode_count, steps, is_known);
    if (still) read_steps(*still, still_shapes, read_modes(*still, still_count, mode_count), mode_count, steps, is_known);

    std::vector<std::int8_t> narrow;
    if (shape->second.field.dtype == "|i1") {
      narrow.assign(steps.begin(), steps.end());
      shape->second.bytes = std::as_bytes(std::span(narrow));
    } else {
      shape->second.bytes = std::as_bytes(std::span(steps));
    }
    std::vector<bank::FieldBytes> arrays;
    for (const auto& [name, array] : fields_) arrays.push_back(array);
    bank::FieldBytes triangles;
    triangles.field = {"mesh/triangles", "<i4", {model_.triangles.size(), 3}, "", "", nullptr};
    triangles.bytes = std::as_bytes(std::span(model_.triangles));
    arrays.push_back(triangles);
    bank::Bank bank = bank::assemble_bank(arrays, file_.name());
    for (const bank::Check& check : {bank::calc_regions_check(bank), bank::calc_provenance_check(bank)})
      if (!check.faults.empty()) throw InputError(fmt::format("{}: {}: the file {}", file_.name(), check.faults[0], kChanged));
    compare_modes(bank, swinging);
    return bank;
  }

  // ---- files of other programs ----

  /// Removes points without triangles.
  void drop_unused_points() {
    base::UsedPoints used = base::find_used_points(model_.triangles, model_.positions.size());
    used_ = std::move(used.points);
    for (auto& triangle : model_.triangles)
      for (std::int32_t& v : triangle) v = used.number[v];
    if (const std::size_t dropped = used.number.size() - used_.size(); dropped > 0)
      notes_.push_back(fmt::format("{} of its points belong to no triangle and were dropped", dropped));
  }

  /// Scale of the first node with the model; 1 if there is none.
  double find_scale() {
    std::vector<base::Object> nodes = root_.objects("nodes");
    std::vector<std::size_t> parent(nodes.size(), nodes.size());
    std::optional<std::size_t> found;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      if (nodes[n].has("children"))
        for (const double child : nodes[n].number_list("children", kMaxNodes))
          if (child >= 0.0 && child < static_cast<double>(nodes.size())) parent[child] = n;
      std::optional<base::Object> extensions = nodes[n].object_if("extensions");
      std::optional<base::Object> own = extensions ? extensions->object_if(kExtension) : std::nullopt;
      if (found || !own) continue;
      if (own->integer_if("modalModel", 0, std::numeric_limits<std::int32_t>::max()) == static_cast<long long>(number_)) found = n;
    }
    gltf::Matrix matrix = gltf::kIdentity;
    std::size_t steps = 0;
    for (std::size_t n = found.value_or(nodes.size()); n < nodes.size(); n = parent[n]) {
      if (++steps > nodes.size()) nodes[n].fail("", fmt::format("node {} is its own ancestor; export it again", n));
      matrix = gltf::multiply(gltf::read_transform(nodes[n]), matrix);
    }
    const std::array<double, 3> along{norm(Vec3{matrix[0], matrix[1], matrix[2]}), norm(Vec3{matrix[4], matrix[5], matrix[6]}),
                                      norm(Vec3{matrix[8], matrix[9], matrix[10]})};
    const auto [low, high] = std::minmax_element(along.begin(), along.end());
    if (!(*low > 0.0 && *high - *low <= kScaleTolerance * *high))
      nodes[*found].fail(
          "", "its node is not scaled by the same along all axes, which changes the modes; apply the scale, and compute them again");
    return *high;
  }

  bank::Material read_material(base::Object& extension, base::Object& model) {
    bank::Material material;
    if (reading_->material != nullptr) {
      material.young_modulus_pa = reading_->material->young_modulus_pa;
      material.poisson_ratio = reading_->material->poisson_ratio;
      material.density_kg_m3 = reading_->material->density_kg_m3;
      return material;
    }
    std::vector<base::Object> materials = extension.objects("acousticMaterials");
    const auto number = model.integer_if("material", 0, static_cast<long long>(materials.size()) - 1);
    if (!number) model.fail("material", "the model names no material, and contacts need its stiffness; give --material NAME");
    base::Object& own = materials[*number];
    for (const char* key : {"density", "youngsModulus", "poissonRatio"})
      if (!own.has(key)) own.fail(key, fmt::format("the material of the model has no \"{}\"; give --material NAME", key));
    material.density_kg_m3 = own.number("density", base::kPositive);
    material.young_modulus_pa = own.number("youngsModulus", base::kPositive);
    material.poisson_ratio = own.number("poissonRatio", {-1.0, 0.5});
    material.alpha2_per_s = own.number_or("alpha", 0.0);
    material.alpha1_s = own.number_or("beta", 0.0);
    return material;
  }

  /// True if modes and mass belong to the unscaled body: its density is closer to the material's than that of the scaled body.
  bool is_of_unscaled(base::Object& model, double scale, double volume_m3, double density_kg_m3) {
    constexpr double kDensityTolerance = 0.1;  // relative error of the volume inside facets
    std::optional<base::Object> own = model.object_if("massProperties");
    if (std::abs(scale - 1.0) <= kScaleTolerance || !(volume_m3 > 0.0)) return false;
    const auto note = [&](const std::string& text) {
      notes_.push_back(fmt::format("its node scales the body by {:.6g}, {}", scale, text));
    };
    if (!own || reading_->material != nullptr) {
      note("and it is unknown whether its modes are those of that size; they are used unchanged");
      return false;
    }
    const double mass = own->number("mass", base::kPositive);
    const double scaled = mass / (scale * scale * scale * volume_m3), unscaled = mass / volume_m3;
    const double scaled_off = std::abs(std::log(scaled / density_kg_m3)), unscaled_off = std::abs(std::log(unscaled / density_kg_m3));
    const bool is_unscaled = unscaled_off < scaled_off;
    const std::string taken = is_unscaled ? fmt::format(
                                                "its modes and its mass are those of scale 1, and were scaled, too (frequencies by "
                                                "{:.6g}, the mass by {:.6g})",
                                                1.0 / scale, scale * scale * scale)
                                          : "its modes and its mass are those of that size";
    if (std::min(scaled_off, unscaled_off) > kDensityTolerance)
      note(fmt::format(
          "and its mass contradicts the {:.5g} kg/m^3 of its material: {:.5g} with the scale, {:.5g} without; by the nearer one {}",
          density_kg_m3, scaled, unscaled, taken));
    else if (is_unscaled)
      note("and by the density of its material " + taken);
    return is_unscaled;
  }

  /// Scales the body by `scale`.
  static void scale_body(bank::Bank& bank, std::vector<double>& shapes, double scale) {
    for (std::size_t m = 0; m < bank.mode_count(); ++m) {
      bank.eigenvalue_rad2_s2[m] /= scale * scale;
      bank.decay_per_s[m] = bank.damping.law == "mixed" ? bank.decay_per_s[m] / scale  // equal loss factor
                                                        : bank::calc_decay(bank.damping, bank.material, bank.eigenvalue_rad2_s2[m]);
    }
    for (double& phi : shapes) phi /= scale * std::sqrt(scale);
    for (Vec3& p : bank.vertices_m) p = scale * p;
    bank.rigid.mass_kg *= std::pow(scale, 3);
    bank.rigid.volume_m3 *= std::pow(scale, 3);
    bank.rigid.centre_m = scale * bank.rigid.centre_m;
    for (double& x : bank.rigid.inertia_kg_m2) x *= std::pow(scale, 5);
  }

  /// Mass properties of the model, or of its surface filled with the material.
  void read_mass(base::Object& model, double scale, bank::Bank& bank) {
    const Solid solid = calc_solid(bank.vertices_m, bank.triangles);
    if (!(solid.volume_m3 > 0.0))
      model.fail("indices", "its triangles enclose no volume or face inward; a bank needs a closed surface that faces outward");
    bank.rigid.volume_m3 = solid.volume_m3;
    bank.rigid.mass_kg = bank.material.density_kg_m3 * solid.volume_m3;
    bank.rigid.centre_m = solid.centre_m;
    std::optional<base::Object> own = model.object_if("massProperties");
    std::optional<std::array<double, 3>> diagonal;
    if (own) {
      bank.rigid.mass_kg = own->number("mass", base::kPositive);
      for (std::size_t c = 0; c < 3; ++c) bank.rigid.centre_m[c] = scale * own->numbers_or<3>("centerOfMass", {0, 0, 0})[c];
      if (own->has("inertiaDiagonal")) diagonal = own->numbers<3>("inertiaDiagonal");
    }
    for (std::size_t i = 0; i < 9; ++i) bank.rigid.inertia_kg_m2[i] = bank.rigid.mass_kg / solid.volume_m3 * solid.inertia_m5[i];
    if (diagonal && (*diagonal)[0] > 0.0 && (*diagonal)[1] > 0.0 && (*diagonal)[2] > 0.0) {
      const auto q = own->numbers_or<4>("inertiaOrientation", {0, 0, 0, 1});
      const Eigen::Matrix3d axes = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized().toRotationMatrix();
      const Eigen::Matrix3d inertia =
          axes * Eigen::Vector3d((*diagonal)[0], (*diagonal)[1], (*diagonal)[2]).asDiagonal() * axes.transpose();
      Eigen::Map<Eigen::Matrix3d> of_surface(bank.rigid.inertia_kg_m2.data());  // symmetric
      if ((inertia - of_surface).norm() > kInertiaTolerance * of_surface.norm())
        notes_.push_back("its moments of inertia contradict its surface and its mass; those of the surface, filled evenly, were taken");
      else
        of_surface = inertia;
    }
    bank.material.density_kg_m3 = bank.rigid.mass_kg / solid.volume_m3;
  }

  /// Rayleigh's law if the decays follow it, else "mixed".
  static void settle_damping(bank::Bank& bank) {
    bank.damping.law = "mixed";
    const double a1 = bank.material.alpha1_s, a2 = bank.material.alpha2_per_s;
    std::vector<double> law;
    for (std::size_t m = 0; m < bank.mode_count(); ++m) law.push_back(0.5 * (a1 * bank.eigenvalue_rad2_s2[m] + a2));
    for (std::size_t m = 0; m < bank.mode_count(); ++m)
      if (!(std::abs(bank.decay_per_s[m] - law[m]) <= kDecayTolerance * law[m])) {
        bank.material.alpha1_s = bank.material.alpha2_per_s = 0.0;
        return;
      }
    bank.damping.law = "rayleigh";
    bank.decay_per_s = law;
  }

  bank::Bank make(base::Object& extension, base::Object& model) {
    drop_unused_points();
    const std::size_t modes = model_.freq_hz.size(), points = used_.size();
    const double node_scale = find_scale();
    bank::Bank bank;
    for (const std::int32_t v : used_) bank.vertices_m.push_back(model_.positions[v]);
    bank.triangles = model_.triangles;
    bank.material = read_material(extension, model);
    const bool is_of_unscaled_body =
        is_of_unscaled(model, node_scale, calc_solid(bank.vertices_m, bank.triangles).volume_m3, bank.material.density_kg_m3);
    const double scale = is_of_unscaled_body ? 1.0 : node_scale;
    for (Vec3& p : bank.vertices_m) p = scale * p;
    std::vector<double> lambda(modes);
    for (std::size_t m = 0; m < modes; ++m)
      lambda[m] = std::pow(2.0 * std::numbers::pi * model_.freq_hz[m], 2) + model_.decay_per_s[m] * model_.decay_per_s[m];
    const std::vector<std::size_t> order = base::find_sort_order(lambda);
    std::vector<double> shapes(3 * modes * points);
    for (std::size_t m = 0; m < modes; ++m) {
      bank.eigenvalue_rad2_s2.push_back(lambda[order[m]]);
      bank.decay_per_s.push_back(model_.decay_per_s[order[m]]);
      for (std::size_t v = 0; v < points; ++v)
        for (std::size_t c = 0; c < 3; ++c) {
          const double phi = model_.shapes.get(order[m] * model_.positions.size() + static_cast<std::size_t>(used_[v]), c);
          if (!std::isfinite(phi)) model.fail("shapes", fmt::format("mode {} moves point {} by {}", order[m], v, phi));
          shapes[(v * modes + m) * 3 + c] = phi;
        }
    }
    bank.residual.assign(modes, 0.0);
    read_mass(model, scale, bank);
    settle_damping(bank);
    if (is_of_unscaled_body) scale_body(bank, shapes, node_scale);
    bank::quantise_shapes(bank, shapes);
    bank::set_radiation_gains(bank, shapes);
    bank.counts = {.nodes = static_cast<std::int64_t>(points), .tets = 1, .components = 1, .rigid_modes = 6};
    bank.band_hz = {std::min(20.0, 0.99 * bank.freq_hz(0)), std::max(20000.0, 1.01 * bank.freq_hz(modes - 1))};
    bank.complete = false;
    bank.element = "imported";
    bank.mass = "consistent";
    bank.provenance = base::Json::object()
                          .set("imported", kExtension)
                          .set("file", base::printable(file_.name()))
                          .set("notes", base::Json::array(notes_))
                          .line();
    if (const std::vector<std::string> faults = bank::find_faults(bank); !faults.empty())
      throw InputError(
          fmt::format("{}: its model is not a valid bank: {}; correct it in the program that made it", file_.name(), faults[0]));
    return bank;
  }

  gltf::File file_;
  const GlbReading* reading_;
  base::Object root_;
  std::size_t number_ = 0;  // index of the model
  Model model_;
  std::vector<std::int32_t> used_;  // used points of another program's model
  std::vector<std::string> notes_;
  std::map<std::string, bank::FieldBytes> fields_;
};

}  // namespace

bank::Bank parse_glb(std::string_view bytes, const std::string& name, const GlbReading& reading, std::vector<std::string>* notes) {
  Reader reader(bytes, name, reading);
  bank::Bank bank = reader.read();
  if (notes != nullptr) *notes = reader.get_notes();
  return bank;
}

}  // namespace carillon::exchange
