#include "runtime/bank/reduce.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

TEST(Reduce, TheLowestModesKeepTheProof) {
  const Bank bank = example::make_bank(2, 9);
  const Bank reduced = calc_reduced(bank, {.modes = 4, .keep = Keep::kLowest});
  EXPECT_EQ(find_faults(reduced), std::vector<std::string>{});
  EXPECT_FALSE(reduced.complete);
  ASSERT_TRUE(reduced.proof.has_value());
  EXPECT_EQ(reduced.proof->found, 9);
  ASSERT_EQ(reduced.mode_count(), 4u);
  for (std::size_t m = 0; m < 4; ++m) {
    EXPECT_EQ(reduced.eigenvalue_rad2_s2[m], bank.eigenvalue_rad2_s2[m]);
    EXPECT_EQ(reduced.discretisation_error_cents[m], bank.discretisation_error_cents[m]);
    for (const std::size_t vertex : {0u, 7u, 25u}) EXPECT_EQ(reduced.shape_at(vertex, m), bank.shape_at(vertex, m));
  }
  EXPECT_NE(describe_completeness(reduced).find("the lowest 4 of 9 modes"), std::string::npos);
  EXPECT_NE(reduced.provenance.find(R"("keep": "lowest")"), std::string::npos);
}

TEST(Reduce, ModesKeepTheirReactions) {
  const Bank bank = example::make_supported_bank(2, 9);
  const Bank reduced = calc_reduced(bank, {.modes = 3, .keep = Keep::kLoudest});
  EXPECT_EQ(find_faults(reduced), std::vector<std::string>{});
  for (std::size_t m = 0; m < 3; ++m) {
    std::size_t of = 0;
    while (bank.eigenvalue_rad2_s2[of] != reduced.eigenvalue_rad2_s2[m]) ++of;
    for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(reduced.supports.reaction[12 * m + i], bank.supports.reaction[12 * of + i]);
    for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(reduced.supports.energy[2 * m + i], bank.supports.energy[2 * of + i]);
  }
}

TEST(Reduce, DegenerateGroupsAreTruncatedWithTheList) {
  Bank bank = example::make_bank(2, 6);
  for (const std::size_t first : {0u, 3u})
    bank.eigenvalue_rad2_s2[first + 1] = bank.eigenvalue_rad2_s2[first + 2] = bank.eigenvalue_rad2_s2[first];
  bank.proof->cluster_first = {0, 3};
  bank.proof->cluster_count = {3, 3};
  const Bank five = calc_reduced(bank, {.modes = 5, .keep = Keep::kLowest}), four = calc_reduced(bank, {.modes = 4, .keep = Keep::kLowest});
  EXPECT_EQ(five.proof->cluster_count, (std::vector<std::int64_t>{3, 2}));
  EXPECT_EQ(four.proof->cluster_count, (std::vector<std::int64_t>{3}));
}

// Mean square of a mode over the surface and its exposure, by explicit sums over the triangles.
TEST(Reduce, TheLoudestModesHaveTheGreatestExposure) {
  const Bank bank = example::make_bank(3, 12);
  const std::vector<double> audibility = calc_audibility(bank);
  ASSERT_EQ(audibility.size(), 12u);
  for (const std::size_t m : {0u, 5u, 11u}) {
    double sum = 0.0, area = 0.0;
    for (const auto& t : bank.triangles) {
      const Vec3 &a = bank.vertices_m[t[0]], &b = bank.vertices_m[t[1]], &c = bank.vertices_m[t[2]];
      Vec3 u{}, v{};
      for (std::size_t k = 0; k < 3; ++k) u[k] = b[k] - a[k], v[k] = c[k] - a[k];
      const Vec3 n{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
      const double twice = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
      for (const std::int32_t corner : t) {
        const Vec3 phi = bank.shape_at(corner, m);
        sum += std::pow(phi[0] * n[0] + phi[1] * n[1] + phi[2] * n[2], 2) / twice / 3.0;
      }
      area += twice;
    }
    // Exposure by quadrature of p(t)^2 e^(-t / 0.2 s) over whole periods: half of that of the envelope. Spectrum of a Gaussian pulse with
    // the variance of sin^1.5 over 0.1 ms, by quadrature: exp(-(omega sigma)^2 / 2).
    double weight = 0.0, second = 0.0;
    for (int n = 0; n < 10000; ++n) {
      const double x = (n + 0.5) / 10000.0, force = std::pow(std::sin(3.14159265358979 * x), 1.5);
      weight += force;
      second += force * (x - 0.5) * (x - 0.5);
    }
    const double sigma_s = 1e-4 * std::sqrt(second / weight), omega = std::sqrt(bank.eigenvalue_rad2_s2[m]);
    const double pressure = calc_a_weight(bank.freq_hz(m)) * bank.radiation_gain[m] * std::exp(-0.5 * omega * omega * sigma_s * sigma_s);
    double exposure = 0.0;
    constexpr double kStep = 1e-4;
    for (int n = 0; n < 20000; ++n) exposure += 0.5 * std::exp(-(2.0 * bank.decay_per_s[m] + 5.0) * (n + 0.5) * kStep) * kStep;
    EXPECT_NEAR(audibility[m] / (pressure * pressure * sum / area * exposure), 1.0, 2e-3) << m;
  }
  const Bank reduced = calc_reduced(bank, {.modes = 3});
  EXPECT_EQ(find_faults(reduced), std::vector<std::string>{});
  EXPECT_FALSE(reduced.complete);
  EXPECT_FALSE(reduced.proof.has_value());
  double min = 1e300, largest = 0.0;
  for (std::size_t m = 0; m < 12; ++m) {
    bool kept = false;
    for (const double lambda : reduced.eigenvalue_rad2_s2) kept = kept || lambda == bank.eigenvalue_rad2_s2[m];
    if (kept) min = std::min(min, audibility[m]);
    if (!kept) largest = std::max(largest, audibility[m]);
  }
  EXPECT_GT(min, largest);
}

TEST(Reduce, ShapesAreRoundedAndStoredInOneByte) {
  const Bank bank = example::make_bank(3, 5);
  for (const int bits : {2, 6, 8, 12, 16}) {
    const Bank reduced = calc_reduced(bank, {.shape_bits = bits});
    EXPECT_EQ(find_faults(reduced), std::vector<std::string>{});
    EXPECT_TRUE(reduced.complete && reduced.proof.has_value());
    const double half = 0.5 * 32767.0 / ((1 << (bits - 1)) - 1);  // half a coarse step, in fine ones
    for (std::size_t v = 0; v < bank.vertex_count(); ++v) {
      for (std::size_t m = 0; m < bank.mode_count(); ++m) {
        const Vec3 fine = bank.shape_at(v, m), coarse = reduced.shape_at(v, m);
        for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(coarse[k], fine[k], 1.001 * half * bank.shape_scale[m]);
      }
    }
    const std::filesystem::path file = std::filesystem::path(testing::TempDir()) / ("reduced_" + std::to_string(bits) + ".hdf");
    write_bank(reduced, file);
    const Bank read = read_bank(file);
    EXPECT_EQ(read.shape, reduced.shape);
    EXPECT_EQ(read.shape_bytes, bits <= 8 ? 1 : 2);
    EXPECT_EQ(read_version(file), (std::array{1, bits <= 8 ? 2 : 1}));
    std::filesystem::remove(file);
  }
}

TEST(Reduce, InvalidRequestsAreRejected) {
  const Bank bank = example::make_bank(2, 5);
  EXPECT_THROW(calc_reduced(bank, {.modes = 0}), InputError);
  for (const int bits : {-1, 0, 1, 17}) EXPECT_THROW(calc_reduced(bank, {.shape_bits = bits}), InputError);
  const Bank whole = calc_reduced(bank, {.modes = 5000});
  EXPECT_TRUE(whole.complete && whole.proof.has_value());
  EXPECT_EQ(whole.shape, bank.shape);
  Bank wide = bank;
  wide.shape_bytes = 1;  // shapes reach 32767
  ASSERT_FALSE(find_faults(wide).empty());
  EXPECT_NE(find_faults(wide)[0].find("one byte"), std::string::npos);
  EXPECT_EQ(calc_reduced(example::make_bank(2, 0), {.modes = 3, .shape_bits = 8}).mode_count(), 0u);
}

}  // namespace
}  // namespace carillon::bank
