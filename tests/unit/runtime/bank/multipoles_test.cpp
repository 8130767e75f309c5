// Multipoles of a bank: decays and rounding in closed form, and faults.
#include "runtime/bank/multipoles.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "runtime/bank/corrected.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/write.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kModes = 9;

/// |h_l(x)|^2 by a finite sum of positive terms (DLMF 10.49.18).
long double calc_hankel_square(double x, int l) {
  long double term = 1.0L, sum = 1.0L;
  for (int k = 1; k <= l; ++k) {
    term *= static_cast<long double>(2 * k - 1) / (2 * k) * (l + k) * (l - k + 1) / (static_cast<long double>(x) * x);
    sum += term;
  }
  return sum / (static_cast<long double>(x) * x);
}

TEST(HankelSizes, MatchTheFiniteSum) {
  int infinite = 0;
  for (const double x : {1e-6, 1e-3, 0.05, 0.7, 1.0, 3.3, 12.0, 45.6, 100.0, 119.5, 250.0, 4000.0}) {
    const std::vector<double> sizes = calc_hankel_sizes(x, kMaxOrder);
    ASSERT_EQ(sizes.size(), 121u);
    for (int l = 0; l <= kMaxOrder; ++l) {
      const long double wanted = std::sqrt(calc_hankel_square(x, l));
      if (std::isinf(sizes[l])) {
        ++infinite;
        EXPECT_GT(wanted, 1e300L) << "x " << x << ", l " << l;
      } else {
        EXPECT_NEAR(static_cast<double>(sizes[l] / wanted), 1.0, 1e-12) << "x " << x << ", l " << l;
      }
    }
  }
  EXPECT_GT(infinite, 100) << "the test reaches beyond doubles";
  EXPECT_EQ(calc_hankel_sizes(2.0, 0), std::vector<double>{0.5});
}

TEST(CoefficientDecays, MatchAPulsatingAndOscillatingSphere) {
  for (const double hz : {3.0, 40.0, 900.0, 20000.0}) {
    Multipoles air = example::make_air(example::make_bank(2, 0));
    example::add_sphere_mode(air, hz, {0.7, {}}, 0);
    example::add_sphere_mode(air, hz, {0.0, {0.1, -0.3, 0.2}}, 5);
    example::add_sphere_mode(air, hz, {0.2, {0.1, -0.3, 0.2}}, 2);
    const std::vector<CoefficientDecay> decays = calc_coefficient_decays(air);
    for (std::size_t m = 0; m < 3; ++m)
      EXPECT_LE(std::abs(std::sqrt(air.decay_per_s[m]) - std::sqrt(decays[m].decay_per_s)), decays[m].root_rounding * (1 + 1e-9)) << hz;
    EXPECT_NEAR(decays[0].decay_per_s / air.decay_per_s[0], 1.0, 1e-4) << hz;
    EXPECT_NEAR(decays[1].decay_per_s / air.decay_per_s[1], 1.0, 1e-4) << hz;
  }
}

// Rounding error of the decay, against the unrounded sum.
TEST(CoefficientDecays, RoundingIsTightlyBounded) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  double nearest = 0.0;
  for (int round = 0; round < 300; ++round) {
    Multipoles air = example::make_air(example::make_bank(1, 0));
    const auto order = static_cast<std::int32_t>(random() % 9);
    const double hz = 20.0 * std::pow(1000.0, static_cast<double>(random() % 1000) / 1000.0);
    const double k = 2 * std::numbers::pi * hz / 343.0;
    std::vector<std::complex<double>> a;
    double sum = 0.0;
    for (std::int32_t l = 0; l <= order; ++l)
      for (std::int32_t i = 0; i < 2 * l + 1; ++i) {
        a.emplace_back(normal(random), normal(random));
        if (l < order) a.back() *= 2e-4;  // the highest order sets the step
        sum += std::norm(a.back()) / static_cast<double>(calc_hankel_square(k * air.radius_m, l));
      }
    air.freq_hz = {hz};
    add_coefficients(air, order, a);
    const double exact = sum / (2.0 * 1.21 * 343.0 * k * k);
    const CoefficientDecay found = calc_coefficient_decays(air).at(0);
    const double off = std::abs(std::sqrt(exact) - std::sqrt(found.decay_per_s));
    ASSERT_LE(off, found.root_rounding) << "order " << order << ", " << hz << " Hz";
    nearest = std::max(nearest, off / found.root_rounding);
  }
  EXPECT_GT(nearest, 0.2);
}

TEST(Multipoles, CoefficientsAreRoundedAndChecked) {
  Multipoles air;
  add_coefficients(air, 1, std::vector<std::complex<double>>{{1.0, 0.0}, {-4.0, 2.0}, {0.0, 1e-5}, {0.0, 0.0}});
  add_coefficients(air, 0, std::vector<std::complex<double>>{{0.0, 0.0}});
  EXPECT_EQ(air.scale, (std::vector<double>{4.0 / 32767.0, 0.0}));
  EXPECT_EQ(air.coefficient, (std::vector<std::int16_t>{8192, 0, -32767, 16384, 0, 0, 0, 0, 0, 0}));
  using List = std::vector<std::complex<double>>;
  EXPECT_THROW(add_coefficients(air, -1, List{}), InputError);
  EXPECT_THROW(add_coefficients(air, 121, List(122 * 122)), InputError);
  EXPECT_THROW(add_coefficients(air, 1, List(3)), InputError);
  EXPECT_THROW(add_coefficients(air, 0, List{{kNan, 0.0}}), InputError);
  EXPECT_EQ(air.order.size(), 2u);
}

// ---- validity ----

struct Spoiled {
  const char* name;
  std::function<void(Bank&)> spoil;
  const char* message;
};

class MultipoleFaults : public testing::TestWithParam<Spoiled> {};

TEST_P(MultipoleFaults, AreReported) {
  Bank bank = example::make_radiating_bank(2, kModes);
  ASSERT_EQ(find_faults(bank), std::vector<std::string>{});
  GetParam().spoil(bank);
  const std::vector<std::string> faults = find_faults(bank);
  ASSERT_FALSE(faults.empty());
  const bool is_named = std::any_of(faults.begin(), faults.end(), [&](const auto& f) { return f.find(GetParam().message) != f.npos; });
  EXPECT_TRUE(is_named) << faults[0];
  EXPECT_THROW(make_bank_bytes(bank), InputError);
}

const Spoiled kSpoiled[] = {
    {"wrong_decay", [](Bank& b) { b.multipoles.decay_per_s[3] *= 1.001; }, "radiation/decay[3] is"},
    {"decay_of_another_mode", [](Bank& b) { std::swap(b.multipoles.decay_per_s[1], b.multipoles.decay_per_s[2]); },
     "the coefficients give"},
    {"other_coefficient", [](Bank& b) { b.multipoles.coefficient[1] = static_cast<std::int16_t>(b.multipoles.coefficient[1] + 40); },
     "radiation/decay[0] is"},
    {"other_air", [](Bank& b) { b.multipoles.air_density_kg_m3 = 1.2; }, "the coefficients give"},
    {"negative_decay", [](Bank& b) { b.multipoles.decay_per_s[2] = -1e-3; }, "radiation/decay[2] is -0.001"},
    {"radius_zero", [](Bank& b) { b.multipoles.radius_m = 0.0; }, "radiation/radius_m is 0"},
    {"radius_nan", [](Bank& b) { b.multipoles.radius_m = kNan; }, "radiation/radius_m[0] is nan"},
    {"nearer_than_the_sphere", [](Bank& b) { b.multipoles.nearest_m = 0.999 * b.multipoles.radius_m; }, "radiation/nearest_m is"},
    {"surface_outside", [](Bank& b) { b.multipoles.centre_m[0] += 1e-3; }, "the surface reaches to"},
    {"centre_infinite", [](Bank& b) { b.multipoles.centre_m[1] = kInfinity; }, "radiation/centre_m[1] is inf"},
    {"no_air", [](Bank& b) { b.multipoles.air_density_kg_m3 = 0.0; }, "radiation/air_density_kg_m3 is 0"},
    {"no_sound", [](Bank& b) { b.multipoles.sound_speed_ms = -343.0; }, "radiation/sound_speed_ms is -343"},
    {"other_frequency", [](Bank& b) { b.multipoles.freq_hz[4] = 1.5 * b.corrected.freq_hz[4]; }, "radiation/freq_hz[4] is"},
    {"frequency_zero", [](Bank& b) { b.multipoles.freq_hz[0] = 0.0; }, "radiation/freq_hz[0] is 0"},
    {"negative_scale", [](Bank& b) { b.multipoles.scale[8] = -b.multipoles.scale[8]; }, "radiation/scale[8] is -"},
    {"scale_too_large", [](Bank& b) { b.multipoles.scale[8] = 1e300; }, "radiation/decay[8] is"},
    {"no_mass_at_all", [](Bank& b) { b.multipoles.added_mass[5] = -1.0; }, "radiation/added_mass[5] is -1"},
    {"mass_nan", [](Bank& b) { b.multipoles.added_mass[5] = kNan; }, "radiation/added_mass[5] is nan"},
    {"error_above_the_sound", [](Bank& b) { b.multipoles.error_db[6] = 0.1; }, "radiation/error_db[6] is 0.1"},
    {"error_unknown", [](Bank& b) { b.multipoles.error_db[6] = -kInfinity; }, "radiation/error_db[6] is -inf"},
    {"order_negative", [](Bank& b) { b.multipoles.order[0] = -1; }, "radiation/order[0] is -1, outside 0 to 120"},
    {"order_too_high", [](Bank& b) { b.multipoles.order[8] = 121; }, "radiation/order[8] is 121"},
    {"order_largest", [](Bank& b) { b.multipoles.order[8] = std::numeric_limits<std::int32_t>::max(); },
     "radiation/order[8] is 2147483647"},
    {"order_of_other_coefficients", [](Bank& b) { b.multipoles.order[8] += 1; }, "radiation/coefficient holds"},
    {"coefficients_missing", [](Bank& b) { b.multipoles.coefficient.resize(b.multipoles.coefficient.size() - 2); }, "coefficient holds"},
    {"mode_missing", [](Bank& b) { b.multipoles.added_mass.pop_back(); }, "radiation/added_mass holds 8 values, 9 are required"},
};

INSTANTIATE_TEST_SUITE_P(, MultipoleFaults, testing::ValuesIn(kSpoiled), [](const auto& info) { return std::string(info.param.name); });

TEST(Multipoles, OfASilentModeAreValid) {
  Bank bank = example::make_bank(2, 1);
  bank.multipoles = example::make_air(bank);
  example::add_sphere_mode(bank.multipoles, bank.freq_hz(0), {}, 0);
  ASSERT_EQ(bank.multipoles.scale[0], 0.0);
  EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
  EXPECT_EQ(calc_corrected(bank).radiation_gain[0], 0.0);
  bank.multipoles.decay_per_s[0] = 1e-6;
  EXPECT_FALSE(find_faults(bank).empty());
}

TEST(Multipoles, InAHalfSpaceAllDecaysAreHalfThoseOfTheField) {
  Bank bank = example::make_radiating_bank(2, kModes);
  for (double& decay_per_s : bank.multipoles.decay_per_s) decay_per_s *= 0.5;
  EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
  bank.multipoles.decay_per_s[7] *= 2.0;
  const std::vector<std::string> faults = find_faults(bank);
  ASSERT_FALSE(faults.empty());
  EXPECT_NE(faults[0].find("the coefficients give"), std::string::npos) << faults[0];
}

TEST(Multipoles, AreValidOnAPackedSurface) {
  const Bank bank = example::make_radiating_bank(3, kModes);
  const Bank packed = calc_packed(bank, -40.0).bank;
  double farthest = 0.0;
  for (const Vec3& x : packed.vertices_m) farthest = std::max(farthest, norm(x - bank.multipoles.centre_m));
  EXPECT_GT(farthest, bank.multipoles.radius_m) << "precondition of the case";
  EXPECT_EQ(find_faults(packed), std::vector<std::string>{});
}

}  // namespace
}  // namespace carillon::bank
