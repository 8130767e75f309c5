// Error bars do not depend on the number of ranks.
#include <gtest/gtest.h>
#include <petscsys.h>

#include "tests/unit/precompute/fem/error_bars/bodies.hpp"

namespace carillon::tests {
namespace {

class SameBars : public testing::TestWithParam<Case> {};

TEST_P(SameBars, on_one_rank_and_on_all) {
  // Bodies without degenerate modes, whose shapes are unique. The cantilever's fixed nodes lie on a rank boundary too.
  const auto& [name, fineness, kind] = GetParam();
  const Outcome one = solve(PETSC_COMM_SELF, get_body(name), fineness, kind), all = solve(PETSC_COMM_WORLD, get_body(name), fineness, kind);
  ASSERT_EQ(one.freq_hz.size(), all.freq_hz.size());
  for (std::size_t m = 0; m < one.freq_hz.size(); ++m) {
    EXPECT_NEAR(all.bars.discretisation_cents[m] / one.bars.discretisation_cents[m], 1, 1e-3) << m;
    EXPECT_NEAR(all.bars.level.parts[m].interpolation / one.bars.level.parts[m].interpolation, 1, 1e-3) << m;
    EXPECT_NEAR(all.bars.level.parts[m].singular, one.bars.level.parts[m].singular, 1e-3 * one.bars.level.parts[m].interpolation) << m;
    EXPECT_NEAR(all.bars.corrected.lambda[m] / one.bars.corrected.lambda[m], 1, 1e-6) << m;
    EXPECT_NEAR(all.bars.corrected.cents[m] / one.bars.corrected.cents[m], 1, 1e-3) << m;
    EXPECT_EQ(all.bars.corrected.correction[m], one.bars.corrected.correction[m]) << m;
    EXPECT_NEAR(all.bars.level.parts[m].lumping, one.bars.level.parts[m].lumping, 1e-6) << m;
    EXPECT_NEAR(all.bars.level.parts[m].geometry, one.bars.level.parts[m].geometry, 1e-4 * one.bars.level.parts[m].geometry_noise + 1e-12)
        << m;
  }
}

INSTANTIATE_TEST_SUITE_P(ErrorBars, SameBars,
                         testing::Values(Case{"box", 5, MeshKind::T4Lumped}, Case{"cantilever", 2, MeshKind::T10},
                                         Case{"cantilever", 4, MeshKind::T4}));

}  // namespace
}  // namespace carillon::tests
