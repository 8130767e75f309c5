// Modes coupled by the air: validity, files, edits and playing.
#include "runtime/bank/mixing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "runtime/bank/corrected.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/bank/write.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

constexpr std::size_t kModes = 9;

/// Each mode mixed with its neighbours and two rigid motions, normalised to the recorded added mass.
Bank make_coupled_bank(int n = 2, std::size_t modes = kModes) {
  Bank bank = example::make_radiating_bank(n, modes);
  Mixing& mixing = bank.multipoles.mixing;
  for (std::size_t m = 0; m < modes; ++m) {
    std::vector<std::pair<std::size_t, double>> parts;
    if (m > 0) parts.emplace_back(m - 1, -0.07);
    parts.emplace_back(m, 1.0);
    if (m + 1 < modes) parts.emplace_back(m + 1, 0.11);
    parts.emplace_back(modes + 2, 0.05);
    parts.emplace_back(modes + 3 + m % 3, -0.02);
    double squares = 0.0;
    for (const auto& [motion, part] : parts) squares += part * part;
    for (const auto& [motion, part] : parts) {
      mixing.motion.push_back(static_cast<std::int32_t>(motion));
      mixing.part.push_back(part / std::sqrt(squares * (1.0 + bank.multipoles.added_mass[m])));
    }
    mixing.count.push_back(static_cast<std::int32_t>(parts.size()));
  }
  return bank;
}

/// Part of `motion` in `mode`; 0 if absent.
double find_part(const Mixing& mixing, std::size_t mode, std::size_t motion) {
  std::size_t at = 0;
  for (std::size_t m = 0; m < mode; ++m) at += static_cast<std::size_t>(mixing.count[m]);
  for (std::size_t k = at; k < at + static_cast<std::size_t>(mixing.count[mode]); ++k)
    if (mixing.motion[k] == static_cast<std::int32_t>(motion)) return mixing.part[k];
  return 0.0;
}

void expect_same(const Mixing& a, const Mixing& b) {
  EXPECT_EQ(a.count, b.count);
  EXPECT_EQ(a.motion, b.motion);
  EXPECT_EQ(a.part, b.part);
}

TEST(RigidMotions, HaveUnitModalMassAndAreOrthogonal) {
  // Eight masses at the corners of a rotated box: their sums are the inertia.
  const double turn = 0.5;
  RigidBody rigid{.mass_kg = 0.0, .centre_m = {1.0, -2.0, 0.5}};
  std::vector<Vec3> places;
  for (const double x : {-0.3, 0.3})
    for (const double y : {-0.1, 0.1})
      for (const double z : {-0.2, 0.2}) {
        const Vec3 turned{std::cos(turn) * x - std::sin(turn) * y, std::sin(turn) * x + std::cos(turn) * y, z + 0.4 * y};
        places.push_back(rigid.centre_m + turned);
        rigid.mass_kg += 0.25;
        for (std::size_t i = 0; i < 3; ++i)
          for (std::size_t j = 0; j < 3; ++j)
            rigid.inertia_kg_m2[3 * i + j] += 0.25 * ((i == j ? dot(turned, turned) : 0.0) - turned[i] * turned[j]);
      }
  const RigidMotions motions(rigid);
  for (std::size_t a = 0; a < kRigidMotions; ++a)
    for (std::size_t b = 0; b < kRigidMotions; ++b) {
      double mass = 0.0;
      for (const Vec3& place : places) mass += 0.25 * dot(motions.find(a, place), motions.find(b, place));
      EXPECT_NEAR(mass, a == b ? 1.0 : 0.0, 1e-12) << a << " " << b;
    }
}

struct Spoiled {
  const char* name;
  std::function<void(Mixing&)> spoil;
  const char* message;
};

class MixingFaults : public testing::TestWithParam<Spoiled> {};

TEST_P(MixingFaults, AreReported) {
  Bank bank = make_coupled_bank();
  ASSERT_EQ(find_faults(bank), std::vector<std::string>{});
  GetParam().spoil(bank.multipoles.mixing);
  const std::vector<std::string> faults = find_faults(bank);
  ASSERT_FALSE(faults.empty());
  EXPECT_TRUE(std::any_of(faults.begin(), faults.end(), [&](const auto& f) { return f.find(GetParam().message) != f.npos; })) << faults[0];
  EXPECT_THROW(make_bank_bytes(bank), InputError);
}

const Spoiled kSpoiled[] = {
    {"other_part", [](Mixing& m) { m.part[5] *= 1.001; }, "(radiation/mixing_part) have a modal mass of"},
    {"part_infinite", [](Mixing& m) { m.part[5] = HUGE_VAL; }, "radiation/mixing_part[5] is inf"},
    {"no_part", [](Mixing& m) { m.count[0] = 0; }, "radiation/mixing_count[0] is 0"},
    {"too_many_parts", [](Mixing& m) { m.count[8] += 1; }, "radiation/mixing_count[8] is"},
    {"largest_count", [](Mixing& m) { m.count[3] = std::numeric_limits<std::int32_t>::max(); }, "radiation/mixing_count[3] is"},
    {"part_left", [](Mixing& m) { m.count[8] -= 1; }, "radiation/mixing_motion holds"},
    {"mode_missing", [](Mixing& m) { m.count.pop_back(); }, "radiation/mixing_count holds 8 values, 9 are required"},
    {"value_missing", [](Mixing& m) { m.part.pop_back(); }, "radiation/mixing_part holds"},
    {"motion_negative", [](Mixing& m) { m.motion[0] = -1; }, "radiation/mixing_motion[0] is -1"},
    {"motion_beyond", [](Mixing& m) { m.motion[3] = 15; }, "radiation/mixing_motion[3] is 15"},
    {"motion_twice", [](Mixing& m) { m.motion[1] = m.motion[0]; }, "radiation/mixing_motion[1] is"},
};

INSTANTIATE_TEST_SUITE_P(, MixingFaults, testing::ValuesIn(kSpoiled), [](const auto& info) { return std::string(info.param.name); });

TEST(MixingFile, ReadsBackExactlyAndRaisesTheVersion) {
  const Bank bank = make_coupled_bank();
  EXPECT_EQ(find_version(bank, false), (std::array<int, 2>{1, 6}));
  EXPECT_EQ(find_version(bank, true), (std::array<int, 2>{2, 2}));
  EXPECT_EQ(find_version(example::make_radiating_bank(2, kModes), false), (std::array<int, 2>{1, 5}));
  const std::string bytes = make_bank_bytes(bank);
  expect_same(parse_bank(std::as_bytes(std::span(bytes))).multipoles.mixing, bank.multipoles.mixing);
  const std::string without = make_bank_bytes(example::make_radiating_bank(2, kModes));
  const Bank alone = parse_bank(std::as_bytes(std::span(without)));
  EXPECT_TRUE(alone.multipoles.mixing.is_empty());
}

TEST(MixingFile, PackedKeepsIt) {
  const Bank bank = make_coupled_bank(3);
  const Bank packed = calc_packed(bank, -40.0).bank;
  EXPECT_EQ(find_faults(packed), std::vector<std::string>{});
  expect_same(packed.multipoles.mixing, bank.multipoles.mixing);
}

TEST(MixingSelection, EveryModeKeepsItsPartsInAnyOrder) {
  const Bank bank = make_coupled_bank();
  Bank turned = bank;
  const std::vector<std::size_t> order{4, 8, 0, 3, 7, 1, 2, 6, 5};
  select_modes(turned, order);
  const Mixing& mixing = turned.multipoles.mixing;
  for (std::size_t i = 0; i < kModes; ++i) {
    for (std::size_t j = 0; j < kModes; ++j)
      EXPECT_EQ(find_part(mixing, i, j), find_part(bank.multipoles.mixing, order[i], order[j])) << i << " " << j;
    for (std::size_t r = 0; r < kRigidMotions; ++r)
      EXPECT_EQ(find_part(mixing, i, kModes + r), find_part(bank.multipoles.mixing, order[i], kModes + r));
  }
  EXPECT_TRUE(std::is_sorted(mixing.motion.begin(), mixing.motion.begin() + mixing.count[0]));
}

TEST(MixingSelection, RemainingPartsHaveUnitMass) {
  Bank bank = make_coupled_bank();
  keep_lowest(bank, 4);
  EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
  ASSERT_EQ(bank.multipoles.mixing.count.size(), 4u);
  for (const std::int32_t motion : bank.multipoles.mixing.motion) EXPECT_LT(motion, 10);
}

TEST(PlayedCoupled, HasTheShapesAndDecaysOfTheSums) {
  for (const Frequencies frequencies : {Frequencies::kCorrected, Frequencies::kMesh}) {
    Bank bank = make_coupled_bank();
    bank.supports = example::make_supported_bank(2, kModes).supports;
    ASSERT_EQ(find_faults(bank), std::vector<std::string>{});
    const Bank played = choose_frequencies(bank, frequencies);
    EXPECT_EQ(find_faults(played), std::vector<std::string>{});
    EXPECT_TRUE(played.multipoles.mixing.is_empty());
    std::vector<std::size_t> order(kModes);
    std::iota(order.begin(), order.end(), 0U);
    const bool is_corrected = frequencies == Frequencies::kCorrected;
    if (is_corrected) order = sort_played_modes(bank);
    const double mass = bank.rigid.mass_kg;
    for (std::size_t m = 0; m < kModes; ++m) {
      const std::size_t of = order[m];
      double decay = 0.0, reaction = 0.0;
      for (std::size_t j = 0; j < kModes; ++j) {
        const double part = find_part(bank.multipoles.mixing, of, j),
                     stretch = is_corrected ? bank.corrected.freq_hz[j] / bank.freq_hz(j) : 1.0;
        decay += part * part * (is_corrected ? bank.corrected.decay_per_s[j] : bank.decay_per_s[j]);
        reaction += part * bank.supports.reaction[12 * j + 2] * stretch * stretch;
      }
      EXPECT_NEAR(played.decay_per_s[m], decay + bank.multipoles.decay_per_s[of], 1e-9 * played.decay_per_s[m]);
      EXPECT_NEAR(played.supports.reaction[12 * m + 2], reaction, 1e-9 * std::abs(reaction));
      // Each mode moves less by the added mass; rigid motions explicitly, for a box along the mesh axes.
      for (const std::size_t vertex : {0U, 7U, 25U}) {
        Vec3 wanted{};
        for (std::size_t j = 0; j < kModes; ++j) wanted = wanted + find_part(bank.multipoles.mixing, of, j) * bank.shape_at(vertex, j);
        wanted[2] += find_part(bank.multipoles.mixing, of, kModes + 2) / std::sqrt(mass);
        const Vec3 arm = bank.vertices_m[vertex] - bank.rigid.centre_m;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          Vec3 about{};
          about[axis] = find_part(bank.multipoles.mixing, of, kModes + 3 + axis) / std::sqrt(bank.rigid.inertia_kg_m2[4 * axis]);
          wanted = wanted + cross(about, arm);
        }
        const Vec3 found = played.shape_at(vertex, m);
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(found[c], wanted[c], 0.51 * played.shape_scale[m]) << m << " " << vertex;
      }
    }
    // Idempotent.
    const Bank twice = choose_frequencies(played, frequencies);
    EXPECT_EQ(twice.shape, played.shape);
    EXPECT_EQ(twice.decay_per_s, played.decay_per_s);
  }
}

TEST(PlayedCoupled, OrderOfMeshAndCorrectionIsIrrelevant) {
  const Bank bank = make_coupled_bank();
  const Bank once = calc_corrected(bank), twice = calc_corrected(choose_frequencies(bank, Frequencies::kMesh));
  EXPECT_EQ(find_faults(choose_frequencies(bank, Frequencies::kMesh)), std::vector<std::string>{});
  EXPECT_EQ(once.eigenvalue_rad2_s2, twice.eigenvalue_rad2_s2);
  EXPECT_EQ(once.shape, twice.shape);
  for (std::size_t m = 0; m < kModes; ++m) EXPECT_NEAR(once.decay_per_s[m] / twice.decay_per_s[m], 1.0, 1e-12);
}

TEST(PlayedCoupled, NonlinearEnergyIsThatOfTheCorrectedSums) {
  constexpr double kFactor = 0.97;
  Bank bank = make_coupled_bank();
  select_modes(bank, sort_played_modes(bank));
  for (std::size_t m = 0; m < kModes; ++m) bank.corrected.freq_hz[m] = kFactor * bank.freq_hz(m);
  for (std::size_t m = 0; m < kModes; ++m) bank.quartic.modes.push_back(static_cast<std::int32_t>(m));
  for (std::size_t i = 0; i < 2 * count_pairs(kModes); ++i)
    bank.quartic.rows.push_back(static_cast<float>(1e6 * std::sin(0.7 * static_cast<double>(i * i))));
  const Bank played = calc_corrected(bank);
  // Modes lower by the factor c are softer by c^2, also in large motion; then the motion of the modes in air is that of the sums.
  std::vector<double> q(kModes), sums(kModes), none(kModes);
  for (std::size_t i = 0; i < kModes; ++i) q[i] = 1e-3 * std::cos(2.0 * static_cast<double>(i));
  for (std::size_t i = 0; i < kModes; ++i)
    for (std::size_t j = 0; j < kModes; ++j) sums[j] += find_part(bank.multipoles.mixing, i, j) * q[i];
  const double wanted = kFactor * kFactor * calc_energy_j(bank.quartic, sums, none);
  EXPECT_NEAR(calc_energy_j(played.quartic, q, none) / wanted, 1.0, 1e-5);
  // At the frequencies of the mesh the relative hardening is equal, and the way over them is lossless.
  const Bank mesh = choose_frequencies(bank, Frequencies::kMesh), twice = calc_corrected(mesh);
  const std::vector<double> in_air = calc_self_coupling(played.quartic), by_mesh = calc_self_coupling(mesh.quartic);
  for (std::size_t m = 0; m < kModes; ++m)
    EXPECT_NEAR(by_mesh[m] / in_air[m] * played.eigenvalue_rad2_s2[m] / mesh.eigenvalue_rad2_s2[m], 1.0, 1e-5) << m;
  EXPECT_NEAR(calc_energy_j(twice.quartic, q, none) / wanted, 1.0, 1e-5);
}

TEST(MixingEdits, SizeScalesCoupledModesAndStiffnessDropsThem) {
  const Bank bank = make_coupled_bank();
  const Bank large = calc_edited(bank, {.size_scale = 2.0});
  EXPECT_EQ(find_faults(large), std::vector<std::string>{});
  const Bank played = calc_corrected(bank), of_large = calc_corrected(large);
  EXPECT_EQ(of_large.shape, played.shape);
  for (std::size_t m = 0; m < kModes; ++m) EXPECT_NEAR(of_large.shape_scale[m] / played.shape_scale[m] * std::sqrt(8.0), 1.0, 1e-12);
  const Bank stiff = calc_edited(bank, {.stiffness_scale = 2.0});
  EXPECT_TRUE(stiff.multipoles.is_empty());
  EXPECT_EQ(calc_corrected(stiff).shape_scale[0], stiff.shape_scale[sort_played_modes(stiff)[0]]);
}

}  // namespace
}  // namespace carillon::bank
