#include "runtime/acoustics/radiation/transfers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/multipoles.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/runtime/acoustics/radiation/multipole_bank.hpp"

namespace carillon::radiation {
namespace {

using std::numbers::pi;
using testing::add_multipoles;
using testing::Complex;
using testing::kSphereCentre;
using testing::kSphereRadius;

constexpr double kWaveResistance = bank::kAirDensityKgM3 * bank::kSoundSpeedMs;

std::vector<Complex> evaluate(const Transfers& transfers, const Vec3& from_centre_m) {
  std::vector<std::int32_t> modes(transfers.get_mode_count());
  std::iota(modes.begin(), modes.end(), 0);
  std::vector<std::complex<float>> transfer(modes.size());
  transfers.evaluate(transfers.get_centre_m() + from_centre_m, modes, transfer);
  return {transfer.begin(), transfer.end()};
}

std::vector<Vec3> make_directions(int count) {
  std::vector<Vec3> directions{{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}, {1e-9, -1e-9, 1}, {0, 1e-4, -1}, {0.01, 0.01, 1}};
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  while (static_cast<int>(directions.size()) < count) directions.push_back({normal(random), normal(random), normal(random)});
  for (Vec3& direction : directions) direction = normalise(direction);
  return directions;
}

TEST(Transfers, EachMultipoleIsItsClosedFormAtEveryDistance) {
  constexpr Complex kOne(1.0, -1.0);  // 16 bits hold it
  struct Mode {
    double ka;
    int l, m;
  };
  std::vector<Mode> modes;
  bank::Bank bank = testing::make_empty_multipoles();
  for (const double ka : {1e-4, 0.01, 0.1, 0.5, 1.0, pi, 10.0, 40.0, 60.0}) {
    for (int l = 0; l <= 8; ++l) {
      modes.push_back({ka, l, (l * 5 + 2) % (2 * l + 1) - l});
      std::vector<Complex> coefficients((l + 1) * (l + 1));
      coefficients[l * l + l + modes.back().m] = kOne;
      add_multipoles(bank, ka, coefficients);
    }
  }
  double worst = 0.0;
  for (const base::Instructions instructions : base::list_instructions()) {
    const Transfers transfers(bank, instructions);
    for (const double distance : {1.05, 1.3, 2.0, 10.0, 100.0, 1000.0}) {
      for (const Vec3& direction : make_directions(12)) {
        const std::vector<Complex> found = evaluate(transfers, distance * kSphereRadius * direction);
        for (std::size_t i = 0; i < modes.size(); ++i) {
          const auto& [ka, l, m] = modes[i];
          const auto ratio =
              testing::calc_hankel(l, static_cast<long double>(ka * distance)) / testing::calc_hankel(l, static_cast<long double>(ka));
          const Complex radial(static_cast<double>(ratio.real()), static_cast<double>(ratio.imag()));
          const double level = std::abs(radial) * std::sqrt(2.0 / (4.0 * pi));  // rms over directions
          if (level < 1e-29) continue;                                          // the header counts it as 0
          const Complex exact = radial * kOne * testing::calc_harmonic(l, m, direction);
          const double error = std::abs(found[i] - exact) / level;
          worst = std::max(worst, error);
          EXPECT_LT(error, 1e-5) << "ka " << ka << " l " << l << " r / R " << distance;
        }
      }
    }
  }
  RecordProperty("worst_db", std::to_string(20.0 * std::log10(worst)));
}

/// Largest error of a monopole off centre, relative to the root mean square of its field over directions at that distance, about 1 / (4 pi
/// r); `ka` and order per mode.
double find_monopole_error(const std::vector<std::pair<double, int>>& modes, const Vec3& source, const std::vector<double>& distances,
                           int directions) {
  bank::Bank bank = testing::make_empty_multipoles();
  for (const auto& [ka, order] : modes) add_multipoles(bank, ka, testing::calc_monopole(ka, source, order));
  double worst = 0.0;
  for (const base::Instructions instructions : base::list_instructions()) {
    const Transfers transfers(bank, instructions);
    for (const double distance : distances) {
      for (const Vec3& direction : make_directions(directions)) {
        const Vec3 place = distance * kSphereRadius * direction;
        const std::vector<Complex> found = evaluate(transfers, place);
        for (std::size_t i = 0; i < modes.size(); ++i) {
          const double k = modes[i].first / kSphereRadius, s = norm(place - source);
          const Complex exact = std::polar(1.0 / (4.0 * pi * s), k * (s - norm(place) + kSphereRadius));
          worst = std::max(worst, std::abs(found[i] - exact) * 4.0 * pi * norm(place));
        }
      }
    }
  }
  return worst;
}

TEST(Transfers, AMonopoleOffCentreSoundsFromWhereItIs) {
  const Vec3 source = kSphereRadius * Vec3{0.2, -0.25, 0.24};
  const double worst = find_monopole_error({{1e-4, 20}, {0.05, 30}, {0.5, 30}, {2.0, 30}, {7.0, 35}, {20.0, 40}, {30.0, 40}}, source,
                                           {1.05, 1.2, 1.7, 3.0, 10.0, 30.0, 100.0}, 60);
  RecordProperty("worst_db", std::to_string(20.0 * std::log10(worst)));
  EXPECT_LT(worst, 1e-3);
}

TEST(Transfers, TheHighestOrderHoldsAtTheLowestAndHighestFrequency) {
  const Vec3 near_pole = kSphereRadius * Vec3{0.02, -0.03, 0.74}, aside = kSphereRadius * Vec3{0.5, 0.5, -0.2};
  for (const Vec3& source : {near_pole, aside}) {
    const double worst = find_monopole_error({{1e-4, 120}, {60.0, 120}}, source, {1.05, 1.5, 4.0, 50.0, 1000.0}, 30);
    EXPECT_LT(worst, 2e-3);
    RecordProperty("worst_db", std::to_string(20.0 * std::log10(worst)));
  }
}

TEST(Transfers, OfAPulsatingSpherePressureLeadsVelocityBy45Degrees) {
  // ka = 1: p = rho0 c0 (1 - i) / 2 on the surface with e^{-i omega t}, Pierce (1981), 4.1.
  bank::Bank bank = testing::make_empty_multipoles();
  const Complex surface = kWaveResistance * Complex(0.5, -0.5);
  add_multipoles(bank, 1.0, std::vector<Complex>{surface * std::sqrt(4.0 * pi)});
  const Transfers transfers(bank);
  const Complex transfer = evaluate(transfers, {0.0, 2.0 * kSphereRadius, 0.0})[0];
  EXPECT_NEAR(std::abs(transfer), std::abs(surface) / 2.0, 1e-5 * std::abs(surface));
  // Velocity cos(omega t), pressure an eighth of a turn earlier, whichever way the state turns.
  for (const double angle : {-0.25 * pi, 0.0, 0.1, 0.25 * pi, 2.0}) {
    const double expected = 0.5 * std::abs(surface) * std::cos(angle + 0.25 * pi);
    EXPECT_NEAR((transfer * std::polar(1.0, -angle)).real(), expected, 1e-4 * std::abs(surface));
    EXPECT_NEAR((std::conj(transfer) * std::polar(1.0, angle)).real(), expected, 1e-4 * std::abs(surface));
  }
}

bank::Bank make_random_bank(int modes, int highest) {
  bank::Bank bank = testing::make_empty_multipoles();
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  for (int i = 0; i < modes; ++i) {
    const int order = static_cast<int>(random() % static_cast<unsigned>(highest + 1));
    std::vector<Complex> coefficients((order + 1) * (order + 1));
    for (Complex& a : coefficients) a = {normal(random), normal(random)};
    add_multipoles(bank, 0.5 + 10.0 * i / modes, coefficients);
  }
  return bank;
}

TEST(Transfers, InstructionSetsAgreeToTheLastBits) {
  const bank::Bank bank = make_random_bank(50, 30);
  for (const Vec3& direction : make_directions(20)) {
    for (const double distance : {1.1, 3.0, 40.0}) {
      const auto expected = evaluate(Transfers(bank, base::Instructions::kPlain), distance * kSphereRadius * direction);
      for (const base::Instructions instructions : base::list_instructions()) {
        const Transfers transfers(bank, instructions);
        const auto found = evaluate(transfers, distance * kSphereRadius * direction);
        for (std::size_t m = 0; m < found.size(); ++m)
          EXPECT_LT(std::abs(found[m] - expected[m]) * distance * kSphereRadius, 3e-5 * transfers.get_rms(static_cast<int>(m)))
              << m << " at " << distance;
      }
    }
  }
}

TEST(Transfers, AnySelectionInAnyOrderIsTheSame) {
  const bank::Bank bank = make_random_bank(1100, 5);  // more than a window
  const Transfers transfers(bank);
  const Vec3 place{0.02, 0.3, 0.2};
  const std::vector<Complex> all = evaluate(transfers, place);
  std::vector<std::int32_t> modes;
  std::mt19937 random(2);
  for (int i = 0; i < 300; ++i) modes.push_back(static_cast<std::int32_t>(random() % 1100));
  std::vector<std::complex<float>> some(modes.size());
  transfers.evaluate(transfers.get_centre_m() + place, modes, some);
  // Harmonics go to the highest order of the selection, and are the same to every order.
  for (std::size_t i = 0; i < modes.size(); ++i) EXPECT_EQ(Complex(some[i]), all[modes[i]]) << modes[i];
  transfers.evaluate(place, {}, {});
}

TEST(Transfers, TwoPlacesAtOnceAreTheSame) {
  const bank::Bank bank = make_random_bank(50, 30);
  const std::array<Vec3, 2> places{kSphereCentre + Vec3{0.4, 0.2, -0.1}, kSphereCentre + Vec3{-1.0, 2.0, 0.3}};
  for (const base::Instructions instructions : base::list_instructions()) {
    const Transfers transfers(bank, instructions);
    const std::vector<std::int32_t> modes{3, 0, 49, 17, 18, 3};
    std::array<std::vector<std::complex<float>>, 2> both;
    for (auto& one : both) one.resize(modes.size());
    transfers.evaluate(places, modes, {both[0], both[1]});
    for (std::size_t p = 0; p < 2; ++p) {
      const auto alone = evaluate(transfers, places[p] - kSphereCentre);
      const double distance = norm(places[p] - kSphereCentre);
      for (std::size_t i = 0; i < modes.size(); ++i)
        EXPECT_LT(std::abs(Complex(both[p][i]) - alone[modes[i]]) * distance, 1e-4 * transfers.get_rms(modes[i])) << modes[i];
    }
  }
}

// One order alone is itself; two orders of equal power at twice the radius give their mean square.
TEST(Transfers, TheOrderOfTurnsIsThatOfThePowerAtTwiceTheRadius) {
  bank::Bank bank = testing::make_empty_multipoles();
  std::vector<Complex> alone(36), two(36);
  alone[5 * 5 + 3] = {1.0, 0.5};
  constexpr double kKa = 4.0;
  const auto fall = [](int l) {
    return std::abs(testing::calc_hankel(l, static_cast<long double>(2.0 * kKa)) / testing::calc_hankel(l, static_cast<long double>(kKa)));
  };
  two[1 + 1] = 1.0;
  two[5 * 5 + 2] = static_cast<double>(fall(1) / fall(5));
  add_multipoles(bank, kKa, alone);
  add_multipoles(bank, kKa, two);
  const Transfers transfers(bank);
  EXPECT_NEAR(transfers.get_turn_order(0), 5.0, 1e-12);
  EXPECT_NEAR(transfers.get_turn_order(1), std::sqrt((1.0 + 25.0) / 2.0), 1e-3);
  EXPECT_EQ(transfers.get_order(1), 5);
}

TEST(Transfers, InsideTheSphereTheSurfacePointCounts) {
  const Transfers transfers(make_random_bank(40, 12));
  for (const Vec3& direction : make_directions(10)) {
    const auto expected = evaluate(transfers, 1.05 * kSphereRadius * direction);
    for (const double distance : {1.0, 0.3, 1e-9}) {
      const auto found = evaluate(transfers, distance * kSphereRadius * direction);
      for (std::size_t m = 0; m < found.size(); ++m)
        EXPECT_NEAR(std::abs(found[m] - expected[m]), 0.0, 1e-5 * transfers.get_rms(static_cast<int>(m)) / kSphereRadius);
    }
  }
  for (const Complex& one : evaluate(transfers, {})) EXPECT_TRUE(std::isfinite(std::abs(one)));
}

/// Gauss-Legendre nodes and weights on -1 .. 1.
std::vector<std::pair<double, double>> make_gauss(int count) {
  std::vector<std::pair<double, double>> nodes;
  for (int i = 0; i < count; ++i) {
    double x = std::cos(pi * (i + 0.75) / (count + 0.5)), slope = 0.0;
    for (int step = 0; step < 50; ++step) {
      const auto n = static_cast<unsigned>(count);
      slope = count * (x * std::legendre(n, x) - std::legendre(n - 1, x)) / (x * x - 1.0);
      x -= std::legendre(n, x) / slope;
    }
    nodes.emplace_back(x, 2.0 / ((1.0 - x * x) * slope * slope));
  }
  return nodes;
}

TEST(Transfers, TheMeanOverDirectionsFarAwayIsTheGainOfTheDecay) {
  bank::Bank bank = make_random_bank(30, 9);
  // Power of the far field, from the coefficients in closed form: sum of |a / h|^2 / (2 rho c k^2).
  const std::int16_t* steps = bank.multipoles.coefficient.data();
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    const double k = 2.0 * pi * bank.multipoles.freq_hz[i] / bank::kSoundSpeedMs;
    double sum = 0.0;
    for (int l = 0; l <= bank.multipoles.order[i]; ++l) {
      const auto size = static_cast<double>(std::abs(testing::calc_hankel(l, static_cast<long double>(k * kSphereRadius))));
      for (int n = 0; n < 2 * (2 * l + 1); ++n, ++steps) sum += std::pow(*steps * bank.multipoles.scale[i] / size, 2);
    }
    bank.multipoles.decay_per_s[i] = sum / (2.0 * kWaveResistance * k * k);
  }
  bank.radiation_gain.assign(bank.mode_count(), 0.0);
  bank.shape_scale.assign(bank.mode_count(), 0.0);
  const std::vector<double> gains = calc_gains(bank, GainKind::kBem);
  const Transfers transfers(bank);
  constexpr double kFar = 1000.0;
  std::vector<double> squares(bank.mode_count());
  for (const auto& [z, weight] : make_gauss(12)) {
    for (int turn = 0; turn < 24; ++turn) {
      const double across = std::sqrt(1.0 - z * z), angle = 2.0 * pi * turn / 24;
      const auto found = evaluate(transfers, kFar * Vec3{across * std::cos(angle), across * std::sin(angle), z});
      for (std::size_t m = 0; m < squares.size(); ++m) squares[m] += weight / 48.0 * std::norm(found[m]);
    }
  }
  for (std::size_t m = 0; m < squares.size(); ++m) {
    EXPECT_NEAR(kFar * std::sqrt(squares[m]) / gains[m], 1.0, 1e-3) << m;
    EXPECT_NEAR(transfers.get_rms(static_cast<int>(m)) / gains[m], 1.0, 1e-6) << m;
  }
}

// Above a rigid plane a body radiates half of the power that its field and the mirrored one carry: the mean over the half space is that of
// the whole field, and so is the gain. In another air the same decay is another pressure.
TEST(Transfers, TheGainIsTheMeanOfAHalfSpaceAndInTheAirOfTheBank) {
  for (const bool is_half : {false, true}) {
    bank::Bank bank = make_random_bank(30, 9);
    bank.multipoles.air_density_kg_m3 = 0.9;
    bank.multipoles.sound_speed_ms = 390.0;
    const std::vector<bank::CoefficientDecay> carried = bank::calc_coefficient_decays(bank.multipoles);
    for (std::size_t m = 0; m < carried.size(); ++m) bank.multipoles.decay_per_s[m] = (is_half ? 0.5 : 1.0) * carried[m].decay_per_s;
    bank.radiation_gain.assign(bank.mode_count(), 0.0);
    bank.shape_scale.assign(bank.mode_count(), 0.0);
    EXPECT_EQ(bank::is_half_space(bank.multipoles), is_half);
    const std::vector<double> gains = calc_gains(bank, GainKind::kBem);
    const Transfers transfers(bank);
    constexpr double kFar = 1000.0;
    std::vector<double> squares(bank.mode_count());
    for (const auto& [z, weight] : make_gauss(12)) {
      for (int turn = 0; turn < 24; ++turn) {
        const double across = std::sqrt(1.0 - z * z), angle = 2.0 * pi * turn / 24;
        const auto found = evaluate(transfers, kFar * Vec3{across * std::cos(angle), across * std::sin(angle), z});
        for (std::size_t m = 0; m < squares.size(); ++m) squares[m] += weight / 48.0 * std::norm(found[m]);
      }
    }
    for (std::size_t m = 0; m < squares.size(); ++m) EXPECT_NEAR(kFar * std::sqrt(squares[m]) / gains[m], 1.0, 1e-3) << m;
  }
}

TEST(Transfers, ReportsItsMemory) {
  const bank::Bank bank = make_random_bank(20, 9);
  const Transfers transfers(bank);
  EXPECT_EQ(transfers.get_mode_count(), 20);
  EXPECT_EQ(transfers.get_centre_m(), kSphereCentre);
  EXPECT_EQ(transfers.get_radius_m(), kSphereRadius);
  EXPECT_GT(transfers.calc_bytes(), 2 * bank.multipoles.coefficient.size());
  EXPECT_EQ(make_transfers(bank::Bank{}), nullptr);
  EXPECT_EQ(make_transfers(bank)->get_mode_count(), 20);
  for (int m = 0; m < 20; ++m) EXPECT_EQ(transfers.get_order(m), bank.multipoles.order[m]);
}

TEST(Transfers, BanksWithoutMultipolesAndInconsistentOnesAreRefused) {
  EXPECT_THROW(Transfers(bank::Bank{}), InputError);
  const bank::Bank good = make_random_bank(3, 4);
  const auto refuses = [&](auto&& change) {
    bank::Bank bank = good;
    change(bank);
    EXPECT_THROW(Transfers{bank}, InputError);
  };
  refuses([](bank::Bank& bank) { bank.multipoles.coefficient.pop_back(); });
  refuses([](bank::Bank& bank) { bank.multipoles.order[1] = bank::kMaxOrder + 1; });
  refuses([](bank::Bank& bank) { bank.multipoles.order[1] = -1; });
  refuses([](bank::Bank& bank) { bank.multipoles.scale.pop_back(); });
  refuses([](bank::Bank& bank) { bank.multipoles.freq_hz[2] = 0.0; });
  refuses([](bank::Bank& bank) { bank.multipoles.radius_m = 0.0; });
  refuses([](bank::Bank& bank) { bank.eigenvalue_rad2_s2.pop_back(); });
}

}  // namespace
}  // namespace carillon::radiation
