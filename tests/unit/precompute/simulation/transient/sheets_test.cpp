// Thin sheets: forces are the gradient of the energy, rigid motion costs nothing, plates have the frequencies of Kirchhoff's theory, and
// damping is that of the law. Oracles: differences, closed forms, Eigen.
#include "precompute/simulation/transient/sheets.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <numeric>
#include <random>
#include <tuple>

#include "precompute/simulation/transient/sheet_mesh.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/instruction_sets.hpp"

namespace carillon::transient {
namespace {

using std::numbers::pi;

constexpr double kYoung = 200e9, kPoisson = 0.3, kDensity = 7850.0;

SheetLaw make_law(double thickness_m, double alpha1_s = 0.0) {
  return {kYoung * kPoisson / ((1 + kPoisson) * (1 - 2 * kPoisson)), kYoung / (2 * (1 + kPoisson)), kDensity, thickness_m, alpha1_s};
}

/// A sheet on one rank: places are the numbers of the elements.
struct Sheet {
  Sheet(const SheetMesh& mesh, const std::vector<bool>& clamped, const SheetLaw& law)
      : elements(make_elements(mesh, clamped)), nodes(elements.count_nodes()), which(mesh.triangles.size()) {
    std::iota(which.begin(), which.end(), 0);
    sheets = std::make_unique<Sheets>(elements, which, law, elements.nodes, elements.nodes, nodes);
    for (auto* array : {&x, &v, &f}) array->resize(nodes + 1);
    for (std::int32_t n = 0; n < nodes; ++n)
      if (!is_angle(n)) set(n, elements.rest_m[n]);
  }
  bool is_angle(std::int32_t n) const { return n >= elements.vertices && n < elements.vertices + elements.edges; }
  void set(std::int32_t n, const Vec3& at) { x[n] = {at[0], at[1], at[2], 0}; }
  const std::vector<Quad>& calc_forces(const StepWeights& weights = {}) {
    std::fill(f.begin(), f.end(), Quad{});
    sheets->add_forces(weights, x.data(), v.data(), f.data());
    return f;
  }
  double calc_energy() const {
    double energy = 0;
    for (std::size_t k = 0; k < sheets->count(); ++k) energy += sheets->calc_energy(k, x.data());
    return energy;
  }
  double find_largest_force() {
    double largest = 0;
    calc_forces();
    for (std::int32_t n = 0; n < nodes; ++n) {
      const Quad& q = f[n];
      largest = std::max({largest, std::abs(q.x), std::abs(q.y), std::abs(q.z)});
    }
    return largest;
  }

  SheetElements elements;
  std::int32_t nodes;
  std::vector<std::int32_t> which;
  std::unique_ptr<Sheets> sheets;
  std::vector<Quad> x, v, f;
};

std::vector<bool> mark(const SheetMesh& mesh, const std::string& set) {
  std::vector<bool> marked(mesh.vertices_m.size());
  if (!set.empty())
    for (const std::int32_t v : mesh.node_sets.at(set)) marked[v] = true;
  return marked;
}

TEST(Sheets, forces_against_energy_gradient) {
  tests::for_each_instruction_set([&] {
    const SheetMesh mesh = make_rectangle(0.3, 0.2, 6, 0.02);
    Sheet sheet(mesh, mark(mesh, "x-min"), make_law(0.01));
    std::mt19937 random(7);
    std::normal_distribution<double> draw(0.0, 3e-3);
    for (std::int32_t n = 0; n < sheet.nodes; ++n) {
      Quad& q = sheet.x[n];
      q.x += draw(random);
      if (!sheet.is_angle(n)) q.y += draw(random), q.z += draw(random);
    }
    const std::vector<Quad> forces = sheet.calc_forces();
    double largest = 0, worst = 0;
    for (std::int32_t n = 0; n < sheet.nodes; ++n)
      for (int axis = 0; axis < (sheet.is_angle(n) ? 1 : 3); ++axis) {
        double& value = (&sheet.x[n].x)[axis];
        const double kept = value, step = 1e-6;
        value = kept + step;
        const double above = sheet.calc_energy();
        value = kept - step;
        const double below = sheet.calc_energy();
        value = kept;
        const double force = (&forces[n].x)[axis];
        worst = std::max(worst, std::abs(force + (above - below) / (2 * step)));
        largest = std::max(largest, std::abs(force));
      }
    EXPECT_LT(worst, 1e-8 * largest);
  });
}

TEST(Sheets, rigid_motion) {
  const SheetMesh mesh = make_rectangle(0.3, 0.2, 8, 0.03);
  Sheet sheet(mesh, mark(mesh, ""), make_law(0.001));
  for (std::int32_t n = 0; n < sheet.nodes; ++n) {
    if (sheet.is_angle(n)) continue;
    const Vec3& r = sheet.elements.rest_m[n];
    const double c = std::cos(2.0), s = std::sin(2.0);
    sheet.set(n, {c * r[0] - s * r[2] + 1, r[1] + 2, s * r[0] + c * r[2] + 3});
  }
  EXPECT_LT(sheet.find_largest_force(), 1e-11 * kYoung * 0.001 * 0.3);
}

TEST(Sheets, force_and_moment_balance) {
  const SheetMesh mesh = make_disc(0.1, 10);
  Sheet sheet(mesh, mark(mesh, ""), make_law(0.001));
  std::mt19937 random(3);
  std::normal_distribution<double> draw(0.0, 2e-4);
  for (std::int32_t n = 0; n < sheet.elements.vertices; ++n) {
    Quad& q = sheet.x[n];
    q = {q.x + draw(random), q.y + draw(random), q.z + draw(random), 0};
  }
  sheet.calc_forces();
  Vec3 total{}, moment{};
  double size = 0;
  for (std::int32_t n = 0; n < sheet.elements.vertices; ++n) {
    const Quad &q = sheet.x[n], &f = sheet.f[n];
    const Vec3 force{f.x, f.y, f.z};
    total = total + force;
    moment = moment + cross({q.x, q.y, q.z}, force);
    size += norm(force);
  }
  EXPECT_LT(norm(total), 1e-12 * size);
  EXPECT_LT(norm(moment), 1e-12 * size * 0.1);
}

/// The lowest bending frequency [Hz] of a flat sheet, by its tangent stiffness: differences of forces, Eigen.
double find_lowest_hz(const SheetMesh& mesh, const std::string& clamped, const std::string& hinged, const SheetLaw& law) {
  Sheet sheet(mesh, mark(mesh, clamped), law);
  const std::vector<double> mass = calc_masses(sheet.elements, law);
  const std::vector<bool> is_clamped = mark(mesh, clamped), is_hinged = mark(mesh, hinged);
  std::vector<std::int32_t> free;
  for (std::int32_t n = 0; n < sheet.elements.vertices; ++n)
    if (!is_clamped[n] && !is_hinged[n]) free.push_back(n);
  for (std::int32_t e = 0; e < sheet.elements.edges; ++e) {
    const auto [a, b] = sheet.elements.edge[e];
    if (!(is_clamped[a] && is_clamped[b])) free.push_back(sheet.elements.vertices + e);
  }
  const auto count = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd stiffness(count, count);
  const auto at = [&](std::vector<Quad>& values, Eigen::Index i) -> double& {
    const std::int32_t n = free[i];
    Quad& q = values[n];
    return sheet.is_angle(n) ? q.x : q.z;
  };
  const double step = 1e-9;
  for (Eigen::Index j = 0; j < count; ++j) {
    at(sheet.x, j) = step;
    sheet.calc_forces();
    for (Eigen::Index i = 0; i < count; ++i) stiffness(i, j) = -at(sheet.f, i) / step;
    at(sheet.x, j) = 0;
  }
  const Eigen::MatrixXd even = 0.5 * (stiffness + stiffness.transpose());
  Eigen::VectorXd root(count);
  for (Eigen::Index i = 0; i < count; ++i) root(i) = 1 / std::sqrt(mass[free[i]]);
  const Eigen::MatrixXd scaled = root.asDiagonal() * even * root.asDiagonal();
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled, Eigen::EigenvaluesOnly).eigenvalues()(0)) / (2 * pi);
}

// Square plates of side a: omega a^2 sqrt(rho h / D) = 2 pi^2 hinged, 35.985 clamped (Leissa 1969); second order in the cell.
TEST(Sheets, kirchhoff_plate_frequencies) {
  const double side = 0.3, thickness = 0.001;
  const double rigidity = kYoung * std::pow(thickness, 3) / (12 * (1 - kPoisson * kPoisson));
  const double unit = std::sqrt(rigidity / (kDensity * thickness)) / (2 * pi * side * side);
  for (const auto& [clamped, hinged, lambda] : {std::tuple("", "rim", 2 * pi * pi), std::tuple("rim", "", 35.985)}) {
    double hz[2];
    for (int k = 0; k < 2; ++k) hz[k] = find_lowest_hz(make_rectangle(side, side, k == 0 ? 9 : 18), clamped, hinged, make_law(thickness));
    const double extrapolated = hz[1] + (hz[1] - hz[0]) / 3;
    EXPECT_NEAR(extrapolated / (lambda * unit), 1.0, *clamped != '\0' ? 1e-2 : 1e-3) << lambda;
    EXPECT_LT(std::abs(hz[1] / (lambda * unit) - 1), 0.05);
  }
}

// Stretched by e in one direction and free to contract in the other two: E of a plane strip, and the same force from a rate by alpha1.
TEST(Sheets, membrane_stress_and_damping) {
  tests::for_each_instruction_set([&] {
    const SheetMesh mesh = make_rectangle(0.2, 0.1, 4);
    const double alpha1 = 1e-5, strain = 1e-7, rate = 1e-2;
    Sheet sheet(mesh, mark(mesh, ""), make_law(0.002, alpha1));
    for (std::int32_t n = 0; n < sheet.elements.vertices; ++n) {
      const Vec3& r = sheet.elements.rest_m[n];
      sheet.set(n, {r[0] * (1 + strain), r[1] * (1 - kPoisson * strain), 0});
      sheet.v[n] = {rate * r[0], -kPoisson * rate * r[1], 0, 0};
    }
    sheet.calc_forces({0.5e-6, 0.5e-6, 1e-6});
    double pull = 0;
    for (const std::int32_t n : mesh.node_sets.at("x-max")) pull -= sheet.f[n].x;
    const double section = 0.1 * 0.002, expected = kYoung * section * (strain + alpha1 * rate);
    EXPECT_NEAR(pull, expected, 1e-5 * expected);
    // The same again: two halves of the work of a step of 1e-6 s, and the first half of the next.
    sheet.calc_forces({0.5e-6, 0.5e-6, 1e-6});
    double spent = 0;
    for (std::size_t k = 0; k < sheet.sheets->count(); ++k) spent += sheet.sheets->get_spent(k);
    EXPECT_NEAR(spent, 1.5e-6 * kYoung * alpha1 * rate * rate * section * 0.2, 1e-5 * spent);
  });
}

TEST(SheetMesh, refusals) {
  EXPECT_THROW(make_rectangle(0.1, 0, 4), InputError);
  EXPECT_THROW(make_rectangle(0.1, 0.1, 1), InputError);
  EXPECT_THROW(make_rectangle(0.1, 0.1, 4, 0.05), InputError);
  EXPECT_THROW(make_disc(-1, 4), InputError);
  SheetMesh fan;
  fan.vertices_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}};
  fan.triangles = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
  EXPECT_THROW(make_elements(fan, std::vector<bool>(5)), InputError);
  fan.triangles = {{0, 1, 2}, {0, 1, 3}};
  EXPECT_THROW(make_elements(fan, std::vector<bool>(5)), InputError);
  fan.triangles = {{0, 1, 1}};
  EXPECT_THROW(make_elements(fan, std::vector<bool>(5)), InputError);
}

TEST(SheetMesh, bow_and_disc) {
  const SheetMesh bowed = make_rectangle(0.3, 0.1, 10, 0.02);
  double top = 0;
  for (const Vec3& x : bowed.vertices_m) top = std::max(top, x[2]);
  EXPECT_NEAR(top, 0.02, 1e-12);
  for (const std::int32_t n : bowed.node_sets.at("x-min")) EXPECT_NEAR(bowed.vertices_m[n][2], 0.0, 1e-12);
  const SheetMesh disc = make_disc(0.1, 20);
  double area = 0;
  for (const Triangle& t : disc.triangles)
    area += 0.5 * norm(cross(disc.vertices_m[t[1]] - disc.vertices_m[t[0]], disc.vertices_m[t[2]] - disc.vertices_m[t[0]]));
  EXPECT_NEAR(area, 60 * 0.5 * 0.01 * std::sin(2 * pi / 60), 1e-12);  // of the polygon
}

}  // namespace
}  // namespace carillon::transient
