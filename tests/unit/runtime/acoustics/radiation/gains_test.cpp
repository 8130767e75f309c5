#include "runtime/acoustics/radiation/gains.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "runtime/acoustics/radiation/flow.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/paths.hpp"
#include "tests/unit/runtime/acoustics/radiation/sphere_bank.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::radiation {
namespace {

using std::numbers::pi;
using testing::SphereRow;

constexpr double kRadius = 0.1;
constexpr int kLevel = 4;  // 5120 triangles

std::vector<SphereRow> read_rows() {
  return testing::read_sphere_rows(carillon::tests::get_source_dir() + "/tests/unit/runtime/acoustics/radiation/data/spheres.csv");
}

/// Pressure at 1 m of a pulsating sphere of velocity 1.
double calc_pulsating(double ka) { return bank::kAirDensityKgM3 * bank::kSoundSpeedMs * kRadius * ka / std::hypot(1.0, ka); }

double to_db(double ratio) { return 20.0 * std::log10(ratio); }

TEST(Gains, ASphereSoundsAsItsClosedFormUpToFourLobes) {
  const auto rows = read_rows();
  const auto gains = calc_gains(testing::make_lobed_sphere(rows, kRadius, kLevel), GainKind::kSphere);
  int below_floor = 0;
  for (std::size_t m = 0; m < rows.size(); ++m) {
    const double exact = testing::calc_exact_gain(rows[m], kRadius);
    // 16-bit shapes and the nearest lower order leave a floor 120 dB below the pulsating sphere: l = 3 at ka 0.05 and l = 4 to ka 0.1 lie
    // under it.
    const double floor = 1e-6 * calc_pulsating(rows[m].ka);
    if (exact < floor) {
      EXPECT_LT(gains[m], floor) << rows[m].l << " " << rows[m].ka;
      ++below_floor;
    } else {
      EXPECT_NEAR(to_db(gains[m] / exact), 0.0, rows[m].l < 2 ? 0.05 : 0.2) << "l " << rows[m].l << " ka " << rows[m].ka;
    }
  }
  EXPECT_LE(below_floor, 3);
}

TEST(Gains, ATremblingSphereIsARigidTranslation) {
  auto bank = testing::make_sphere_surface(kRadius, kLevel);
  std::vector<double> ka;
  std::vector<double> exact;
  for (const SphereRow& row : read_rows()) {
    if (row.l != 1) continue;
    ka.push_back(row.ka);
    exact.push_back(testing::calc_exact_gain(row, kRadius));
  }
  testing::set_modes(bank, ka, kRadius, [](const Vec3&, std::size_t) { return Vec3{0.48, 0.6, 0.64}; });
  const auto gains = calc_gains(bank, GainKind::kSphere);
  for (std::size_t m = 0; m < ka.size(); ++m) EXPECT_NEAR(to_db(gains[m] / exact[m]), 0.0, 0.05) << ka[m];
}

TEST(Gains, ARotatingSphereIsSilent) {
  auto bank = testing::make_sphere_surface(kRadius, kLevel);
  testing::set_modes(bank, {0.3, 1.0, 3.0}, kRadius, [](const Vec3& x, std::size_t) { return Vec3{-x[1] / kRadius, x[0] / kRadius, 0.0}; });
  const auto gains = calc_gains(bank, GainKind::kSphere);
  EXPECT_LT(gains[0], 1e-6 * calc_pulsating(0.3));
  EXPECT_LT(gains[1], 1e-6 * calc_pulsating(1.0));
  EXPECT_LT(gains[2], 2e-3 * calc_pulsating(3.0));  // the flat triangles' own pattern, which is fine
}

TEST(Gains, AtLongWavelengthsAnyBodyIsItsVolumeFlow) {
  // A cube that breathes, x -> x: it displaces 3 V per unit, and p = rho0 omega (3 V) / 4 pi at 1 m. Off centre, where it counts the same.
  for (const double shift : {0.0, 0.3}) {
    bank::Bank bank = testing::make_cube_bank({});
    for (Vec3& x : bank.vertices_m) x[1] += shift;
    testing::set_modes(bank, {0.002, 0.004}, 0.1, [&](const Vec3& x, std::size_t) { return Vec3{x[0], x[1] - shift, x[2]}; });
    const auto gains = calc_gains(bank, GainKind::kSphere);
    for (int m = 0; m < 2; ++m) {
      const double omega = std::sqrt(bank.eigenvalue_rad2_s2[m]);
      EXPECT_NEAR(gains[m] / (bank::kAirDensityKgM3 * omega * 3e-3 / (4 * pi)), 1.0, 1e-4);
    }
  }
}

TEST(Gains, RigidMotionIsSilentAtLongWavelengths) {
  // A bar bends: its upper and its lower face move alike, so that the flows cancel; without sign they would add.
  bank::Bank bank = testing::make_sphere_surface(kRadius, 3);
  for (Vec3& x : bank.vertices_m) x = {10.0 * x[0], x[1], 0.5 * x[2]};
  testing::set_modes(bank, {0.01}, kRadius, [](const Vec3& x, std::size_t) { return Vec3{0.0, 0.0, std::cos(2.0 * pi * x[0])}; });
  // About 0.4 of 1 m^2 of faces move, at 34.3 rad/s: 1.3 Pa without cancellation. The remainder is a dipole.
  EXPECT_LT(calc_gains(bank, GainKind::kSphere)[0], 0.01 * 1.3);
}

TEST(Gains, UnresolvedPatternsLoseNoPowerAtShortWavelengths) {
  // Far above ka = l every order radiates alike: g^2 = (rho0 c0 a)^2 times the mean square of the velocity, here of 12 lobes.
  auto bank = testing::make_sphere_surface(kRadius, 5);
  double mean = 0.0;
  const auto calc_velocity = [](const Vec3& x) { return std::cos(12.0 * std::acos(std::clamp(x[2] / kRadius, -1.0, 1.0))); };
  for (const Vec3& x : bank.vertices_m) mean += calc_velocity(x) * calc_velocity(x) / static_cast<double>(bank.vertices_m.size());
  testing::set_modes(bank, {200.0}, kRadius, [&](const Vec3& x, std::size_t) {
    const double u = calc_velocity(x) / kRadius;
    return Vec3{u * x[0], u * x[1], u * x[2]};
  });
  const double exact = bank::kAirDensityKgM3 * bank::kSoundSpeedMs * kRadius * std::sqrt(mean);
  EXPECT_NEAR(to_db(calc_gains(bank, GainKind::kSphere)[0] / exact), 0.0, 0.2);  // the mean over a triangle is less than its peak
}

TEST(Gains, TheWallOfACavityIsNotHeard) {
  const auto rows = read_rows();
  const bank::Bank solid = testing::make_lobed_sphere(rows, kRadius, 2);
  bank::Bank hollow = testing::make_sphere_surface(kRadius, 2);
  const auto outer = static_cast<std::int32_t>(hollow.vertices_m.size());
  const bank::Bank inner = testing::make_sphere_surface(0.6 * kRadius, 2);
  hollow.vertices_m.insert(hollow.vertices_m.end(), inner.vertices_m.begin(), inner.vertices_m.end());
  for (const auto& [a, b, c] : inner.triangles) hollow.triangles.push_back({outer + a, outer + c, outer + b});
  std::vector<double> ka;
  for (const SphereRow& row : rows) ka.push_back(row.ka);
  testing::set_modes(hollow, ka, kRadius, [&](const Vec3& x, std::size_t m) {
    const double cosine = (0.48 * x[0] + 0.6 * x[1] + 0.64 * x[2]) / kRadius;
    const bool inside = std::hypot(x[0], x[1], x[2]) < 0.8 * kRadius;
    const double size = inside ? 1.0 / kRadius : testing::calc_legendre(rows[m].l, cosine) / kRadius;
    return Vec3{size * x[0], size * x[1], size * x[2]};
  });
  const auto expected = calc_gains(solid, GainKind::kSphere), gains = calc_gains(hollow, GainKind::kSphere);
  for (std::size_t m = 0; m < rows.size(); ++m) EXPECT_NEAR(gains[m] / expected[m], 1.0, 1e-12) << m;
}

TEST(Gains, TheSphereOfABodyHasItsOuterVolume) {
  EXPECT_NEAR(calc_sphere_radius_m(testing::make_cube_bank({})), 0.1 * std::cbrt(3.0 / (4.0 * pi)), 1e-12);
  bank::Bank hollow = testing::make_sphere_surface(kRadius, kLevel);
  const auto outer = static_cast<std::int32_t>(hollow.vertices_m.size());
  const bank::Bank inner = testing::make_sphere_surface(0.9 * kRadius, 1);
  hollow.vertices_m.insert(hollow.vertices_m.end(), inner.vertices_m.begin(), inner.vertices_m.end());
  for (const auto& [a, b, c] : inner.triangles) hollow.triangles.push_back({outer + a, outer + c, outer + b});
  EXPECT_NEAR(calc_sphere_radius_m(hollow), kRadius, 1e-3 * kRadius);
}

TEST(Gains, ComeWithTheRadiusAsEachDoesAlone) {
  bank::Bank bank = testing::make_lobed_sphere(read_rows(), kRadius, 2);
  for (const GainKind kind : {GainKind::kOsg02, GainKind::kSphere}) {
    const Radiation both = calc_radiation(bank, kind);
    EXPECT_EQ(both.gains, calc_gains(bank, kind));
    EXPECT_EQ(both.sphere_radius_m, calc_sphere_radius_m(bank));
  }
}

TEST(Gains, EveryInstructionSetSendsTheSameThroughATriangle) {
  std::mt19937 random(3);
  for (const std::size_t modes : {0, 1, 15, 16, 47, 100}) {
    std::array<std::vector<std::int16_t>, 3> rows;
    for (auto& row : rows)
      for (std::size_t i = 0; i < 3 * modes; ++i) row.push_back(static_cast<std::int16_t>(random()));
    const Corners corners{{rows[0].data(), rows[1].data(), rows[2].data()}, {0.3F, -0.7F, 1.1F}, 0.01F};
    std::vector<float> expected(modes), expected_squares(modes, 2.0F);
    for (std::size_t m = 0; m < modes; ++m) {
      std::array<float, 3> part{};
      for (std::size_t k = 0; k < 3; ++k)
        part[k] = corners.share[k] * static_cast<float>(rows[0][3 * m + k] + rows[1][3 * m + k] + rows[2][3 * m + k]);
      expected[m] = part[0] + part[1] + part[2];
      const float square = expected[m] * expected[m];
      expected_squares[m] += square * 0.01F;
    }
    for (const base::Instructions instructions : base::list_instructions()) {
      std::vector<float> through(modes), squares(modes, 2.0F);
      find_flow_loops(instructions).calc_through(corners, modes, through.data(), squares.data());
      EXPECT_EQ(through, expected) << modes;
      EXPECT_EQ(squares, expected_squares) << modes;
    }
  }
}

TEST(Gains, Osg02IsTheFieldOfTheBank) {
  bank::Bank bank = testing::make_cube_bank({{500.0, 1.0, 2.0}, {900.0, 1.0, 3.0}});
  EXPECT_EQ(calc_gains(bank, GainKind::kOsg02), (std::vector<double>{2.0, 3.0}));
}

TEST(Gains, InconsistentBanksAreRefused) {
  const bank::Bank good = testing::make_cube_bank({{500.0, 1.0}});
  bank::Bank bank = good;
  bank.shape.pop_back();
  EXPECT_THROW(calc_gains(bank, GainKind::kSphere), InputError);
  bank = good;
  bank.triangles[3][1] = 8;
  EXPECT_THROW(calc_gains(bank, GainKind::kSphere), InputError);
  bank = good;
  for (auto& triangle : bank.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_THROW(calc_gains(bank, GainKind::kSphere), InputError);
}

}  // namespace
}  // namespace carillon::radiation
