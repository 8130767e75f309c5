// Air of a whole body on any number of ranks: bit equality, resumed runs, interpolation error, reactions.
#include "precompute/air/solve.hpp"

#include <gtest/gtest.h>
#include <mpi.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "precompute/air/surface.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/ranks.hpp"
#include "tests/unit/precompute/air/bodies.hpp"
#include "tests/unit/precompute/air/fields.hpp"

namespace carillon::air {
namespace {

using testing::calc_hankel;
using testing::calc_hankel_slope;
using testing::calc_harmonic;
using testing::Complex;
using testing::make_ball;
using testing::Skin;
using testing::to_db;

template <typename Find>
Radiator make_radiator(const Skin& skin, const std::vector<double>& wave_numbers, const Find& find) {
  Radiator radiator{skin.nodes_m, skin.triangles, {}, wave_numbers, find_enclosing_sphere(skin.nodes_m)};
  for (const Triangle& t : skin.triangles) {
    const Vec3 normal = normalise(cross(skin.nodes_m[t[1]] - skin.nodes_m[t[0]], skin.nodes_m[t[2]] - skin.nodes_m[t[0]]));
    for (const std::int32_t node : t)
      for (std::size_t m = 0; m < wave_numbers.size(); ++m)
        radiator.velocity.push_back(static_cast<float>(find(skin.nodes_m[node], normal, m)));
  }
  return radiator;
}

/// A ball of radius 1 with distinct modes that are sums of harmonics.
Radiator make_ringing_ball(int divisions, std::size_t modes, double low, double high) {
  std::vector<double> wave_numbers;
  for (std::size_t m = 0; m < modes; ++m)
    wave_numbers.push_back(low + (high - low) * (static_cast<double>(m) + 0.3 * std::sin(7.0 * static_cast<double>(m))) /
                                     static_cast<double>(modes));
  return make_radiator(make_ball(divisions, 1.0), wave_numbers, [](const Vec3& place, const Vec3&, std::size_t m) {
    const Vec3 u = normalise(place);
    const int l = static_cast<int>(m % 5);
    return calc_harmonic(l, static_cast<int>(m % 3) % (l + 1), u) + 0.3 * calc_harmonic((l + 2) % 5, 0, u) + 0.1 * u[0];
  });
}

AirSolveOptions make_options(double step, double error_db = -40.0) {
  AirSolveOptions options;
  options.step = step;
  options.error_db = error_db;
  return options;
}

/// Ranks share a wave number above this matrix size.
AirSolveOptions limit_memory(double matrix_bytes) {
  AirSolveOptions options;
  options.matrix_bytes = matrix_bytes;
  return options;
}

/// Air whose mass is comparable to the modal mass.
double calc_shifted(double k, const Sounding& sounding) { return k / std::sqrt(1.0 - 0.4 * sounding.reaction.real()); }

/// Set on rank 0 only.
Radiator keep_on_root(const Radiator& radiator) { return tests::get_rank() == 0 ? radiator : Radiator{}; }

bool are_same(const Sounding& a, const Sounding& b) {
  if (a.mixture.motions != b.mixture.motions || a.mixture.parts != b.mixture.parts || a.mixture.added_mass != b.mixture.added_mass)
    return false;
  return a.order == b.order && a.coefficient == b.coefficient && a.reaction == b.reaction && a.interpolation_db == b.interpolation_db;
}

void expect_same(const AirSolution& found, const AirSolution& wanted, const std::string& what) {
  if (tests::get_rank() != 0) return;
  ASSERT_EQ(found.modes.size(), wanted.modes.size()) << what;
  for (std::size_t m = 0; m < found.modes.size(); ++m) EXPECT_TRUE(are_same(found.modes[m], wanted.modes[m])) << what << ", mode " << m;
  EXPECT_EQ(found.wave_number_1_m, wanted.wave_number_1_m) << what;
  EXPECT_EQ(found.wave_numbers, wanted.wave_numbers) << what;
  EXPECT_EQ(found.products, wanted.products) << what;
  EXPECT_EQ(found.residual, wanted.residual) << what;
  EXPECT_EQ(found.reciprocity, wanted.reciprocity) << what;
}

/// Records answers in order and replays them to the next run.
struct Notes {
  std::vector<WaveAnswer> saved, given;
  int reports = 0;
  int most_saved = std::numeric_limits<int>::max();  // then requests a stop

  Keeper make_keeper() {
    return {.read = [this] { return given; },
            .save = [this](const WaveAnswer& answer) { saved.push_back(answer); },
            .report = [this](const std::string&, double share) { reports += share > 0.0 && share <= 1.0 ? 1 : 0; },
            .is_stop_asked = [this] { return static_cast<int>(saved.size()) >= most_saved; }};
  }
};

TEST(solve_air, has_the_same_bits_on_any_number_of_ranks) {
  // Three blocks of rows: with four ranks per wave number one has none.
  const Radiator radiator = make_ringing_ball(6, 18, 1.0, 7.0);
  const AirSolution alone = solve_air(MPI_COMM_SELF, radiator, {});
  ASSERT_LT(alone.wave_numbers, radiator.count_modes());
  EXPECT_EQ(alone.unknowns, 362U);
  const AirSolution dealt = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), {});
  expect_same(dealt, alone, "a wave number for each rank");
  const AirSolution shared = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), limit_memory(1.0));
  expect_same(shared, alone, "a wave number for all ranks");
  const AirSolution pairs = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), limit_memory(8.0 * 362.0 * 362.0 / 1.5));
  expect_same(pairs, alone, "a wave number for two ranks");
}

TEST(solve_air, of_one_mode_is_shared_by_all_ranks) {
  const Radiator radiator = make_ringing_ball(4, 1, 2.0, 3.0);
  const AirSolution alone = solve_air(MPI_COMM_SELF, radiator, {});
  EXPECT_EQ(alone.wave_numbers, 1U);
  expect_same(solve_air(MPI_COMM_WORLD, keep_on_root(radiator), {}), alone, "one mode");
}

TEST(solve_air, resumes_with_the_same_bits_and_solves_nothing_twice) {
  const Radiator radiator = make_ringing_ball(4, 40, 1.0, 9.0);
  AirSolveOptions options = make_options(1.0, -45.0);
  options.shift = calc_shifted;  // requests more modes at existing wave numbers later
  Notes first;
  const AirSolution whole = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), options, first.make_keeper());
  if (tests::get_rank() == 0) {
    std::set<double> distinct;
    for (const WaveAnswer& answer : first.saved) distinct.insert(answer.k);
    EXPECT_LT(distinct.size(), first.saved.size());  // some were requested twice
    EXPECT_EQ(distinct.size(), whole.wave_numbers);
    EXPECT_GT(first.reports, 0);
  }
  Notes second;
  second.given = first.saved;
  expect_same(solve_air(MPI_COMM_WORLD, keep_on_root(radiator), options, second.make_keeper()), whole, "all was kept");
  EXPECT_TRUE(second.saved.empty());
  // Early and late stops.
  const int all = static_cast<int>(first.saved.size());
  for (const int part : {1, all / 2, all - 1}) {
    Notes stopped, rest;
    stopped.most_saved = part;
    if (tests::get_rank() != 0) stopped.most_saved = std::numeric_limits<int>::max();  // only rank 0 is asked
    EXPECT_THROW(solve_air(MPI_COMM_WORLD, keep_on_root(radiator), options, stopped.make_keeper()), SolveStopped);
    rest.given = stopped.saved;
    expect_same(solve_air(MPI_COMM_WORLD, keep_on_root(radiator), options, rest.make_keeper()), whole, "half was kept");
    if (tests::get_rank() == 0) {
      EXPECT_EQ(stopped.saved.size() + rest.saved.size(), first.saved.size());
    }
  }
}

TEST(solve_air, refuses_on_all_ranks_what_cannot_be) {
  Radiator radiator = make_ringing_ball(3, 3, 1.0, 3.0);
  EXPECT_TRUE(solve_air(MPI_COMM_WORLD, Radiator{}, {}).modes.empty());
  Radiator bad = radiator;
  bad.nodes_m[5][0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(solve_air(MPI_COMM_WORLD, keep_on_root(bad), {}), InputError);
  bad = radiator;
  for (float& v : bad.velocity) v = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(solve_air(MPI_COMM_WORLD, keep_on_root(bad), {}), SolveError);
}

/// The larger of the errors in the far field and at two radii, in dB of the rms of the field over directions.
double find_error_db(const Sounding& found, const Sounding& wanted, double k_radius) {
  double worst = 0.0;
  for (const bool is_far : {false, true}) {
    double error = 0.0, all = 0.0;
    const std::size_t count = std::max(found.coefficient.size(), wanted.coefficient.size());
    for (std::size_t i = 0; i < count; ++i) {
      const int l = static_cast<int>(std::sqrt(static_cast<double>(i)));
      const double here = std::abs(calc_hankel(l, k_radius)), there = is_far ? 1.0 : std::abs(calc_hankel(l, 2.0 * k_radius));
      const Complex a = i < found.coefficient.size() ? found.coefficient[i] : 0.0,
                    b = i < wanted.coefficient.size() ? wanted.coefficient[i] : 0.0;
      error += std::norm(a - b) * (there / here) * (there / here);
      all += std::norm(b) * (there / here) * (there / here);
    }
    worst = std::max(worst, error / all);
  }
  return to_db(std::sqrt(worst));
}

TEST(solve_air, states_an_error_of_interpolation_that_holds) {
  // GMRES error: both solutions are exact to 1e-4 of the right-hand side only.
  constexpr double kFloorDb = -70.0;
  constexpr std::size_t kModes = 100;
  const Radiator radiator = make_ringing_ball(7, kModes, 1.0, 20.0);
  const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), {});
  const AirSolution wanted = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), make_options(1e-3));
  if (tests::get_rank() != 0) return;
  ASSERT_EQ(wanted.wave_numbers, kModes);
  ASSERT_LT(found.wave_numbers, kModes / 2);
  int interpolated = 0;
  for (std::size_t m = 0; m < kModes; ++m) {
    const double stated = found.modes[m].interpolation_db;
    const double error = find_error_db(found.modes[m], wanted.modes[m], radiator.wave_number_1_m[m] * radiator.sphere.radius_m);
    EXPECT_EQ(wanted.modes[m].interpolation_db, -300.0);
    EXPECT_LE(error, std::max(stated + 1.0, kFloorDb)) << "mode " << m << ", k " << radiator.wave_number_1_m[m];
    EXPECT_LE(stated, -40.0) << m;
    interpolated += stated > -200.0 ? 1 : 0;
    const Complex a = found.modes[m].reaction, b = wanted.modes[m].reaction;
    EXPECT_LT(std::abs(a - b), 0.02 * std::abs(b)) << m;
  }
  EXPECT_GT(interpolated, 50);
}

TEST(solve_air, follows_modes_that_the_air_shifts) {
  const Radiator radiator = make_ringing_ball(4, 16, 1.0, 5.0);
  AirSolveOptions options;
  options.shift = calc_shifted;
  const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), options);
  Radiator moved = keep_on_root(radiator);
  if (tests::get_rank() == 0) moved.wave_number_1_m = found.wave_number_1_m;
  const AirSolution wanted = solve_air(MPI_COMM_WORLD, moved, make_options(1e-3));
  if (tests::get_rank() != 0) return;
  int shifted = 0;
  for (std::size_t m = 0; m < 16; ++m) {
    shifted += std::abs(found.wave_number_1_m[m] / radiator.wave_number_1_m[m] - 1.0) > 1e-3 ? 1 : 0;
    EXPECT_LE(find_error_db(found.modes[m], wanted.modes[m], found.wave_number_1_m[m] * radiator.sphere.radius_m), -39.0) << m;
  }
  EXPECT_GT(shifted, 10);
}

// ---- coupled modes ----

constexpr double kHeavyAir = 0.35;  // relative to unit modal mass, in a ball of radius 1

AirSolveOptions couple(bool has_rows = true) {
  AirSolveOptions options;
  options.coupling = CouplingOptions{.density_kg_m3 = kHeavyAir, .has_rows = has_rows};
  options.coupling->is_called_for = [](const std::vector<Sounding>&) { return true; };
  return options;
}

/// Added mass of Y_lm on a ball of radius 1, by Morse and Ingard.
double calc_exact_mass(int l, double k) { return -kHeavyAir * (calc_hankel(l, k) / (k * calc_hankel_slope(l, k))).real(); }

/// Two modes that are both sums of Y_10 and Y_20, turned by an angle.
constexpr double kTurn = 0.6;
double find_turned(const Vec3& place, std::size_t m) {
  const double one = calc_harmonic(1, 0, normalise(place)), two = calc_harmonic(2, 0, normalise(place));
  return m == 0 ? std::cos(kTurn) * one + std::sin(kTurn) * two : std::cos(kTurn) * two - std::sin(kTurn) * one;
}

struct ExactMode {
  double k = 0.0;
  std::array<double, 2> parts{};  // in the two rotated modes
};

/// diag(k_i^2) q = k^2 (1 + M(k)) q of the rotated modes, with closed-form masses at the mode's own k. Returns the mode dominated by
/// `motion`.
ExactMode find_exact_mode(const std::array<double, 2>& alone, std::size_t motion) {
  ExactMode mode{.k = alone[motion], .parts = {}};
  for (int step = 0; step < 200; ++step) {
    const double one = calc_exact_mass(1, mode.k), two = calc_exact_mass(2, mode.k), c = std::cos(kTurn), s = std::sin(kTurn);
    const double a = 1.0 + c * c * one + s * s * two, b = c * s * (two - one), d = 1.0 + s * s * one + c * c * two;
    const double x = alone[0] * alone[0], y = alone[1] * alone[1];
    // det(diag - lambda (1 + M)) = 0
    const double p = a * d - b * b, q = x * d + y * a, root = std::sqrt(q * q - 4.0 * p * x * y);
    for (const double lambda : {(q - root) / (2.0 * p), (q + root) / (2.0 * p)}) {
      // (x - lambda a) u = lambda b v
      std::array<double, 2> parts{lambda * b, x - lambda * a};
      if (std::abs(b) < 1e-14) parts = std::abs(x - lambda * a) < 1e-9 ? std::array{1.0, 0.0} : std::array{0.0, 1.0};
      if (std::abs(parts[motion]) < std::abs(parts[1 - motion])) continue;
      const double mass = a * parts[0] * parts[0] + 2.0 * b * parts[0] * parts[1] + d * parts[1] * parts[1];
      const double scale = (parts[motion] < 0.0 ? -1.0 : 1.0) / std::sqrt(mass);
      mode = {.k = std::sqrt(lambda), .parts = {scale * parts[0], scale * parts[1]}};
    }
  }
  return mode;
}

std::array<double, 2> list_parts(const Mixture& mixture) {
  std::array<double, 2> parts{};
  for (std::size_t i = 0; i < mixture.motions.size(); ++i) parts.at(mixture.motions[i]) = mixture.parts[i];
  return parts;
}

TEST(coupling, of_mixed_harmonics_is_that_of_the_closed_form) {
  // Far apart, near, and crossing: a difference of 1 % is less than the shift by the air.
  for (const std::array<double, 2>& alone : {std::array{1.0, 1.4}, {1.0, 1.01}, {1.0, 0.97}, {2.2, 2.25}}) {
    const Radiator radiator = make_radiator(make_ball(9, 1.0), {alone[0], alone[1]},
                                            [](const Vec3& place, const Vec3&, std::size_t m) { return find_turned(place, m); });
    const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), couple());
    if (tests::get_rank() != 0) continue;
    EXPECT_LT(found.reciprocity, 1e-3);
    for (std::size_t m = 0; m < 2; ++m) {
      const ExactMode wanted = find_exact_mode(alone, m);
      const Sounding& mode = found.modes[m];
      EXPECT_NEAR(found.wave_number_1_m[m] / wanted.k, 1.0, 1e-3) << alone[1] << ", mode " << m;
      const std::array<double, 2> parts = list_parts(mode.mixture);
      for (std::size_t i = 0; i < 2; ++i) EXPECT_NEAR(parts[i], wanted.parts[i], 0.01) << alone[1] << ", mode " << m << ", part " << i;
      EXPECT_GT(std::abs(parts[1 - m]), 0.01);
      // The mixture radiates its two harmonics, each in closed form.
      const double k = found.wave_number_1_m[m], c = std::cos(kTurn), s = std::sin(kTurn);
      const std::array<double, 2> moved{c * wanted.parts[0] - s * wanted.parts[1], s * wanted.parts[0] + c * wanted.parts[1]};
      double error = 0.0, all = 0.0;
      for (std::size_t i = 0; i < mode.coefficient.size(); ++i) {
        const int l = static_cast<int>(std::sqrt(static_cast<double>(i)));
        Complex exact;
        if (i == 2 || i == 6) exact = moved[i == 2 ? 0 : 1] * std::abs(calc_hankel(l, k)) / (k * calc_hankel_slope(l, k));
        error += std::norm(mode.coefficient[i] - exact);
        all += std::norm(exact);
      }
      EXPECT_LT(std::sqrt(error / all), 0.02) << alone[1] << ", mode " << m;
    }
  }
}

TEST(coupling, turns_modes_of_one_frequency_into_those_that_the_air_separates) {
  const Radiator radiator =
      make_radiator(make_ball(9, 1.0), {1.2, 1.2}, [](const Vec3& place, const Vec3&, std::size_t m) { return find_turned(place, m); });
  const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), couple());
  if (tests::get_rank() != 0) return;
  // Y_10 has more added mass than Y_20, so the modes separate.
  for (std::size_t m = 0; m < 2; ++m) {
    const std::array<double, 2> parts = list_parts(found.modes[m].mixture);
    const double one = std::cos(kTurn) * parts[0] - std::sin(kTurn) * parts[1],
                 two = std::sin(kTurn) * parts[0] + std::cos(kTurn) * parts[1];
    EXPECT_LT(std::min(std::abs(one), std::abs(two)), 0.01) << m;
    const int l = std::abs(one) > std::abs(two) ? 1 : 2;
    EXPECT_EQ(l, m == 0 ? 1 : 2);
    const double k = found.wave_number_1_m[m], mass = calc_exact_mass(l, k);
    EXPECT_NEAR(k * std::sqrt(1.0 + mass) / 1.2, 1.0, 1e-3) << m;
    EXPECT_NEAR(found.modes[m].mixture.added_mass / mass, 1.0, 0.01) << m;
  }
}

TEST(coupling, of_a_free_body_keeps_its_momentum_with_the_airs) {
  // A mode with the surface motion of a rigid translation: the body recoils, and the added mass acts as m / (1 + m).
  Radiator radiator = make_radiator(make_ball(8, 1.0), {0.7, 0.7},
                                    [](const Vec3& place, const Vec3&, std::size_t) { return calc_harmonic(1, 0, normalise(place)); });
  radiator.wave_number_1_m.pop_back();
  radiator.rigid = 1;
  const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), couple());
  if (tests::get_rank() != 0) return;
  const Mixture& mixture = found.modes[0].mixture;
  ASSERT_EQ(mixture.motions, (std::vector<std::int32_t>{0, 1}));
  const double k = found.wave_number_1_m[0], mass = calc_exact_mass(1, k);
  EXPECT_NEAR(mixture.parts[1] / mixture.parts[0] / (-mass / (1.0 + mass)), 1.0, 0.01);
  EXPECT_NEAR(k * std::sqrt(1.0 + mass / (1.0 + mass)) / 0.7, 1.0, 1e-3);
}

TEST(coupling, conserves_energy_and_unit_mass) {
  const Radiator radiator = make_ringing_ball(9, 12, 1.0, 4.0);
  const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), couple());
  if (tests::get_rank() != 0) return;
  std::size_t mixed = 0;
  for (std::size_t m = 0; m < 12; ++m) {
    const Sounding& mode = found.modes[m];
    double squares = 0.0, stiffness = 0.0, power = 0.0;
    for (std::size_t i = 0; i < mode.mixture.motions.size(); ++i) {
      const double part = mode.mixture.parts[i], k = radiator.wave_number_1_m[mode.mixture.motions[i]];
      squares += part * part;
      stiffness += part * part * k * k;
      mixed += std::abs(part) > 0.03 ? 1 : 0;
    }
    const double k = found.wave_number_1_m[m];
    EXPECT_NEAR(squares * (1.0 + mode.mixture.added_mass), 1.0, 1e-9) << m;
    EXPECT_NEAR(squares - kHeavyAir * mode.reaction.real(), 1.0, 1e-3) << m;  // added mass from p v of the mixture
    EXPECT_NEAR(stiffness / (k * k), 1.0, 1e-4) << m;
    for (std::size_t i = 0; i < mode.coefficient.size(); ++i)
      power += std::norm(mode.coefficient[i] /
                         std::abs(calc_hankel(static_cast<int>(std::sqrt(static_cast<double>(i))), k * radiator.sphere.radius_m)));
    EXPECT_NEAR(-k * mode.reaction.imag() / power, 1.0, 0.05) << m;
  }
  EXPECT_GT(mixed, 20U) << "most modes have partners";
}

TEST(coupling, has_the_same_bits_on_any_number_of_ranks_and_after_a_stop) {
  Radiator radiator = make_ringing_ball(5, 14, 1.0, 5.0);
  const AirSolution alone = solve_air(MPI_COMM_SELF, radiator, couple());
  Notes first;
  expect_same(solve_air(MPI_COMM_WORLD, keep_on_root(radiator), couple(), first.make_keeper()), alone, "a wave number for each rank");
  AirSolveOptions tight = couple();
  tight.matrix_bytes = 1.0;
  expect_same(solve_air(MPI_COMM_WORLD, keep_on_root(radiator), tight), alone, "a wave number for all ranks");
  const int all = static_cast<int>(first.saved.size());
  for (const int part : {1, all - 1}) {
    Notes stopped, rest;
    if (tests::get_rank() == 0) stopped.most_saved = part;
    EXPECT_THROW(solve_air(MPI_COMM_WORLD, keep_on_root(radiator), couple(), stopped.make_keeper()), SolveStopped);
    for (const WaveAnswer& answer : stopped.saved) {
      const std::optional<WaveAnswer> read = unpack(pack(answer));
      ASSERT_TRUE(read);
      rest.given.push_back(*read);
    }
    expect_same(solve_air(MPI_COMM_WORLD, keep_on_root(radiator), couple(), rest.make_keeper()), alone, "what was kept");
    if (tests::get_rank() == 0) {
      EXPECT_EQ(stopped.saved.size() + rest.saved.size(), first.saved.size());
    }
  }
}

TEST(coupling, costs_nothing_where_it_is_not_called_for) {
  const Radiator radiator = make_ringing_ball(4, 10, 1.0, 5.0);
  AirSolveOptions options = couple(false);
  options.coupling->is_called_for = [](const std::vector<Sounding>& modes) { return modes.size() > 10; };
  Notes notes;
  const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), options, notes.make_keeper());
  expect_same(found, solve_air(MPI_COMM_SELF, radiator, {}), "not coupled");
  for (const WaveAnswer& answer : notes.saved)
    for (const auto& [mode, one] : answer.modes) EXPECT_TRUE(one.row.empty());
  // Coupling was needed but not prepared: lacks_rows, with uncoupled modes only.
  const AirSolution lacking = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), couple(false));
  if (tests::get_rank() == 0) {
    EXPECT_TRUE(lacking.lacks_rows);
  }
}

// With dp/dn = v the integral of p v is - m / rho - i / k sum |c_lm|^2, m the added mass of a motion with the velocity v.

TEST(reaction, of_a_ball_is_its_added_mass) {
  const std::vector<int> orders{0, 1, 2};
  const Radiator radiator = make_radiator(make_ball(9, 1.0), {0.1, 0.1001, 0.1002}, [](const Vec3& place, const Vec3&, std::size_t m) {
    return calc_harmonic(static_cast<int>(m), 0, normalise(place));
  });
  const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), {});
  if (tests::get_rank() != 0) return;
  for (const int l : orders) {
    const double k = radiator.wave_number_1_m[l];
    const double wanted = (calc_hankel(l, k) / (k * calc_hankel_slope(l, k))).real();
    const double ratio = found.modes[l].reaction.real() / wanted;
    EXPECT_NEAR(ratio, 1.0, 0.01) << l;
    EXPECT_NEAR(wanted, -1.0 / (l + 1.0), 0.02);  // the limit of the closed form at low k
  }
}

TEST(reaction, conserves_energy) {
  const Radiator radiator = make_ringing_ball(8, 5, 0.8, 6.0);
  const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), {});
  if (tests::get_rank() != 0) return;
  for (std::size_t m = 0; m < 5; ++m) {
    const double k = radiator.wave_number_1_m[m];
    double power = 0.0;
    for (std::size_t i = 0; i < found.modes[m].coefficient.size(); ++i) {
      const int l = static_cast<int>(std::sqrt(static_cast<double>(i)));
      power += std::norm(found.modes[m].coefficient[i] / std::abs(calc_hankel(l, k * radiator.sphere.radius_m)));
    }
    EXPECT_NEAR(-k * found.modes[m].reaction.imag() / power, 1.0, 0.02) << m;
  }
}

TEST(reaction, of_a_thin_disc_is_that_of_lamb) {
  // H. Lamb, Hydrodynamics (1932), 102: 8/3 rho a^3. Facets are nine times as long as the disc is thick.
  const double thickness = 0.01, spacing = 0.09, half = thickness / 2.0;
  const Skin disc = testing::revolve(testing::divide({{0.0, -half}, {1.0, -half}, {1.0, half}, {0.0, half}}, spacing), spacing);
  ASSERT_TRUE(testing::is_closed(disc));
  const Radiator radiator = make_radiator(disc, {0.05}, [](const Vec3&, const Vec3& normal, std::size_t) { return normal[2]; });
  const AirSolution found = solve_air(MPI_COMM_WORLD, keep_on_root(radiator), {});
  if (tests::get_rank() != 0) return;
  EXPECT_NEAR(-found.modes[0].reaction.real() / (8.0 / 3.0), 1.0, 0.015);
}

}  // namespace
}  // namespace carillon::air
