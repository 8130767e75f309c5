// Supports from the job to the losses: a cantilever against beam theory, and the job's entries in the bank.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "precompute/mesh/shapes/shapes.hpp"
#include "runtime/bank/mounting/losses.hpp"
#include "tests/system/path/run_program.hpp"

namespace carillon::tests {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
const MaterialText kSteel{200e9, 0.0, 7850};  // Poisson's ratio 0, so that the fixed end of a beam stays plane
constexpr double kLength = 0.3, kWidth = 0.012, kHeight = 0.01;

void write_bar(const JobFolder& folder) {
  mesh::write_gmsh(shapes::make_box({kLength, kWidth, kHeight}, {30, 1, 1}, 2), folder / "mesh.msh");
}

double dot(const double* r, int count) {
  double sum = 0.0;
  for (int k = 0; k < count; ++k) sum += r[k] * r[k];
  return std::sqrt(sum);
}

TEST(Cantilever, pulls_at_its_fixed_end_as_beam_theory_says) {
  // Clamped-free beam: modal force lambda sqrt(0.6131 M), couple lambda 0.5688 L sqrt(M) (integrals of phi and x phi).
  JobFolder folder;
  write_bar(folder);
  folder.write_job(kSteel, R"("fixed": {"node_set": "x-min", "on": "brick wall", "joint": "screwed"}, "band_hz": [20, 3000],)");
  const bank::Bank bank = folder.solve();
  ASSERT_GE(bank.mode_count(), 2U);
  ASSERT_EQ(bank.supports.count(), 1U);
  const double mass = bank.rigid.mass_kg;
  for (int m = 0; m < 2; ++m) {  // bending in both directions
    const double lambda = bank.eigenvalue_rad2_s2[m];
    const double* r = &bank.supports.reaction[6 * m];
    EXPECT_NEAR(dot(r, 3) / (lambda * std::sqrt(0.6131 * mass)), 1, 0.005);
    EXPECT_NEAR(dot(r + 3, 3) / (lambda * 0.5688 * kLength * std::sqrt(mass)), 1, 0.005);
    EXPECT_NEAR(std::abs(r[0]) / dot(r, 3), 0, 1e-3) << "bending does not pull along the bar";
    // The strain energy density decreases from the fixed end with the square of the moment: within h of L, 1 - (1 - h / L)^k at first.
    EXPECT_NEAR(bank.supports.energy[m], 4.6 * kHeight / kLength, 0.25 * 4.6 * kHeight / kLength);
  }
  EXPECT_NEAR(bank.supports.area_m2[0], kWidth * kHeight, 1e-12);
  EXPECT_NEAR(bank.supports.thickness_m[0], kHeight, 1e-9);
  EXPECT_NEAR(bank.supports.normal[0][0], -1, 1e-12);
  EXPECT_THAT(mounting::list_names(bank), ElementsAre("x-min"));
  const mounting::Losses losses = mounting::calc_losses(bank, {});
  EXPECT_THAT(losses.supports, ElementsAre("x-min on brick wall, screwed"));
  EXPECT_GT(losses.decay_per_s[0], 0.0);
}

TEST(Cantilever, has_the_same_supports_on_two_ranks_and_by_its_own_record) {
  JobFolder folder;
  write_bar(folder);
  folder.write_job(kSteel, R"("fixed": [{"node_set": "x-min", "name": "left", "loss": 0.03}, "x-max"], "band_hz": [20, 3000],)");
  const bank::Bank one = folder.solve(1), two = folder.solve(2);
  EXPECT_THAT(mounting::list_names(one), ElementsAre("left", "x-max"));
  EXPECT_EQ(one.supports.text, two.supports.text);
  ASSERT_EQ(one.supports.reaction.size(), two.supports.reaction.size());
  for (std::size_t m = 0; m < one.mode_count(); ++m) {
    // Signs of modes are canonical; two modes of a nearly square bar are far apart here.
    for (std::size_t k = 0; k < 12; ++k) {
      const std::size_t i = 12 * m + k;
      EXPECT_NEAR(one.supports.reaction[i], two.supports.reaction[i], 1e-5 * dot(&one.supports.reaction[12 * m], 12)) << m << " " << k;
    }
  }
  EXPECT_EQ(bank::read_version(folder / "out.bank"), (std::array<int, 2>{1, 4}));
  // The provenance is a job that reproduces the result.
  EXPECT_THAT(read_all(folder / "out.bank.resolved.json"), HasSubstr("\"left\""));
  const bank::Bank again = folder.solve(1, "out.bank.resolved.json");
  EXPECT_EQ(again.supports.text, one.supports.text);
}

TEST(Cantilever, fixed_by_a_box_has_a_support_of_that_name) {
  JobFolder folder;
  write_bar(folder);
  folder.write_job(kSteel, R"("fixed": {"box_m": {"min": [0, 0, 0], "max": [0, 1, 1]}}, "band_hz": [20, 1000],)");
  EXPECT_THAT(mounting::list_names(folder.solve()), ElementsAre("box 1"));
}

TEST(FreeBody, has_a_bank_without_supports) {
  JobFolder folder;
  write_bar(folder);
  folder.write_job(kSteel, R"("band_hz": [20, 3000],)");
  const bank::Bank bank = folder.solve();
  EXPECT_EQ(bank.supports.count(), 0U);
  EXPECT_EQ(bank::read_version(folder / "out.bank"), (std::array<int, 2>{1, 4}));
}

TEST(BadSupport, is_refused_with_its_line_and_a_correction) {
  JobFolder folder;
  write_bar(folder);
  folder.write_job(kSteel, "\n\"fixed\": {\"node_set\": \"x-min\", \"on\": \"brck wall\"},");
  const Outcome outcome = folder.run();
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.output, HasSubstr("job.json:2"));
  EXPECT_THAT(outcome.output, HasSubstr("did you mean \"brick wall\"?"));
}

}  // namespace
}  // namespace carillon::tests
