// Surface modes: gains against closed forms of spheres, quantisation steps against the true shapes, on any number of ranks.
#include "precompute/run/io/surface_modes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <random>

#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::io {
namespace {

struct Shell {
  std::vector<Vec3> vertices_m;
  std::vector<Triangle> triangles;
};

/// An octahedron refined `times` times, on a sphere of the given radius; inward: reversed triangles.
Shell make_sphere(double radius, int times, Vec3 centre = {}, bool inward = false) {
  Shell shell{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
              {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
  for (int pass = 0; pass < times; ++pass) {
    std::map<std::pair<int, int>, int> middle;
    const auto between = [&](int a, int b) {
      const std::pair<int, int> key{std::min(a, b), std::max(a, b)};
      const auto [found, is_new] = middle.try_emplace(key, static_cast<int>(shell.vertices_m.size()));
      if (is_new) {
        Vec3 m;
        for (int k = 0; k < 3; ++k) m[k] = shell.vertices_m[a][k] + shell.vertices_m[b][k];
        const double length = std::hypot(m[0], m[1], m[2]);
        for (double& x : m) x /= length;
        shell.vertices_m.push_back(m);
      }
      return found->second;
    };
    std::vector<Triangle> finer;
    for (const auto& [a, b, c] : shell.triangles) {
      const int ab = between(a, b), bc = between(b, c), ca = between(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    shell.triangles = std::move(finer);
  }
  for (Vec3& x : shell.vertices_m)
    for (int k = 0; k < 3; ++k) x[k] = x[k] * radius + centre[k];
  if (inward)
    for (Triangle& t : shell.triangles) std::swap(t[1], t[2]);
  return shell;
}

void append(Shell& shell, const Shell& other) {
  const auto shift = static_cast<std::int32_t>(shell.vertices_m.size());
  shell.vertices_m.insert(shell.vertices_m.end(), other.vertices_m.begin(), other.vertices_m.end());
  for (const auto& [a, b, c] : other.triangles) shell.triangles.push_back({a + shift, b + shift, c + shift});
}

/// Rows of the vertices: scattered over the ranks, every third row belongs to no vertex; -1 where `is_held`.
std::vector<std::int32_t> make_rows(std::size_t vertices, const std::function<bool(std::size_t)>& is_held = {}) {
  std::vector<std::int32_t> rows(vertices);
  for (std::size_t v = 0; v < vertices; ++v) rows[v] = static_cast<std::int32_t>(v * 3 / 2);
  std::shuffle(rows.begin(), rows.end(), std::mt19937(5));
  for (std::size_t v = 0; v < vertices; ++v)
    if (is_held && is_held(v)) rows[v] = -1;
  return rows;
}

/// Shapes in the solver's layout: dense, unevenly distributed over the ranks, 77 in rows of no vertex.
petsc::MatHandle make_matrix(const std::vector<double>& shapes, const std::vector<std::int32_t>& row) {
  int rank = 0, ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  const std::size_t modes = shapes.size() / row.size() / 3;
  const auto nodes = static_cast<PetscInt>(row.size() * 3 / 2 + 1);
  const PetscInt own = rank + 1 < ranks ? nodes / (ranks + 1) : nodes - (ranks - 1) * (nodes / (ranks + 1));
  petsc::MatHandle matrix;
  petsc::check(MatCreateDense(MPI_COMM_WORLD, 3 * own, PETSC_DECIDE, 3 * nodes, static_cast<PetscInt>(modes), nullptr, matrix.out()));
  PetscInt first = 0, end = 0;
  petsc::check(MatGetOwnershipRange(matrix, &first, &end));
  double* values = nullptr;
  petsc::check(MatDenseGetArray(matrix, &values));
  std::fill(values, values + static_cast<std::size_t>(3 * own) * modes, 77.0);
  for (std::size_t v = 0; v < row.size(); ++v)
    for (int d = 0; d < 3; ++d)
      for (std::size_t m = 0; m < modes; ++m) {
        const PetscInt at = 3 * row[v] + d;
        if (row[v] >= 0 && at >= first && at < end)
          values[m * static_cast<std::size_t>(3 * own) + static_cast<std::size_t>(at - first)] = shapes[(v * modes + m) * 3 + d];
      }
  petsc::check(MatDenseRestoreArray(matrix, &values));
  return matrix;
}

SurfaceModes calc(const Shell& shell, std::span<const double> omega, const std::vector<double>& shapes,
                  const std::vector<std::int32_t>& row) {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  const auto matrix = make_matrix(shapes, row);
  return calc_surface_modes(MPI_COMM_WORLD, matrix, omega, rank == 0 ? Surface{shell.vertices_m, shell.triangles, row} : Surface{});
}

std::vector<double> calc_gain(const Shell& shell, std::span<const double> omega, const std::vector<double>& shapes) {
  return calc(shell, omega, shapes, make_rows(shell.vertices_m.size())).radiation_gain;
}

/// One mode per field, (V, m, 3).
std::vector<double> sample(const Shell& shell, const std::vector<std::function<Vec3(const Vec3&)>>& fields) {
  std::vector<double> shapes;
  for (const Vec3& x : shell.vertices_m)
    for (const auto& field : fields) {
      const Vec3 u = field(x);
      shapes.insert(shapes.end(), u.begin(), u.end());
    }
  return shapes;
}

constexpr double kRhoC = 1.21 * 343;

TEST(RadiationGain, of_a_pulsating_sphere_is_the_pressure_of_the_closed_form) {
  // |p| / (rho0 c u) of a sphere of radius 0.1 m with uniform radial velocity u, at r = 2 m; at 1 m it is twice that.
  // Values: |h_0(kr) / h_0'(ka)| at 100, 500 and 1000 Hz, computed from spherical Hankel functions (Pierce 1981, section 4.1).
  const std::vector<std::pair<double, double>> expected{{100, 0.009009251798}, {500, 0.03377119291}, {1000, 0.04388653096}};
  const Shell shell = make_sphere(0.1, 5);
  const auto radial = [](const Vec3& x) { return Vec3{x[0] / 0.1, x[1] / 0.1, x[2] / 0.1}; };
  for (const auto& [freq_hz, at_two_metres] : expected) {
    const std::vector<double> omega{2 * std::numbers::pi * freq_hz};
    const auto gain = calc_gain(shell, omega, sample(shell, {radial}));
    EXPECT_NEAR(gain[0] / (2 * at_two_metres * kRhoC), 1, 2e-3) << freq_hz;
  }
}

TEST(RadiationGain, of_a_trembling_sphere_is_half_that_of_a_pulsating_one_though_its_signed_sum_is_zero) {
  const Shell shell = make_sphere(0.1, 5);
  const auto radial = [](const Vec3& x) { return Vec3{x[0] / 0.1, x[1] / 0.1, x[2] / 0.1}; };
  const auto trembling = [](const Vec3&) { return Vec3{0, 0, 1}; };
  const auto quadrupole = [](const Vec3& x) {  // radial P_2(cos theta)
    const double c = x[2] / 0.1, p = (3 * c * c - 1) / 2;
    return Vec3{p * x[0] / 0.1, p * x[1] / 0.1, p * x[2] / 0.1};
  };
  const std::vector<double> omega(3, 1000.0);
  const auto gain = calc_gain(shell, omega, sample(shell, {radial, trembling, quadrupole}));
  EXPECT_NEAR(gain[1] / gain[0], 0.5, 1e-3);     // mean of |cos theta|
  EXPECT_NEAR(gain[2] / gain[0], 0.3849, 1e-3);  // mean of |P_2| = 2 / (3 sqrt 3)
}

TEST(RadiationGain, of_a_motion_along_the_surface_is_zero) {
  const Shell shell = make_sphere(0.1, 4);
  const auto spin = [](const Vec3& x) { return Vec3{-x[1], x[0], 0}; };
  const auto gain = calc_gain(shell, std::vector<double>{1000.0}, sample(shell, {spin}));
  const auto radial = [](const Vec3& x) { return x; };
  const auto loud = calc_gain(shell, std::vector<double>{1000.0}, sample(shell, {radial}));
  EXPECT_LT(gain[0], 1e-2 * loud[0]);
}

TEST(RadiationGain, ignores_the_wall_of_a_closed_cavity) {
  const Shell outer = make_sphere(0.1, 3);
  Shell hollow = outer;
  append(hollow, make_sphere(0.08, 3, {}, true));
  const auto radial = [](const Vec3& x) { return x; };
  const std::vector<double> omega{1000.0};
  const double both = calc_gain(hollow, omega, sample(hollow, {radial}))[0], alone = calc_gain(outer, omega, sample(outer, {radial}))[0];
  EXPECT_NEAR(both / alone, 1, 1e-13);
  EXPECT_EQ(bank::find_outer_triangles(hollow.vertices_m, hollow.triangles), outer.triangles);
}

TEST(RadiationGain, counts_two_separate_bodies_wherever_they_are) {
  Shell two = make_sphere(0.1, 2, {5, 0, 0});
  append(two, make_sphere(0.1, 2, {-5, 3, 1}));
  EXPECT_EQ(bank::find_outer_triangles(two.vertices_m, two.triangles).size(), two.triangles.size());
}

/// Twenty modes (more than one block), of very different sizes; mode 7 is at rest.
std::vector<double> make_waves(const Shell& shell) {
  std::vector<double> shapes;
  for (const Vec3& x : shell.vertices_m)
    for (int m = 0; m < 20; ++m)
      for (int d = 0; d < 3; ++d)
        shapes.push_back(m == 7 ? 0.0 : std::pow(10.0, m - 9) * std::sin(40 * x[0] * m + 30 * x[1] + 20 * x[2] * (d + 1)));
  return shapes;
}

TEST(SurfaceModes, have_the_steps_that_the_bank_makes_of_the_shapes_itself) {
  const Shell shell = make_sphere(0.1, 3);
  const std::vector<double> shapes = make_waves(shell);
  const std::vector<double> omega(20, 1000.0);
  const SurfaceModes modes = calc(shell, omega, shapes, make_rows(shell.vertices_m.size()));
  bank::Bank bank;
  bank.vertices_m = shell.vertices_m;
  bank.eigenvalue_rad2_s2.resize(20);
  bank::quantise_shapes(bank, shapes);
  EXPECT_EQ(modes.shape_scale, bank.shape_scale);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0) {
    EXPECT_EQ(modes.shape, bank.shape);
  } else {
    EXPECT_TRUE(modes.shape.empty());
  }
}

TEST(SurfaceModes, rest_where_nodes_are_held_and_radiate_from_the_others) {
  const Shell shell = make_sphere(0.1, 4);
  const auto radial = [](const Vec3& x) { return Vec3{x[0] / 0.1, x[1] / 0.1, x[2] / 0.1}; };
  const auto is_held = [&](std::size_t v) { return shell.vertices_m[v][2] < 0; };
  const std::vector<double> omega{1000.0};
  const std::vector<double> shapes = sample(shell, {radial});
  const SurfaceModes half = calc(shell, omega, shapes, make_rows(shell.vertices_m.size(), is_held));
  const double whole = calc_gain(shell, omega, shapes)[0];
  EXPECT_NEAR(half.radiation_gain[0] / whole, 0.5, 0.05);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank != 0) return;
  for (std::size_t v = 0; v < shell.vertices_m.size(); ++v)
    for (int d = 0; d < 3; ++d) {
      const double expected = is_held(v) ? 0.0 : shapes[3 * v + d];
      EXPECT_NEAR(half.shape[3 * v + d] * half.shape_scale[0], expected, 0.51 * half.shape_scale[0]) << v;
    }
}

TEST(SurfaceModes, that_are_not_finite_are_refused_on_every_rank) {
  const Shell shell = make_sphere(0.1, 2);
  std::vector<double> shapes = make_waves(shell);
  shapes[(5 * 20 + 18) * 3] = std::nan("");
  const auto rows = make_rows(shell.vertices_m.size());
  tests::expect_error<SolveError>({"mode 18"}, [&] { calc(shell, std::vector<double>(20, 1000.0), shapes, rows); });
}

TEST(SurfaceModes, of_no_modes_are_none) {
  const SurfaceModes modes = calc_surface_modes(MPI_COMM_WORLD, nullptr, {}, {});
  EXPECT_TRUE(modes.shape.empty() && modes.shape_scale.empty() && modes.radiation_gain.empty());
}

}  // namespace
}  // namespace carillon::io
