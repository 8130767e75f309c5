// Method: outer faces are those of one tetrahedron; the faces of ten-node tetrahedra become four flat triangles. Shapes are divided by the
//   root of the generalised mass, of the file or by the density.
#include "runtime/exchange/solved_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/bank/of_material.hpp"
#include "runtime/bank/radiation_gain.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/sort_order.hpp"
#include "runtime/exchange/solid.hpp"

namespace carillon::exchange {
namespace {

constexpr double kRigidShare = 1e-8;     // of the highest eigenvalue
constexpr double kTonnesPerMm3 = 1e-12;  // of a kg/m^3
constexpr double kUnitMass = 0.1;        // largest distance of a mass-normalised mode from 1
constexpr double kLargestUnits = 10.0;   // of a body whose units are not given
constexpr std::array<std::array<int, 3>, 4> kFaces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};  // outward

/// Position of the mid node of an edge among the nodes of a ten-node tetrahedron.
int find_middle(int a, int b) {
  constexpr int kMiddle[4][4] = {{0, 4, 6, 7}, {4, 0, 5, 8}, {6, 5, 0, 9}, {7, 8, 9, 0}};
  return kMiddle[a][b];
}

void add_face(const SolvedModel& model, const std::vector<std::size_t>& tet, int side, std::vector<Triangle>& surface) {
  const auto edge = [&](int c) { return model.nodes[tet[c]] - model.nodes[tet[0]]; };
  const bool is_turned = dot(cross(edge(1), edge(2)), edge(3)) < 0.0;
  std::array<int, 3> corner = kFaces[side];
  if (is_turned) std::swap(corner[1], corner[2]);
  const auto add = [&](int a, int b, int c) {
    surface.push_back({static_cast<std::int32_t>(tet[a]), static_cast<std::int32_t>(tet[b]), static_cast<std::int32_t>(tet[c])});
  };
  if (tet.size() == 4) return add(corner[0], corner[1], corner[2]);
  const int m01 = find_middle(corner[0], corner[1]), m12 = find_middle(corner[1], corner[2]), m20 = find_middle(corner[2], corner[0]);
  add(corner[0], m01, m20);
  add(m01, corner[1], m12);
  add(m20, m12, corner[2]);
  add(m01, m12, m20);
}

/// Triangles of node indices.
std::vector<Triangle> find_surface(const SolvedModel& model) {
  struct Face {
    std::array<std::size_t, 3> corners;
    std::size_t tet;
    int side;
  };
  std::vector<Face> faces;
  for (std::size_t e = 0; e < model.tets.size(); ++e)
    for (int f = 0; f < 4; ++f) {
      std::array<std::size_t, 3> corners{};
      for (int c = 0; c < 3; ++c) corners[c] = model.tets[e][kFaces[f][c]];
      std::sort(corners.begin(), corners.end());
      faces.push_back({corners, e, f});
    }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.corners < b.corners; });
  std::vector<Triangle> surface;
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t next = i + 1;
    while (next < faces.size() && faces[next].corners == faces[i].corners) ++next;
    if (next == i + 1) add_face(model, model.tets[faces[i].tet], faces[i].side, surface);
    i = next;
  }
  return surface;
}

constexpr double kSame = 1e-6;  // relative difference of the eigenvalues, and of the squared shapes, of a mode that is given twice

/// True for proportional shapes: modes of a pair are orthogonal.
bool are_same(const SolvedMode& a, const SolvedMode& b) {
  double product = 0.0, of_a = 0.0, of_b = 0.0;
  for (std::size_t n = 0; n < std::min(a.shape.size(), b.shape.size()); ++n) {
    product += dot(a.shape[n], b.shape[n]);
    of_a += dot(a.shape[n], a.shape[n]);
    of_b += dot(b.shape[n], b.shape[n]);
  }
  return product * product > (1.0 - kSame) * of_a * of_b;
}

/// Modes that are not rigid, by frequency.
std::vector<std::size_t> choose_modes(const SolvedModel& model, const std::string& name) {
  std::vector<double> lambda;
  for (const SolvedMode& mode : model.modes) lambda.push_back(mode.eigenvalue_rad2_s2);
  const double highest = *std::max_element(lambda.begin(), lambda.end());
  std::vector<std::size_t> chosen;
  for (const std::size_t m : base::find_sort_order(lambda))
    if (lambda[m] > kRigidShare * highest) chosen.push_back(m);
  if (chosen.empty()) throw InputError(fmt::format("{}: all {} modes are rigid; solve for more modes", name, model.modes.size()));
  for (std::size_t i = 1; i < chosen.size(); ++i)
    for (std::size_t j = i; j-- > 0 && lambda[chosen[i]] - lambda[chosen[j]] <= kSame * lambda[chosen[i]];)
      if (are_same(model.modes[chosen[j]], model.modes[chosen[i]]))
        throw InputError(
            fmt::format("{}: modes {} and {} are the same; write the modes of one step or analysis", name, chosen[j] + 1, chosen[i] + 1));
  return chosen;
}

/// (modes) Generalised masses: those of the file, else by the density in the units of the model.
std::vector<double> find_masses(const SolvedModel& model, double density, const std::string& name) {
  if (!model.modes.front().mass) {
    std::vector<double> masses = calc_generalised_masses(model, density);
    for (std::size_t m = 0; m < masses.size(); ++m)
      if (!(masses[m] > 0.0) || !std::isfinite(masses[m]))
        throw InputError(
            fmt::format("{}: mode {} has a generalised mass of {:g}; write the displacements of all nodes", name, m + 1, masses[m]));
    return masses;
  }
  std::vector<double> masses;
  for (const SolvedMode& mode : model.modes) masses.push_back(mode.mass.value_or(1.0));
  return masses;
}

void check_size(const bank::Bank& bank, const std::string& name) {
  double largest = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] =
        std::minmax_element(bank.vertices_m.begin(), bank.vertices_m.end(), [k](const Vec3& a, const Vec3& b) { return a[k] < b[k]; });
    largest = std::max(largest, (*high)[k] - (*low)[k]);
  }
  if (largest > kLargestUnits)
    throw InputError(fmt::format(
        "{}: the body is {:g} units across; give --unit mm-t-s for millimetres, tonnes and seconds, or --unit m-kg-s", name, largest));
}

void set_mass(bank::Bank& bank, const std::string& name) {
  const Solid solid = calc_solid(bank.vertices_m, bank.triangles);
  if (!(solid.volume_m3 > 0.0)) throw InputError(fmt::format("{}: the tetrahedra enclose no volume; check the mesh", name));
  bank.rigid.volume_m3 = solid.volume_m3;
  bank.rigid.mass_kg = bank.material.density_kg_m3 * solid.volume_m3;
  bank.rigid.centre_m = solid.centre_m;
  for (std::size_t i = 0; i < 9; ++i) bank.rigid.inertia_kg_m2[i] = bank.material.density_kg_m3 * solid.inertia_m5[i];
}

}  // namespace

bank::Bank make_bank(const SolvedModel& model, const std::string& name, const ResultsReading& reading, std::vector<std::string>* notes) {
  for (const auto& tet : model.tets)
    if (tet.size() != model.tets.front().size())
      throw InputError(fmt::format("{}: tetrahedra of 4 and of 10 nodes; use one order for the whole body", name));
  const bool is_mm = (reading.are_units_given ? reading.units : model.units.value_or(reading.units)) == ModelUnits::kMillimetre;
  const double metres = is_mm ? 1e-3 : 1.0, per_root_kg = is_mm ? 1.0 / std::sqrt(1000.0) : 1.0;
  bank::Bank bank;
  std::vector<std::int32_t> vertex_of(model.nodes.size(), -1);
  std::vector<std::size_t> used;
  bank.triangles = find_surface(model);
  if (bank.triangles.empty()) throw InputError(fmt::format("{}: the tetrahedra have no outer face: some are there twice", name));
  for (Triangle& triangle : bank.triangles)
    for (std::int32_t& node : triangle) {
      std::int32_t& vertex = vertex_of[node];
      if (vertex < 0) {
        vertex = static_cast<std::int32_t>(used.size());
        used.push_back(static_cast<std::size_t>(node));
        bank.vertices_m.push_back(metres * model.nodes[node]);
      }
      node = vertex;
    }
  if (!reading.are_units_given && !model.units) check_size(bank, name);
  const material::Material& material = *reading.material;
  bank.material = {material.young_modulus_pa, material.poisson_ratio, material.density_kg_m3, 0.0, 0.0};
  if (material.law == material::DampingLaw::rayleigh) {
    bank.material.alpha1_s = material.alpha1_s;
    bank.material.alpha2_per_s = material.alpha2_per_s;
  }
  bank.damping = bank::make_damping(material);
  const std::vector<std::size_t> chosen = choose_modes(model, name);
  const std::size_t modes = chosen.size(), rigid = model.modes.size() - modes;
  std::vector<std::string> said;
  if (rigid > 0) said.push_back(fmt::format("{} rigid modes were left out", rigid));
  const std::vector<double> masses = find_masses(model, is_mm ? kTonnesPerMm3 * material.density_kg_m3 : material.density_kg_m3, name);
  if (const auto [least, most] = std::minmax_element(masses.begin(), masses.end());
      !model.modes.front().mass && (*least < 1.0 - kUnitMass || *most > 1.0 + kUnitMass))
    said.push_back(
        fmt::format("generalised masses of {:.3g} to {:.3g} by the density of {}; if the modes were written with masses of 1, correct "
                    "--material or --unit",
                    *least, *most, material.name));
  std::vector<double> shapes(3 * modes * used.size());
  for (std::size_t m = 0; m < modes; ++m) {
    const SolvedMode& mode = model.modes[chosen[m]];
    bank.eigenvalue_rad2_s2.push_back(mode.eigenvalue_rad2_s2);
    bank.decay_per_s.push_back(mode.decay_per_s.value_or(bank::calc_decay(bank.damping, bank.material, bank.eigenvalue_rad2_s2.back())));
    for (std::size_t v = 0; v < used.size(); ++v)
      for (std::size_t c = 0; c < 3; ++c)
        shapes[(v * modes + m) * 3 + c] = per_root_kg / std::sqrt(masses[chosen[m]]) * mode.shape[used[v]][c];
  }
  if (std::any_of(model.modes.begin(), model.modes.end(), [](const SolvedMode& mode) { return mode.decay_per_s.has_value(); })) {
    bank.damping = {};
    bank.damping.law = "mixed";
    bank.material.alpha1_s = bank.material.alpha2_per_s = 0.0;
  }
  bank.residual.assign(modes, 0.0);
  set_mass(bank, name);
  bank::quantise_shapes(bank, shapes);
  bank::set_radiation_gains(bank, shapes);
  bank.counts = {.nodes = static_cast<std::int64_t>(model.nodes.size()),
                 .tets = static_cast<std::int64_t>(model.tets.size()),
                 .components = 1,
                 .rigid_modes = rigid >= 6 ? 6 : 0};
  bank.band_hz = {std::min(20.0, 0.99 * bank.freq_hz(0)), std::max(20000.0, 1.01 * bank.freq_hz(modes - 1))};
  bank.complete = false;
  bank.element = "imported";
  bank.mass = "consistent";
  bank.provenance = base::Json::object()
                        .set("imported", base::printable(model.program))
                        .set("file", base::printable(name))
                        .set("notes", base::Json::array(said))
                        .line();
  if (const std::vector<std::string> faults = bank::find_faults(bank); !faults.empty())
    throw InputError(fmt::format("{}: its modes are not a valid bank: {}; check the units (--unit) and the model", name, faults[0]));
  if (notes != nullptr) *notes = std::move(said);
  return bank;
}

}  // namespace carillon::exchange
