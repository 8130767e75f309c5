// Nonlinear energy of a bank: sums, files, selection, edits and playing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "runtime/bank/corrected.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/report.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/bank/write.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/runtime/bank/bank_arrays.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"
#include "tests/unit/runtime/bank/seal_again.hpp"

namespace carillon::bank {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();
constexpr std::size_t kModes = 9;

struct Chance {
  std::mt19937 engine{3};
  double draw() { return std::uniform_real_distribution<double>(-1.0, 1.0)(engine); }
};

enum class Kind { kRows, kCurvedRows, kSheetPoints, kSolidPoints };
constexpr Kind kKinds[] = {Kind::kRows, Kind::kCurvedRows, Kind::kSheetPoints, Kind::kSolidPoints};

/// Modes 1, 2, 4 and 7 of nine.
QuarticEnergy make_energy(const Bank& bank, Kind kind) {
  Chance chance;
  QuarticEnergy energy;
  energy.modes = {1, 2, 4, 7};
  constexpr std::size_t kRows = 3, kPoints = 5;
  if (kind == Kind::kRows || kind == Kind::kCurvedRows) {
    for (std::size_t i = 0; i < kRows * count_pairs(4); ++i) energy.rows.push_back(static_cast<float>(1e6 * chance.draw()));
  } else {
    const std::size_t parts = kind == Kind::kSheetPoints ? 6 : 9;
    for (std::size_t i = 0; i < kPoints * parts * 4; ++i) energy.gradient.push_back(static_cast<float>(30.0 * chance.draw()));
    for (std::size_t i = 0; i < kRows * kPoints * (parts == 6 ? 3 : 6); ++i)
      energy.stress.push_back(static_cast<float>(1e3 * chance.draw()));
    energy.weight = {0.5, 0.0, 2.0, 1.0, 0.25};
    energy.error = 8e-4;
  }
  if (kind == Kind::kCurvedRows || kind == Kind::kSolidPoints) {
    for (std::size_t i = 0; i < kRows * 4; ++i)
      energy.linear.push_back(0.28 * std::sqrt(bank.eigenvalue_rad2_s2[energy.modes[i % 4]]) * chance.draw());
    energy.rest_energy_j = 1e-3;
  }
  energy.membrane_ratio = 0.3;
  energy.thickness_m = 1e-3;
  return energy;
}

Bank make_nonlinear_bank(Kind kind = Kind::kRows) {
  Bank bank = example::make_corrected_bank(2, kModes);
  bank.quartic = make_energy(bank, kind);
  return bank;
}

void expect_same(const QuarticEnergy& a, const QuarticEnergy& b) {
  EXPECT_EQ(a.modes, b.modes);
  EXPECT_EQ(a.rows, b.rows);
  EXPECT_EQ(a.gradient, b.gradient);
  EXPECT_EQ(a.stress, b.stress);
  EXPECT_EQ(a.weight, b.weight);
  EXPECT_EQ(a.linear, b.linear);
  EXPECT_EQ(a.rest_energy_j, b.rest_energy_j);
  EXPECT_EQ(a.error, b.error);
  EXPECT_EQ(a.membrane_ratio, b.membrane_ratio);
  EXPECT_EQ(a.thickness_m, b.thickness_m);
}

double find_energy(const QuarticEnergy& energy, const std::vector<double>& q) {
  std::vector<double> gradient(q.size());
  return calc_energy_j(energy, q, gradient);
}

// ---- sums ----

TEST(QuarticEnergy, MatchesItsDefinition) {
  QuarticEnergy energy;
  energy.modes = {0, 1};
  energy.rows = {2.0F, -1.0F, 3.0F, 0.5F, 4.0F, 0.0F};  // (0, 0), (0, 1), (1, 1) of two rows
  energy.linear = {1.0, 2.0, 0.0, -3.0};
  const double q0 = 0.7, q1 = -1.3;
  const double eta0 = 2.0 * q0 * q0 - 2.0 * q0 * q1 + 3.0 * q1 * q1, eta1 = 0.5 * q0 * q0 + 8.0 * q0 * q1;
  const double wanted = (q0 + 2.0 * q1) * eta0 + 0.5 * eta0 * eta0 - 3.0 * q1 * eta1 + 0.5 * eta1 * eta1;
  EXPECT_NEAR(find_energy(energy, {q0, q1}), wanted, 1e-13);
  energy.linear.clear();
  EXPECT_EQ(calc_self_coupling(energy), (std::vector<double>{4.25, 9.0}));
}

TEST(QuarticEnergy, OfPointsIsTheEnergyOfGreensStrain) {
  for (const std::size_t parts : {6u, 9u}) {
    // One mode, one point: eta = w sum of stress times the quadratic part of (F^T F - 1) / 2.
    QuarticEnergy energy;
    energy.modes = {0};
    const std::size_t axes = parts / 3;
    for (std::size_t i = 0; i < parts; ++i) energy.gradient.push_back(static_cast<float>(i) - 2.5F);
    const auto find_strain = [&](std::size_t a, std::size_t b) {
      double sum = 0.0;
      for (std::size_t k = 0; k < 3; ++k)
        sum += 0.5 * static_cast<double>(energy.gradient[k * axes + a]) * static_cast<double>(energy.gradient[k * axes + b]);
      return sum;
    };
    energy.weight = {0.5};
    energy.stress = parts == 6 ? std::vector<float>{3.0F, -1.0F, 2.0F} : std::vector<float>{3.0F, -1.0F, 2.0F, 5.0F, -4.0F, 1.0F};
    double eta = 3.0 * find_strain(0, 0) - find_strain(1, 1);
    // Engineering shear strains: twice the tensor's.
    eta += parts == 6 ? 2.0 * 2.0 * find_strain(0, 1)
                      : 2.0 * find_strain(2, 2) + 2.0 * (5.0 * find_strain(1, 2) - 4.0 * find_strain(0, 2) + find_strain(0, 1));
    EXPECT_NEAR(find_energy(energy, {0.3}), 0.5 * std::pow(0.5 * eta * 0.09, 2), 1e-12) << parts;
  }
}

TEST(QuarticEnergy, GradientMatchesFiniteDifferences) {
  for (const Kind kind : kKinds) {
    const QuarticEnergy energy = make_nonlinear_bank(kind).quartic;
    std::vector<double> q{1e-3, -2e-3, 5e-4, 1.5e-3}, gradient(4);
    (void)calc_energy_j(energy, q, gradient);
    for (std::size_t i = 0; i < 4; ++i) {
      const double step = 1e-6, at = q[i];
      q[i] = at + step;
      const double up = find_energy(energy, q);
      q[i] = at - step;
      const double difference = (up - find_energy(energy, q)) / (2.0 * step);
      q[i] = at;
      EXPECT_NEAR(gradient[i] / difference, 1.0, 1e-5) << i;
    }
  }
}

// ---- files ----

TEST(QuarticFile, ReadsBackExactlyAndRaisesTheVersion) {
  const tests::Folder folder;
  const std::filesystem::path file = folder.path() / "bank.hdf";
  for (const Kind kind : kKinds) {
    const Bank bank = make_nonlinear_bank(kind);
    EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
    write_bank(bank, file);
    EXPECT_EQ(read_version(file), (std::array{1, 7}));
    expect_same(read_bank(file).quartic, bank.quartic);
    EXPECT_EQ(make_bank_bytes(read_bank(file)), make_bank_bytes(bank));
    write_packed_bank(calc_packed(bank, -40.0), file);
    EXPECT_EQ(read_version(file), (std::array{2, 3}));
    expect_same(read_bank(file).quartic, bank.quartic);
  }
  write_bank(example::make_corrected_bank(2, kModes), file);
  EXPECT_EQ(read_version(file), (std::array{1, 4}));
  EXPECT_TRUE(read_bank(file).quartic.is_empty());
}

TEST(QuarticFile, IsShownByInfo) {
  const tests::Folder folder;
  const std::filesystem::path file = folder.path() / "bank.hdf";
  Bank bank = make_nonlinear_bank(Kind::kSolidPoints);
  bank.quartic.membrane_ratio = 0.8;
  write_bank(bank, file);
  const std::string info = format_info(read_bank(file), list_heard(bank, {}), file, 0, false);
  EXPECT_NE(info.find("nonlinear 4 coupled modes, 3 rows at 5 points, energy to 8.0e-04, curved"), std::string::npos) << info;
  EXPECT_NE(info.find("above 0.5 its inertia counts"), std::string::npos) << info;
  EXPECT_NE(format_info_json(read_bank(file), list_heard(bank, {}), file).find("\"coupled_modes\""), std::string::npos);
}

struct Spoiled {
  const char* name;
  Kind kind;
  std::function<void(QuarticEnergy&)> spoil;
  const char* fault;
};

const Spoiled kSpoiled[] = {
    {"no_such_mode", Kind::kRows, [](QuarticEnergy& e) { e.modes[3] = 9; }, "nonlinear/modes[3] is 9"},
    {"negative_mode", Kind::kRows, [](QuarticEnergy& e) { e.modes[0] = -1; }, "nonlinear/modes[0] is -1"},
    {"mode_twice", Kind::kRows, [](QuarticEnergy& e) { e.modes[1] = 1; }, "nonlinear/modes[1] is 1"},
    {"row_cut", Kind::kRows, [](QuarticEnergy& e) { e.rows.pop_back(); }, "nonlinear/A holds 29 values"},
    {"no_rows", Kind::kRows, [](QuarticEnergy& e) { e.rows.clear(); }, "nonlinear/A holds 0 values"},
    {"no_modes", Kind::kRows, [](QuarticEnergy& e) { e.modes.clear(); }, "nonlinear/modes is empty"},
    {"both_forms", Kind::kSheetPoints, [](QuarticEnergy& e) { e.rows.resize(10); }, "one form is wanted"},
    {"gradient_cut", Kind::kSheetPoints, [](QuarticEnergy& e) { e.gradient.pop_back(); }, "nonlinear/G holds 119 values"},
    {"stress_cut", Kind::kSheetPoints, [](QuarticEnergy& e) { e.stress.pop_back(); }, "nonlinear/stress holds 44 values"},
    {"no_points", Kind::kSheetPoints, [](QuarticEnergy& e) { e.weight.clear(); }, "nonlinear/weight has no points"},
    {"linear_cut", Kind::kCurvedRows, [](QuarticEnergy& e) { e.linear.pop_back(); }, "nonlinear/linear holds 11 values"},
    {"row_nan", Kind::kRows, [](QuarticEnergy& e) { e.rows[4] = kNan; }, "nonlinear/A[4] is nan"},
    {"gradient_infinite", Kind::kSolidPoints, [](QuarticEnergy& e) { e.gradient[4] = kInfinity; }, "nonlinear/G[4] is inf"},
    {"stress_nan", Kind::kSolidPoints, [](QuarticEnergy& e) { e.stress[0] = kNan; }, "nonlinear/stress[0] is nan"},
    {"linear_nan", Kind::kCurvedRows, [](QuarticEnergy& e) { e.linear[2] = static_cast<double>(kNan); }, "nonlinear/linear[2] is nan"},
    {"negative_weight", Kind::kSheetPoints, [](QuarticEnergy& e) { e.weight[1] = -1e-3; }, "nonlinear/weight[1] is -0.001"},
    {"negative_rest", Kind::kRows, [](QuarticEnergy& e) { e.rest_energy_j = -1.0; }, "nonlinear/rest_energy_j is -1"},
    {"negative_error", Kind::kRows, [](QuarticEnergy& e) { e.error = -1.0; }, "nonlinear/error is -1"},
    {"ratio_nan", Kind::kRows, [](QuarticEnergy& e) { e.membrane_ratio = static_cast<double>(kNan); }, "nonlinear/membrane_ratio is nan"},
    {"negative_thickness", Kind::kRows, [](QuarticEnergy& e) { e.thickness_m = -1.0; }, "nonlinear/thickness_m is -1"},
    {"energy_negative", Kind::kCurvedRows,
     [](QuarticEnergy& e) {
       for (double& b : e.linear) b *= 6.0;
     },
     "could be negative"},
};

class QuarticFaults : public testing::TestWithParam<Spoiled> {};

TEST_P(QuarticFaults, AreReportedAndNotWritten) {
  const tests::Folder folder;
  Bank bank = make_nonlinear_bank(GetParam().kind);
  ASSERT_EQ(find_faults(bank), std::vector<std::string>{});
  GetParam().spoil(bank.quartic);
  const std::vector<std::string> faults = find_faults(bank);
  ASSERT_FALSE(faults.empty());
  EXPECT_NE(faults[0].find(GetParam().fault), std::string::npos) << faults[0];
  EXPECT_THROW(write_bank(bank, folder.path() / "bank.hdf"), InputError);
}

INSTANTIATE_TEST_SUITE_P(, QuarticFaults, testing::ValuesIn(kSpoiled), [](const auto& info) { return std::string(info.param.name); });

TEST(QuarticFile, WrongSizesAndTypesAreRejected) {
  for (const Kind kind : kKinds) {
    const Bank bank = make_nonlinear_bank(kind);
    ASSERT_EQ(Arrays(bank).find_error(), "");
    for (std::size_t i = 0; i < Arrays(bank).list.size(); ++i) {
      const std::string name = Arrays(bank).list[i].field.name;
      if (!name.starts_with("nonlinear/")) continue;
      Arrays missing(bank);
      missing.list.erase(missing.list.begin() + static_cast<std::ptrdiff_t>(i));
      if (name != "nonlinear/linear") {  // a flat body without it
        EXPECT_NE(missing.find_error(), "") << name;
      }
      for (const std::vector<std::uint64_t>& shape :
           {std::vector<std::uint64_t>{0}, {}, {0, 7}, {1, 1}, {1, 0, 1}, {std::uint64_t{1} << 62, 0, 4}, {2, 9, 0}, {3, 10, 1}}) {
        Arrays other(bank);
        FieldBytes& array = other.list[i];
        if (array.field.shape == shape) continue;
        array.field.shape = shape;
        std::uint64_t count = find_item_bytes(array.field.dtype);
        for (const std::uint64_t extent : shape) count = extent == 0 ? 0 : count * std::min<std::uint64_t>(extent, 1000);
        array.bytes = array.bytes.first(std::min<std::size_t>(count, array.bytes.size()));
        EXPECT_NE(other.find_error(), "") << name << " of " << shape.size() << " extents";
      }
      Arrays double_type(bank);
      double_type.list[i].field.dtype = "<i8";
      EXPECT_NE(double_type.find_error(), "") << name;
    }
  }
}

TEST(QuarticFile, ChangedBytesGiveABankOrAnError) {
  std::mt19937 chance(1);
  int read = 0, refused = 0;
  for (const Kind kind : kKinds) {
    const std::string whole = make_bank_bytes(make_nonlinear_bank(kind));
    const std::size_t line = whole.find("field nonlinear/");
    ASSERT_NE(line, std::string::npos);
    for (int trial = 0; trial < 400; ++trial) {
      std::string bytes = whole;
      for (unsigned i = 0; i < 1 + chance() % 3; ++i) {
        // Half of the flips in the seal's lines for these arrays.
        const std::size_t at = trial % 2 == 0 ? line + chance() % 600 : kSealBytes + chance() % (bytes.size() - kSealBytes);
        bytes[at] = static_cast<char>(trial % 2 == 0 ? "0123456789 \n<fi"[chance() % 15] : chance() % 256);
      }
      bytes = seal_again(bytes);
      try {
        const Bank bank = parse_bank(std::as_bytes(std::span(bytes)));
        (void)calc_corrected(bank);
        ++read;
      } catch (const InputError&) {
        ++refused;
      }
    }
  }
  EXPECT_GT(read, 50);
  EXPECT_GT(refused, 50);
}

// ---- edits ----

TEST(QuarticEdits, SelectionKeepsTheEnergyOfKeptModes) {
  for (const Kind kind : kKinds) {
    Bank bank = make_nonlinear_bank(kind);
    const QuarticEnergy whole = bank.quartic;
    select_modes(bank, {7, 0, 4, 1, 8});  // reordered: indices 0, 2 and 3 are coupled now
    EXPECT_EQ(bank.quartic.modes, (std::vector<std::int32_t>{0, 2, 3}));
    EXPECT_EQ(find_size_fault(bank.quartic), "");
    const double q1 = 1e-3, q4 = -7e-4, q7 = 4e-4;
    EXPECT_NEAR(find_energy(bank.quartic, {q7, q4, q1}) / find_energy(whole, {q1, 0.0, q4, q7}), 1.0, 1e-12);
    select_modes(bank, {1, 4});
    EXPECT_TRUE(bank.quartic.is_empty());
    EXPECT_EQ(find_size_fault(bank.quartic), "");
  }
  Bank bank = make_nonlinear_bank();
  keep_lowest(bank, 5);
  EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
}

TEST(QuarticEdits, FollowDensityStiffnessAndSize) {
  // eta scales with the root of modulus and volume times a strain, phi q over a length squared: derived independently of the code.
  for (const Kind kind : kKinds) {
    const Bank bank = make_nonlinear_bank(kind);
    const double s = 1.7, k = 2.3, g = 0.6;
    const Bank edited = calc_edited(bank, {.density_scale = s, .stiffness_scale = k, .size_scale = g});
    EXPECT_EQ(find_faults(edited), std::vector<std::string>{});
    // The same motion relative to the size: phi' q' = g phi q, phi' = phi / sqrt(s g^3).
    const std::vector<double> q{1e-3, -2e-3, 5e-4, 1.5e-3};
    std::vector<double> larger;
    for (const double x : q) larger.push_back(x * g * std::sqrt(s * g * g * g));
    // Equal strains: the energy scales with modulus times volume.
    EXPECT_NEAR(find_energy(edited.quartic, larger) / find_energy(bank.quartic, q), k * g * g * g, 1e-6 * k);
    EXPECT_NEAR(edited.quartic.rest_energy_j, bank.quartic.rest_energy_j * k * g * g * g, 1e-15);
    EXPECT_NEAR(edited.quartic.thickness_m, g * 1e-3, 1e-15);
    EXPECT_EQ(edited.quartic.error, bank.quartic.error);
  }
}

TEST(QuarticEdits, HardeningIsTheSameAtThePlayedFrequencies) {
  const Bank bank = make_nonlinear_bank(Kind::kCurvedRows);
  const Bank played = calc_corrected(bank);
  EXPECT_EQ(find_faults(played), std::vector<std::string>{});
  // V of each coupled mode at the same motion over its linear energy.
  const std::vector<double> before = calc_self_coupling(bank.quartic), after = calc_self_coupling(played.quartic);
  const std::vector<std::size_t> order = sort_played_modes(bank);
  int found = 0;
  for (std::size_t i = 0; i < played.quartic.mode_count(); ++i) {
    const auto now = static_cast<std::size_t>(played.quartic.modes[i]), then = order[now];
    for (std::size_t j = 0; j < 4; ++j) {
      if (static_cast<std::size_t>(bank.quartic.modes[j]) != then) continue;
      ++found;
      const double linear = played.eigenvalue_rad2_s2[now] / bank.eigenvalue_rad2_s2[then];
      EXPECT_NEAR(after[i] / before[j] / linear, 1.0, 1e-6);
    }
  }
  EXPECT_EQ(found, 4);
}

TEST(QuarticEdits, CombinedModesHaveTheEnergyOfTheSameMotion) {
  for (const Kind kind : kKinds) {
    QuarticEnergy energy = make_nonlinear_bank(kind).quartic;
    const QuarticEnergy before = energy;
    Chance chance;
    std::vector<double> parts(16), q(4), old(4);
    for (double& part : parts) part = chance.draw();
    for (double& x : q) x = 1e-3 * chance.draw();
    for (std::size_t j = 0; j < 4; ++j)
      for (std::size_t i = 0; i < 4; ++i) old[j] += parts[i * 4 + j] * q[i];
    combine_modes(energy, parts);
    EXPECT_NEAR(find_energy(energy, q) / find_energy(before, old), 1.0, 1e-5);
  }
}

}  // namespace
}  // namespace carillon::bank
