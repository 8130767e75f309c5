// Modes that are nearly degenerate, nearly zero, at the end of the band, or not there.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/hard/figure.hpp"
#include "tests/hard/spectra_body.hpp"
#include "tests/support/ranks.hpp"

namespace carillon::hard {
namespace {

constexpr double kRho = 7850, kNu = 0.3, kE = 200e9;

Body make_brick(int order, const material::Material& material = make_solid(kE, kNu, kRho), Vec3 origin = {}) {
  const std::array<int, 3> cells = order == 1 ? std::array{4, 5, 6} : std::array{2, 2, 3};
  const mesh::TetMesh box = shapes::make_box({0.05, 0.065, 0.085}, cells, order);
  return {move_nodes(box, [&](const Vec3& x) { return Vec3{x[0] + origin[0], x[1] + origin[1], x[2] + origin[2]}; }), {material}};
}

/// Share of a mode's kinetic energy at x < 0; on every rank.
std::vector<double> find_shares(const Answer& answer) {
  petsc::VecHandle phi, m_phi;
  petsc::check(MatCreateVecs(answer.system.mass, phi.out(), m_phi.out()));
  std::vector<double> shares(answer.freq_hz.size(), 0.0);
  for (std::size_t j = 0; j < shares.size(); ++j) {
    petsc::check(MatGetColumnVector(answer.modes.shapes, phi, static_cast<PetscInt>(j)));
    petsc::check(MatMult(answer.system.mass, phi, m_phi));
    const PetscScalar *u = nullptr, *v = nullptr;
    petsc::check(VecGetArrayRead(phi, &u));
    petsc::check(VecGetArrayRead(m_phi, &v));
    for (std::int32_t i = 0; i < answer.pieces.local.free_nodes; ++i)
      if (answer.pieces.local.nodes_m[i][0] < 0)
        for (int d = 0; d < 3; ++d) shares[j] += u[3 * i + d] * v[3 * i + d];
    petsc::check(VecRestoreArrayRead(m_phi, &v));
    petsc::check(VecRestoreArrayRead(phi, &u));
  }
  MPI_Allreduce(MPI_IN_PLACE, shares.data(), static_cast<int>(shares.size()), MPI_DOUBLE, MPI_SUM, PETSC_COMM_WORLD);
  return shares;
}

/// How far the modes are from being of one body alone.
double find_largest_mixture(const Answer& answer) {
  double largest = 0;
  for (const double share : find_shares(answer)) largest = std::max(largest, std::min(std::abs(share), std::abs(1 - share)));
  return largest;
}

TEST(spectra, two_equal_components) {
  const std::string id = "two_equal_components";
  for (const int order : {1, 2}) {
    const std::string part = order == 1 ? "T4" : "T10";
    const Body one = make_brick(order, make_solid(kE, kNu, kRho), {-0.1, 0, 0});
    const Body two = join(one, make_brick(order, make_solid(kE, kNu, kRho), {0.2, 0.1, 0}));
    const eigen::Options options = make_band(20, 40e3);
    const std::vector<double> single = solve(PETSC_COMM_SELF, one, options).freq_hz;
    std::vector<double> twice;
    for (const double f : single) twice.insert(twice.end(), 2, f);
    const Answer answer = hold_every_way(id, part, two, options);
    hold(id, find_largest_difference(answer.freq_hz, twice), 1e-9, part + " against one body");
    hold(id, std::abs(static_cast<double>(answer.modes.rigid_count) - 12), 0, part + " rigid modes");
    hold(id, find_largest_mixture(answer), 1e-9, part + " mixture");
  }
}

TEST(spectra, almost_equal_components) {
  const std::string id = "almost_equal_components";
  for (const double split : {1e-8, 1e-9, 1e-10, 1e-12}) {
    for (const int order : {1, 2}) {
      const std::string part = (order == 1 ? "T4 " : "T10 ") + std::to_string(static_cast<int>(std::lround(std::log10(split))));
      const Body one = make_brick(order, make_solid(kE, kNu, kRho), {-0.1, 0, 0});
      // f grows as the root of E.
      const Body two = join(one, make_brick(order, make_solid(kE * (1 + 2 * split), kNu, kRho), {0.2, 0.1, 0}));
      const eigen::Options options = make_band(20, 35e3);
      const Answer answer = hold_every_way(id, part, two, options);
      double worst = answer.freq_hz.size() % 2 == 0 ? 0 : 1e9;
      for (std::size_t m = 0; m + 1 < answer.freq_hz.size(); m += 2)
        worst = std::max(worst, std::abs(answer.freq_hz[m + 1] / answer.freq_hz[m] - 1 - split));
      hold(id, worst, 2e-12, part + " split");
      hold(id, find_largest_mixture(answer), 1e-3, part + " mixture");
    }
  }
}

/// Two stiff blocks 0.1 m x 0.1 m x 0.1 m on the ends of a light soft layer of 0.02 m, nu = 0: a rod in three dimensions, whose modes along
/// it obey an equation that is exact.
Body make_dumbbell(int order, double soft_e_pa) {
  mesh::TetMesh rod = shapes::make_box({0.22, 0.1, 0.1}, {5, 1, 1}, 1);
  const std::array<double, 6> planes{-0.11, -0.06, -0.01, 0.01, 0.06, 0.11};
  for (Vec3& x : rod.nodes_m) x[0] = planes[std::lround((x[0] + 0.11) / 0.044)];
  for (std::size_t e = 0; e < rod.regions.size(); ++e) {
    double middle = 0;
    for (std::size_t i = 0; i < 4; ++i) middle += rod.nodes_m[rod.tets[4 * e + i]][0] / 4;
    rod.regions[e] = std::abs(middle) < 0.01 ? 1 : 0;
  }
  rod.node_sets.clear();
  if (order == 2) rod = mesh::to_quadratic(rod);
  return {std::move(rod), {make_solid(kE, 0, kRho), make_solid(soft_e_pa, 0, 10)}};
}

/// The lowest mode along the dumbbell: the middle stands still, and where the materials meet E k tan(k l) of the block balances E k cot(k
/// l) of half the layer.
double find_lowest_hz(double soft_e_pa) {
  const auto balance = [&](double omega) {
    const double k1 = omega * std::sqrt(kRho / kE), k2 = omega * std::sqrt(10 / soft_e_pa);
    return kE * k1 * std::tan(k1 * 0.1) - soft_e_pa * k2 / std::tan(k2 * 0.01);
  };
  double low = 1e-9, high = std::sqrt(soft_e_pa / 10) / 0.01;  // The layer alone resonates above.
  for (int i = 0; i < 200; ++i) {
    const double middle = (low + high) / 2;
    (balance(middle) < 0 ? low : high) = middle;
  }
  return low / (2 * std::numbers::pi);
}

/// The dumbbell's modes: one along it as the equation has it, six slow ones, and all that Eigen's L D L^T counts. Moduli differ by 6e10:
/// the rounding of K as it is stored moves those that turn a block by up to 1.4e-5 (against strain energies in long double), and ranks,
/// which add its elements in other orders, by up to twice that from each other.
void hold_dumbbell(const std::string& id, int order, const eigen::Options& options) {
  constexpr double kSoft = 3.2;
  const Body dumbbell = make_dumbbell(order, kSoft);
  const Answer answer = solve(PETSC_COMM_WORLD, dumbbell, options), alone = solve(PETSC_COMM_SELF, dumbbell, options);
  const std::string part = std::string(order == 1 ? "T4" : "T10") + " dumbbell from " + std::to_string(options.low_hz) + " to " +
                           std::to_string(options.high_hz) + " Hz";
  double nearest = 1;
  for (const double f : answer.freq_hz) nearest = std::min(nearest, std::abs(f / find_lowest_hz(kSoft) - 1));
  hold(id, nearest, 1e-8, part);
  const auto slow = std::count_if(answer.freq_hz.begin(), answer.freq_hz.end(), [](double f) { return f < 1; });
  hold(id, std::abs(static_cast<double>(slow - 6)), 0, part + " slow modes");
  const std::int64_t counted = count_below(alone.system, options.high_hz) - 6;
  hold(id, std::abs(static_cast<double>(static_cast<std::int64_t>(answer.freq_hz.size()) - counted)), 0, part + " modes");
  hold(id, std::abs(static_cast<double>(answer.modes.count_below_low) - 6), 0, part + " zeros");
  hold(id, find_largest_difference(answer.freq_hz, alone.freq_hz), 3e-5, part + " ranks");
}

TEST(spectra, tenth_hz) {
  const std::string id = "tenth_hz";
  // All of the body soft: E such that the lowest mode of the sphere-like brick is at 0.1 Hz, in addition to six zeros, and nothing stiff.
  for (const int order : {1, 2}) {
    const std::string part = order == 1 ? "T4 soft" : "T10 soft";
    const double stiff_hz = solve(PETSC_COMM_SELF, make_brick(order), make_band(20, 20e3)).freq_hz.at(0);
    const Body soft = make_brick(order, make_solid(kE * std::pow(0.1 / stiff_hz, 2), kNu, kRho));
    for (const double low_hz : {0.05, 1e-3}) {
      const eigen::Options options = make_band(low_hz, 0.25);
      const Answer answer = hold_every_way(id, part, soft, options);
      hold(id, std::abs(answer.freq_hz.at(0) / 0.1 - 1), 1e-9, part + " against the stiff brick");
      hold(id, std::abs(static_cast<double>(answer.modes.count_below_low) - 6), 0, part + " zeros");
    }
  }
  // Stiff blocks on a soft layer: six modes near 0.1 Hz, the six zeros, and modes of some kHz, in one band.
  for (const int order : {1, 2})
    for (const double high_hz : {20.0, 20e3})
      for (const double low_hz : {0.05, 1e-4}) hold_dumbbell(id, order, make_band(low_hz, high_hz));
}

TEST(spectra, below_20_hz) {
  // A mode under the band is counted and not in the list; in a band that begins under it, it is.
  const std::string id = "below_20_hz";
  for (const int order : {1, 2}) {
    const std::string part = order == 1 ? "T4" : "T10";
    const double stiff_hz = solve(PETSC_COMM_SELF, make_brick(order), make_band(20, 20e3)).freq_hz.at(0);
    const Body slow = make_brick(order, make_solid(kE * std::pow(15 / stiff_hz, 2), kNu, kRho));
    const Answer above = hold_every_way(id, part + " from 20 Hz", slow, make_band(20, 40));
    const Answer all = hold_every_way(id, part + " from 5 Hz", slow, make_band(5, 40));
    hold(id, std::abs(all.freq_hz.at(0) / 15 - 1), 1e-9, part + " the slow mode");
    const auto slower = std::count_if(all.freq_hz.begin(), all.freq_hz.end(), [](double f) { return f < 20; });
    hold(id, std::abs(static_cast<double>(above.modes.count_below_low - 6 - slower)), 0, part + " counted below");
    hold(id, std::abs(static_cast<double>(above.modes.mechanism_count)), 0, part + " taken for mechanisms");
    hold(id, find_largest_difference(above.freq_hz, {all.freq_hz.begin() + slower, all.freq_hz.end()}), 1e-9, part + " the rest");
  }
}

TEST(spectra, edge_in_cluster) {
  // Three degenerate modes of a cube at either end of the band: all of them or none, whichever way rounding falls.
  const std::string id = "edge_in_cluster";
  for (const int order : {1, 2}) {
    const std::string part = order == 1 ? "T4" : "T10";
    const Body cube{shapes::make_box({0.05, 0.05, 0.05}, order == 1 ? std::array{4, 4, 4} : std::array{2, 2, 2}, order),
                    {make_solid(kE, kNu, kRho)}};
    const std::vector<double> f = solve(PETSC_COMM_SELF, cube, make_band(20, 60e3)).freq_hz;
    std::size_t first = 2;
    while (first + 2 < f.size() && f[first + 2] > f[first] * (1 + 1e-9)) ++first;
    ASSERT_LT(first + 2, f.size()) << "no triple";
    const std::size_t last = first + 2;
    for (const double off : {0.0, 1e-13, -1e-13, 1e-11, -1e-11, 3e-8, -3e-8}) {
      const double edge = f[first] * (1 + off);
      const bool is_inside = off > -1e-10, is_inside_low = off < 1e-10;
      const std::string where = part + " off by " + std::to_string(1e12 * off) + "e-12";
      const Answer below = solve(PETSC_COMM_WORLD, cube, make_band(20, edge));
      hold(id, std::abs(static_cast<double>(below.freq_hz.size()) - static_cast<double>(is_inside ? last + 1 : first)), 0,
           where + " upper end");
      const Answer above = solve(PETSC_COMM_WORLD, cube, make_band(edge, 60e3));
      hold(id, std::abs(static_cast<double>(above.freq_hz.size()) - static_cast<double>(f.size() - (is_inside_low ? first : last + 1))), 0,
           where + " lower end");
    }
    const eigen::Options options = make_band(f[first] * (1 - 1e-11), f[last] * (1 + 1e-11));
    (void)hold_every_way(id, part, cube, options);
    eigen::Options few = make_band(20, 60e3);
    few.max_modes = static_cast<std::int64_t>(first) + 2;  // two of the three
    const Answer cut = solve(PETSC_COMM_WORLD, cube, few);
    hold(id, find_largest_difference(cut.freq_hz, {f.begin(), f.begin() + static_cast<std::ptrdiff_t>(first) + 2}), 1e-9,
         part + " cut by max_modes");
  }
}

TEST(spectra, empty_band) {
  // Above the zeros and below the first mode, between two modes, and a hair's breadth: proven empty, not an error.
  const std::string id = "empty_band";
  for (const int order : {1, 2}) {
    const std::string part = order == 1 ? "T4" : "T10";
    const Body brick = make_brick(order);
    const std::vector<double> f = solve(PETSC_COMM_SELF, brick, make_band(20, 40e3)).freq_hz;
    for (const auto& [low, high, below] : {std::tuple(20.0, 0.999 * f[0], 6), std::tuple(f[0] * (1 + 1e-7), f[1] * (1 - 1e-7), 7),
                                           std::tuple(0.5 * (f[2] + f[3]), 0.5 * (f[2] + f[3]) * (1 + 1e-6), 9)}) {
      const Answer none = hold_every_way(id, part, brick, make_band(low, high));
      hold(id, static_cast<double>(none.freq_hz.size()), 0, part + " modes");
      hold(id, std::abs(static_cast<double>(none.modes.count_below_low) - below), 0, part + " counted below");
    }
    // Where rounding puts the zeros themselves.
    const Answer none = solve(PETSC_COMM_WORLD, brick, make_band(1e-3, 2e-3));
    hold(id, static_cast<double>(none.freq_hz.size()), 0, part + " modes among the zeros");
    hold(id, std::abs(static_cast<double>(none.modes.count_below_low) - 6), 0, part + " zeros");
  }
}

}  // namespace
}  // namespace carillon::hard
