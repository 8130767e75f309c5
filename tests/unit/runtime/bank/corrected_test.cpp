// Banks played at their corrected frequencies; order of the modes.
#include "runtime/bank/corrected.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <numeric>
#include <string>

#include "runtime/bank/edits.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/select.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

constexpr std::size_t kModes = 9;

/// Frequency dependence of the gain of a pulsating sphere of the example's area (Pierce 1981, section 4.1), up to a constant.
double calc_sphere(double freq_hz) {
  const auto [a, b, c] = example::kSidesM;
  const double radius = std::sqrt((a * b + b * c + c * a) / (2 * std::numbers::pi));
  return freq_hz / std::hypot(1.0, 2 * std::numbers::pi * freq_hz / 343.0 * radius);
}

TEST(Corrected, ReadBackExactlyAndRaiseTheVersion) {
  const std::filesystem::path file = testing::TempDir() + "corrected.hdf";
  const Bank bank = example::make_corrected_bank(2, kModes);
  write_bank(bank, file);
  const Bank read = read_bank(file);
  EXPECT_EQ(read_version(file), (std::array<int, 2>{1, 4}));
  EXPECT_EQ(read.corrected.freq_hz, bank.corrected.freq_hz);
  EXPECT_EQ(read.corrected.decay_per_s, bank.corrected.decay_per_s);
  EXPECT_EQ(read.corrected.error_cents, bank.corrected.error_cents);
  EXPECT_EQ(read.corrected.correction, bank.corrected.correction);
}

TEST(Facets, InDoubtReadBackRaiseTheVersionAndFollowTheirModes) {
  const std::filesystem::path file = testing::TempDir() + "facets.hdf";
  Bank bank = example::make_corrected_bank(2, kModes);
  for (std::size_t m = 0; m < kModes; ++m) bank.facet_error_cents.push_back(10.0 * static_cast<double>(m + 1));
  write_bank(bank, file);
  EXPECT_EQ(read_version(file), (std::array<int, 2>{1, 8}));
  EXPECT_EQ(read_bank(file).facet_error_cents, bank.facet_error_cents);
  EXPECT_EQ(read_bank(file).corrected.error_cents, bank.corrected.error_cents);
  EXPECT_NE(describe_accuracy(bank).find("; facets in doubt: 90 cent more"), std::string::npos) << describe_accuracy(bank);
  const Bank played = calc_corrected(bank);
  for (std::size_t m = 0; m < kModes; ++m)
    EXPECT_EQ(played.facet_error_cents[m], 10.0 * (played.discretisation_error_cents[m] - 0.25 + 1.0)) << m;
  Bank lowest = bank;
  keep_lowest(lowest, 3);
  EXPECT_EQ(lowest.facet_error_cents.size(), 3U);
  EXPECT_EQ(find_version(bank, true), (std::array<int, 2>{2, 4}));
  bank.facet_error_cents.clear();
  EXPECT_EQ(find_version(bank), (std::array<int, 2>{1, 4})) << "as it was written before";
  EXPECT_TRUE(describe_facets(bank).empty());
}

TEST(Corrected, AreAscendingAndModesKeepTheirArrays) {
  const Bank bank = example::make_corrected_bank(2, kModes), played = calc_corrected(bank);
  EXPECT_EQ(find_faults(played), std::vector<std::string>{});
  ASSERT_EQ(played.mode_count(), kModes);
  bool has_moved = false;
  for (std::size_t m = 0; m < kModes; ++m) {
    const std::size_t of =
        std::min_element(bank.corrected.freq_hz.begin(), bank.corrected.freq_hz.end(),
                         [&](double a, double b) { return std::abs(a - played.freq_hz(m)) < std::abs(b - played.freq_hz(m)); }) -
        bank.corrected.freq_hz.begin();
    has_moved = has_moved || of != m;
    EXPECT_NEAR(played.freq_hz(m) / bank.corrected.freq_hz[of], 1.0, 1e-14);
    EXPECT_EQ(played.decay_per_s[m], bank.corrected.decay_per_s[of]);
    EXPECT_NEAR(played.radiation_gain[m] / bank.radiation_gain[of], calc_sphere(played.freq_hz(m)) / calc_sphere(bank.freq_hz(of)), 1e-12);
    EXPECT_EQ(played.discretisation_error_cents[m], bank.corrected.error_cents[of]);
    for (const std::size_t vertex : {0U, 7U, 25U}) EXPECT_EQ(played.shape_at(vertex, m), bank.shape_at(vertex, of));
  }
  EXPECT_TRUE(has_moved) << "the example has modes that change places";
  EXPECT_FALSE(played.proof.has_value()) << "it is about the mesh";
}

TEST(Corrected, KeepReactionsPerAcceleration) {
  Bank bank = example::make_corrected_bank(2, kModes);
  bank.supports = example::make_supported_bank(2, kModes).supports;
  const Bank played = calc_corrected(bank);
  EXPECT_EQ(find_faults(played), std::vector<std::string>{});
  const std::vector<std::size_t> of = sort_modes(bank);
  for (std::size_t m = 0; m < kModes; ++m) {
    for (std::size_t i = 0; i < 12; ++i) {
      const double before = bank.supports.reaction[of[m] * 12 + i] / bank.eigenvalue_rad2_s2[of[m]];
      EXPECT_NEAR(played.supports.reaction[m * 12 + i] / played.eigenvalue_rad2_s2[m] / before, 1.0, 1e-12);
    }
    for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(played.supports.energy[2 * m + i], bank.supports.energy[2 * of[m] + i]);
  }
}

TEST(Corrected, AbsentLeaveTheBankUnchanged) {
  const Bank bank = example::make_bank(2, 5), played = calc_corrected(bank);
  EXPECT_EQ(played.eigenvalue_rad2_s2, bank.eigenvalue_rad2_s2);
  EXPECT_EQ(played.decay_per_s, bank.decay_per_s);
  EXPECT_TRUE(played.proof.has_value());
  const Bank mesh = choose_frequencies(example::make_corrected_bank(2, 5), Frequencies::kMesh);
  EXPECT_EQ(mesh.eigenvalue_rad2_s2, example::make_corrected_bank(2, 5).eigenvalue_rad2_s2);
}

TEST(Corrected, DetermineTheLowestModes) {
  const Bank bank = example::make_corrected_bank(2, kModes);
  for (std::size_t count = 1; count < kModes; ++count) {
    Bank kept = bank;
    keep_lowest(kept, count);
    EXPECT_EQ(find_faults(kept), std::vector<std::string>{}) << count;
    ASSERT_EQ(kept.mode_count(), count);
    std::vector<double> all = bank.corrected.freq_hz, here = kept.corrected.freq_hz;
    std::sort(all.begin(), all.end());
    std::sort(here.begin(), here.end());
    EXPECT_TRUE(std::equal(here.begin(), here.end(), all.begin())) << count;
    // All modes of the mesh below the bound are present, and the next one is not.
    const double bound = kept.proof->complete_below_hz;
    const auto count_below = [&](const Bank& of) {
      return std::count_if(of.eigenvalue_rad2_s2.begin(), of.eigenvalue_rad2_s2.end(),
                           [&](double lambda) { return lambda < std::pow(2 * 3.14159265358979323846 * bound, 2) * (1 - 1e-12); });
    };
    if (bound > 0.0) {
      EXPECT_EQ(count_below(kept), count_below(bank)) << count;
    }
    const std::filesystem::path file = testing::TempDir() + "lowest.hdf";
    write_bank(kept, file);
    EXPECT_EQ(read_bank(file).proof->complete_below_hz, bound);
  }
}

TEST(Corrected, SelectTheBand) {
  const Bank bank = example::make_corrected_bank(2, kModes);
  std::vector<double> ends = bank.corrected.freq_hz;
  std::sort(ends.begin(), ends.end());
  int cut_across = 0;
  for (std::size_t count = 1; count < kModes; ++count) {
    Bank kept = bank;
    kept.band_hz[1] = std::midpoint(ends[count - 1], ends[count]);
    keep_band(kept);
    EXPECT_TRUE(kept.complete);
    EXPECT_EQ(find_faults(kept), std::vector<std::string>{}) << count;
    std::vector<double> here = kept.corrected.freq_hz;
    std::sort(here.begin(), here.end());
    EXPECT_EQ(here, std::vector<double>(ends.begin(), ends.begin() + static_cast<std::ptrdiff_t>(count)));
    const bool is_across = kept.proof->complete_below_hz > 0.0;
    cut_across += is_across ? 1 : 0;
    EXPECT_EQ(kept.proof->found, static_cast<std::int64_t>(is_across ? kModes : count)) << "the proof ends with the list, if it can";
    EXPECT_GE(kept.proof->cut_hz.back(), kept.band_hz[1]);
    const bool is_new = is_across || kept.freq_hz(count - 1) > kept.band_hz[1];
    EXPECT_EQ(find_version(kept), (is_new ? std::array{1, 9} : std::array{1, 4})) << count;
    Bank spoiled = kept;  // a mode below the end of the proof is missing
    std::vector<std::size_t> others;
    for (std::size_t m = 1; m < count; ++m) others.push_back(m);
    select_modes(spoiled, others);
    EXPECT_FALSE(find_faults(spoiled).empty()) << count;
  }
  EXPECT_GT(cut_across, 0) << "the example has modes that change places";
  EXPECT_LT(cut_across, static_cast<int>(kModes) - 1);
}

TEST(Corrected, SelectTheBandAtBothEnds) {
  const Bank bank = example::make_corrected_bank(2, kModes);
  std::vector<double> ends = bank.corrected.freq_hz;
  std::sort(ends.begin(), ends.end());
  int inside = 0;
  for (std::size_t first = 1; first < kModes; ++first) {
    for (std::size_t end = first; end <= kModes; ++end) {
      Bank kept = bank;
      kept.band_hz = {std::midpoint(ends[first - 1], ends[first]),
                      end < kModes ? std::midpoint(ends[end - 1], ends[end]) : bank.band_hz[1]};
      if (kept.band_hz[0] >= kept.band_hz[1]) continue;
      keep_band(kept);
      EXPECT_EQ(find_faults(kept), std::vector<std::string>{}) << first << " to " << end;
      std::vector<double> here = kept.corrected.freq_hz;
      std::sort(here.begin(), here.end());
      EXPECT_EQ(here,
                std::vector<double>(ends.begin() + static_cast<std::ptrdiff_t>(first), ends.begin() + static_cast<std::ptrdiff_t>(end)));
      EXPECT_EQ(kept.proof->below_band_hz.size(), first);
      EXPECT_EQ(find_version(kept), (std::array{1, 9})) << "older readers would miss modes";
      for (const double hz : kept.proof->below_band_hz) inside += hz > kept.band_hz[0] ? 1 : 0;
      const std::filesystem::path file = testing::TempDir() + "band.hdf";
      write_bank(kept, file);
      EXPECT_EQ(read_bank(file).proof->below_band_hz, kept.proof->below_band_hz);
      Edits edits;
      edits.stiffness_scale = 4.0;
      EXPECT_EQ(find_faults(calc_edited(kept, edits)), std::vector<std::string>{});
      kept.proof->below_band_hz.erase(kept.proof->below_band_hz.begin());  // a mode below the band is missing
      EXPECT_FALSE(find_faults(kept).empty()) << first << " to " << end;
    }
  }
  EXPECT_GT(inside, 0) << "modes of the mesh in the band are below it once corrected";
}

TEST(Corrected, TruncationIsIdempotent) {
  const Bank bank = example::make_corrected_bank(2, kModes);
  for (std::size_t first = 2; first < kModes; ++first) {
    for (std::size_t second = 1; second < first; ++second) {
      Bank twice = bank, once = bank;
      keep_lowest(twice, first);
      keep_lowest(twice, second);
      keep_lowest(once, second);
      EXPECT_EQ(find_faults(twice), std::vector<std::string>{}) << first << ", then " << second;
      EXPECT_EQ(twice.eigenvalue_rad2_s2, once.eigenvalue_rad2_s2) << first << ", then " << second;
      EXPECT_TRUE(once.proof->complete_below_hz == 0.0 || twice.proof->complete_below_hz <= once.proof->complete_below_hz)
          << first << ", then " << second;
    }
  }
}

TEST(Corrected, AMissingModeBelowTheBoundIsAFault) {
  Bank kept = example::make_corrected_bank(2, kModes);
  keep_lowest(kept, 5);
  ASSERT_GT(kept.proof->complete_below_hz, 0.0);
  kept.proof->complete_below_hz = kept.band_hz[1];
  const auto faults = find_faults(kept);
  ASSERT_FALSE(faults.empty());
  EXPECT_NE(faults[0].find("by the counts, and the bank holds"), std::string::npos) << faults[0];
}

TEST(Corrected, FollowEdits) {
  const Bank bank = example::make_corrected_bank(2, kModes);
  Edits edits;
  edits.stiffness_scale = 4.0;
  const Bank edited = calc_edited(bank, edits);
  EXPECT_EQ(find_faults(edited), std::vector<std::string>{});
  for (std::size_t m = 0; m < kModes; ++m) EXPECT_NEAR(edited.corrected.freq_hz[m] / bank.corrected.freq_hz[m], 2.0, 1e-12);
}

}  // namespace
}  // namespace carillon::bank
