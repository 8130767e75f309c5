// Corrected frequencies: accuracy, coverage of their bars, and rejection of unreliable estimates.
#include "precompute/fem/error_bars/correct.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "precompute/petsc/session.hpp"
#include "tests/unit/precompute/fem/error_bars/bodies.hpp"

namespace carillon::tests {
namespace {

using bank::Correction;
using error_bars::ErrorParts;
using error_bars::Kind;
using error_bars::Level;

/// A body, its mesh, and the maximum ratio of the median errors of corrected and mesh frequencies.
struct Corrects {
  Case body;
  double ratio;
};
void PrintTo(const Corrects& c, std::ostream* out) { PrintTo(c.body, out); }

class Corrected : public testing::TestWithParam<Corrects> {};

TEST_P(Corrected, frequencies_are_nearer_to_the_truth_and_within_their_bars) {
  const auto& [name, fineness, kind] = GetParam().body;
  const Outcome outcome = solve(PETSC_COMM_WORLD, get_body(name), fineness, kind);
  EXPECT_LT(outcome.median_corrected_error_cents(), GetParam().ratio * outcome.median_error_cents());
  int good = 0;
  double bars = 0, corrected_bars = 0;
  for (std::size_t m = 0; m < outcome.true_hz.size(); ++m) {
    good += outcome.corrected_contains(m) ? 1 : 0;
    bars += outcome.bar_cents(m);
    corrected_bars += outcome.corrected_bar_cents(m);
  }
  EXPECT_GE(good, 0.97 * static_cast<double>(outcome.true_hz.size()));
  EXPECT_LT(corrected_bars, (outcome.bars.level.is_lumped ? 0.85 : outcome.bars.level.kind == Kind::kT10 ? 0.6 : 0.75) * bars);
}

INSTANTIATE_TEST_SUITE_P(
    Bodies, Corrected,
    testing::Values(Corrects{{"bar", 2, MeshKind::T10}, 0.125}, Corrects{{"plate", -1, MeshKind::T10}, 0.125},
                    Corrects{{"strip-thin", 41, MeshKind::T10}, 0.25}, Corrects{{"ball", 1200, MeshKind::T10Curved}, 0.125},
                    Corrects{{"rubber-ball", 1200, MeshKind::T10Curved}, 0.2}, Corrects{{"cube", 6, MeshKind::T4}, 0.167},
                    Corrects{{"ball", 1200, MeshKind::T4}, 0.167}, Corrects{{"ring", 6000, MeshKind::T4}, 0.2},
                    Corrects{{"thin-shell", 3000, MeshKind::T4Lumped}, 0.5}, Corrects{{"ring", 6000, MeshKind::T4Lumped}, 0.5},
                    // Bodies added after the formulas were fixed.
                    Corrects{{"tile", -1, MeshKind::T10}, 0.125}, Corrects{{"maple-plate", -1, MeshKind::T10}, 0.125},
                    Corrects{{"reed", 41, MeshKind::T10}, 0.25}, Corrects{{"stick", 2, MeshKind::T10}, 0.125},
                    Corrects{{"shell-85", 2400, MeshKind::T10Curved}, 0.125}, Corrects{{"brick", 8, MeshKind::T4}, 0.167},
                    Corrects{{"collar", 2400, MeshKind::T10Curved}, 0.25}, Corrects{{"washer", 800, MeshKind::T10}, 0.2},
                    Corrects{{"cone", 2500, MeshKind::T10Curved}, 0.3}, Corrects{{"shell-60", 500, MeshKind::T10Curved}, 0.25},
                    Corrects{{"board", -1, MeshKind::T10}, 0.125}));

/// Curved elements as wide as the wall: recovered strains miss most of their error.
TEST(Corrected, frequencies_of_walls_in_wide_curved_elements_are_within_their_bars) {
  for (const auto& [name, nodes] : {std::pair{"chime", 500}, std::pair{"collar", 300}, std::pair{"shell-95", 700}}) {
    const Outcome outcome = solve(PETSC_COMM_WORLD, get_body(name), nodes, MeshKind::T10Curved);
    ASSERT_FALSE(outcome.true_hz.empty()) << name;
    int good = 0;
    double largest = 0;
    for (std::size_t m = 0; m < outcome.true_hz.size(); ++m) {
      good += outcome.corrected_contains(m) && outcome.contains(m) ? 1 : 0;
      largest = std::max(largest, std::abs(outcome.error_cents(m)));
    }
    EXPECT_GE(good, 0.97 * static_cast<double>(outcome.true_hz.size())) << name;
    EXPECT_GT(largest, 300) << name << ": no longer a hard mesh";
  }
}

TEST(Bars, grow_with_how_far_elements_bend_of_T10_only) {
  ErrorParts flat, bent;
  flat.interpolation = bent.interpolation = 0.05;
  bent.bent = 0.01;
  EXPECT_EQ(error_bars::calc_cents(flat, Kind::kT4), error_bars::calc_cents(bent, Kind::kT4));
  EXPECT_NEAR(error_bars::calc_cents(bent, Kind::kT10Curved), 600 * std::log2(1 + 3.5 * 0.09 / 0.91), 1e-9);
  EXPECT_NEAR(error_bars::calc_share_left(bent, Kind::kT10Curved, false), 1 / 1.09, 1e-12);
  EXPECT_NEAR(error_bars::predict_parts(bent, Kind::kT10Curved, 4, 0.5).bent, 0.01 / 64, 1e-15);
}

TEST(Parts, at_singular_edges_fall_with_their_own_order) {
  ErrorParts parts;
  parts.interpolation = 0.05;
  parts.singular = 0.02;
  const ErrorParts then = error_bars::predict_parts(parts, Kind::kT10, 4, 0.125);
  EXPECT_NEAR(then.singular, 0.02 / 16, 1e-15);
  EXPECT_NEAR(then.interpolation, 0.03 / 4096 + 0.02 / 16, 1e-15);
}

/// A synthetic level of modes.
Level make_level(const std::vector<double>& hz, const std::vector<double>& interpolation, Kind kind = Kind::kT10) {
  Level level;
  level.kind = kind;
  for (std::size_t m = 0; m < hz.size(); ++m) {
    level.lambda.push_back(std::pow(2 * M_PI * hz[m], 2));
    ErrorParts parts;
    parts.interpolation = interpolation[m];
    parts.energy = 1.0;
    level.parts.push_back(parts);
  }
  level.unlisted.high_hz = 10 * hz.back();
  return level;
}

TEST(Correction, is_refused_to_what_the_elements_cannot_follow) {
  const auto find = [](const Level& level) { return error_bars::calc_corrections(level).correction; };
  EXPECT_EQ(find(make_level({100, 200, 300}, {0.01, 0.4, 0.7})),
            (std::vector{Correction::kOneMesh, Correction::kRough, Correction::kStiff}));
  EXPECT_EQ(find(make_level({100, 200, 300}, {0.3, 0.7, 1.1}, Kind::kT4)),
            (std::vector{Correction::kOneMesh, Correction::kRough, Correction::kStiff}));
  Level lumped = make_level({100}, {0.01});
  lumped.is_lumped = true;
  EXPECT_EQ(find(lumped), (std::vector{Correction::kLumped}));
  for (const Kind kind : {Kind::kT10, Kind::kT4}) {
    Level kink = make_level({100, 200}, {0.01, 0.01}, kind);
    kink.parts[1].singular = 0.005;
    EXPECT_EQ(find(kink)[1], kind == Kind::kT4 ? Correction::kRough : Correction::kOneMesh) << "an inward edge";
    kink.has_rims = true;
    EXPECT_EQ(find(kink), (std::vector{Correction::kOneMesh, Correction::kRough}));
  }
  const error_bars::Corrections refused = error_bars::calc_corrections(make_level({300}, {0.7}));
  EXPECT_EQ(refused.lambda[0], make_level({300}, {0.7}).lambda[0]) << "the mesh's own value is kept";
}

TEST(Correction, of_a_mode_that_is_not_corrected_to_half_its_bar_leaves_the_meshs_interval) {
  // A rough mode keeps the interval below the mesh's frequency.
  const Level level = make_level({1000}, {0.45});
  const double all = error_bars::calc_cents(level.parts[0], level.kind);
  const error_bars::Corrections rough = error_bars::calc_corrections(level);
  const double stated = 600 * std::log2(rough.lambda[0] / level.lambda[0]);
  EXPECT_NEAR(rough.cents[0], std::max(stated + all, -stated), 1e-9);
}

TEST(Correction, of_T4_is_rough_where_other_modes_may_take_the_place_of_the_mode) {
  // The third is bending on one layer, octaves too high: the first of the body may be far below the first of the list.
  const std::vector<double> hz{1000, 2000, 2100};
  const error_bars::Corrections t4 = error_bars::calc_corrections(make_level(hz, {0.01, 0.01, 1.2}, Kind::kT4));
  EXPECT_EQ(t4.correction, (std::vector{Correction::kRough, Correction::kRough, Correction::kStiff}));
  EXPECT_GT(std::min(t4.cents[0], t4.cents[1]), 1190);
  const error_bars::Corrections apart = error_bars::calc_corrections(make_level({1000, 2000}, {0.01, 0.01}, Kind::kT4));
  EXPECT_EQ(apart.correction, std::vector(2, Correction::kOneMesh));
  EXPECT_EQ(apart.lambda[1], t4.lambda[1]);
}

TEST(Facets, in_doubt_are_no_part_of_any_bar_and_are_stated_next_to_it) {
  Level sure = make_level({1000, 1020, 2500}, {0.01, 0.02, 0.45}), level = sure;
  level.parts[0].doubt = -0.02;
  level.parts[1].doubt = 0.1;
  level.parts[1].doubt_noise = 0.2;
  const error_bars::Corrections alone = error_bars::calc_corrections(sure), both = error_bars::calc_corrections(level);
  EXPECT_EQ(both.cents, alone.cents);
  EXPECT_EQ(both.lambda, alone.lambda);
  EXPECT_TRUE(alone.facet_cents.empty());
  ASSERT_EQ(both.facet_cents.size(), 3U);
  // Interval of the other body's k-th mode: modes shifted by their own facets, then sorted.
  std::vector<double> low, high;
  for (std::size_t m = 0; m < 2; ++m) {
    const double facets = 600 * std::log2(1 + (m == 0 ? 1.5 * 0.02 : 1.5 * 0.1 + 0.15 * 0.2));
    const double at = 600 * std::log2(alone.lambda[m]), bar = error_bars::calc_cents(level.parts[m], level.kind) / 2;
    EXPECT_NEAR(error_bars::calc_facet_cents(level.parts[m]), facets, 1e-9);
    low.push_back(at - bar - facets);
    high.push_back(at + bar + facets);
  }
  std::sort(low.begin(), low.end());
  std::sort(high.begin(), high.end());
  for (std::size_t k = 0; k < 2; ++k) {
    const double at = 600 * std::log2(alone.lambda[k]), reach = alone.cents[k] + both.facet_cents[k] + 1e-9;
    EXPECT_LE(at - reach, low[k]) << k;
    EXPECT_GE(at + reach, high[k]) << k;
  }
  EXPECT_LT(both.facet_cents[2], 1e-9) << "the third is far from the others";
}

TEST(TwoMeshes, that_agree_shorten_the_bar_to_an_eighth) {
  // The truth is 1000 Hz; the error is the estimate, sixteen times as large on the coarser mesh.
  const auto sharp = [](double i) { return 1000 * std::sqrt(1 + i); };
  const Level fine = make_level({sharp(0.01)}, {0.01}), coarse = make_level({sharp(0.16)}, {0.16});
  const error_bars::Corrections alone = error_bars::calc_corrections(fine),
                                both = error_bars::calc_corrections(fine, std::span(&coarse, 1));
  EXPECT_EQ(both.correction[0], Correction::kTwoMeshes);
  EXPECT_NEAR(both.lambda[0] / alone.lambda[0], 1, 1e-12);
  EXPECT_NEAR(both.cents[0] / alone.cents[0], 0.25, 1e-9);
  EXPECT_NEAR(alone.cents[0] / error_bars::calc_cents(fine.parts[0], fine.kind), 0.5, 1e-9);
  Level round = fine, before = coarse;
  round.kind = before.kind = Kind::kT10Curved;
  const auto find_share = [&] {
    return error_bars::calc_corrections(round, std::span(&before, 1)).cents[0] / error_bars::calc_cents(round.parts[0], round.kind);
  };
  EXPECT_NEAR(find_share(), 0.125, 1e-9) << "flat or thick";
  before.parts[0].interpolation = 0.8 * 0.16;  // the same excess, less the share missing in recovered strains
  before.parts[0].bent = 0.05 * 0.16;
  EXPECT_NEAR(find_share(), 0.25, 1e-9) << "a bent wall on the coarser mesh";
  before = coarse;
  before.kind = Kind::kT10Curved;
  round.parts[0].geometry = -0.003;  // of 0.01
  EXPECT_NEAR(find_share(), 0.25, 1e-9) << "a surface that the elements miss";
}

TEST(TwoMeshes, that_nearly_agree_leave_a_bar_as_long_as_they_are_apart) {
  const auto find = [](double apart, Kind kind) {
    const Level fine = make_level({1000}, {0.01}, kind);
    const double truth = error_bars::calc_corrections(fine).lambda[0], by = fine.lambda[0] - truth;
    Level coarse = make_level({1000}, {0.16}, kind);
    // The coarser value is `apart` of the difference of both corrections above the finer one; its correction is a share of its lambda.
    const double share = 1 - error_bars::calc_corrections(coarse).lambda[0] / coarse.lambda[0];
    coarse.lambda[0] = (truth - apart * by) / (1 - share - apart * share);
    return error_bars::calc_corrections(fine, std::span(&coarse, 1)).cents[0] / error_bars::calc_corrections(fine).cents[0];
  };
  EXPECT_NEAR(find(0.3, Kind::kT10), 0.25, 1e-9);
  EXPECT_NEAR(find(0.49, Kind::kT10), 0.25, 1e-9);
  EXPECT_NEAR(find(0.8, Kind::kT10), 0.4, 1e-9);
  EXPECT_GT(find(1.1, Kind::kT10), 0.99) << "no more";
  EXPECT_GT(find(0.8, Kind::kT4), 0.99) << "T4 agree or not";
}

TEST(TwoMeshes, may_agree_where_the_coarser_is_rough_and_the_finer_has_rims) {
  const auto sharp = [](double i) { return 1000 * std::sqrt(1 + i); };
  const Level fine = make_level({sharp(0.02)}, {0.02}), coarse = make_level({sharp(0.4)}, {0.4});
  ASSERT_EQ(error_bars::calc_corrections(coarse).correction[0], Correction::kRough);
  EXPECT_EQ(error_bars::calc_corrections(fine, std::span(&coarse, 1)).correction[0], Correction::kTwoMeshes);
  const Level wrong = make_level({3 * sharp(0.4)}, {0.4});
  EXPECT_EQ(error_bars::calc_corrections(fine, std::span(&wrong, 1)).correction[0], Correction::kOneMesh) << "it disputes nothing";
  Level rim = fine, before = make_level({sharp(0.1)}, {0.1});
  rim.has_rims = before.has_rims = true;
  rim.parts[0].singular = before.parts[0].singular = 0.01;
  before.parts[0].singular = 0.05;
  ASSERT_EQ(error_bars::calc_corrections(rim).correction[0], Correction::kRough);
  const error_bars::Corrections both = error_bars::calc_corrections(rim, std::span(&before, 1));
  EXPECT_EQ(both.correction[0], Correction::kTwoMeshes);
  EXPECT_NEAR(both.cents[0] / error_bars::calc_cents(rim.parts[0], rim.kind), 0.25, 1e-9) << "rims: a quarter";
}

TEST(TwoMeshes, are_compared_mode_by_mode_where_two_have_changed_places) {
  // Bending at 1000 Hz is far too high on the coarser mesh, stretching at 1010 Hz is right on both; others fall as bending does.
  const auto at = [](double hz, double i) { return hz * std::sqrt(1 + i); };
  const Level fine = make_level({at(400, 0.01), at(700, 0.01), at(1000, 0.01), 1010.0, at(2000, 0.01)}, {0.01, 0.01, 0.01, 1e-7, 0.01});
  Level coarse = make_level({at(400, 0.16), at(700, 0.16), 1010.0, at(1013, 0.16), at(2000, 0.16)}, {0.16, 0.16, 1e-7, 0.16, 0.16});
  const error_bars::Corrections both = error_bars::calc_corrections(fine, std::span(&coarse, 1));
  for (const std::size_t m : {0, 1, 2, 4}) EXPECT_EQ(both.correction[m], Correction::kTwoMeshes) << m;
  EXPECT_LE(both.cents[2], 0.26 * error_bars::calc_cents(fine.parts[2], fine.kind));
  coarse.lambda[3] *= 1.2;  // too far away to have changed places
  EXPECT_EQ(error_bars::calc_corrections(fine, std::span(&coarse, 1)).correction[2], Correction::kOneMesh);
}

TEST(TwoMeshes, that_contradict_each_other_leave_the_meshs_value_and_a_bar_that_spans_both) {
  // A wrong estimate: it predicts almost no error, and the finer mesh is 60 cents lower.
  const Level fine = make_level({1000}, {1e-4}), coarse = make_level({1035}, {4e-4});
  const error_bars::Corrections both = error_bars::calc_corrections(fine, std::span(&coarse, 1));
  EXPECT_EQ(both.correction[0], Correction::kDisputed);
  EXPECT_EQ(both.lambda[0], fine.lambda[0]);
  EXPECT_NEAR(both.cents[0], 1200 * std::log2(1.035), 1e-9) << "as far as they are apart";
}

TEST(TwoMeshes, that_agree_are_not_disputed_by_a_third) {
  const auto sharp = [](double i) { return 1000 * std::sqrt(1 + i); };
  const std::vector<Level> coarser{make_level({1150}, {1e-3}), make_level({sharp(0.16)}, {0.16})};
  const Level fine = make_level({sharp(0.01)}, {0.01});
  EXPECT_EQ(error_bars::calc_corrections(fine, std::span(coarser).first(1)).correction[0], Correction::kDisputed);
  EXPECT_EQ(error_bars::calc_corrections(fine, coarser).correction[0], Correction::kTwoMeshes);
}

TEST(TwoMeshes, of_nearly_the_same_size_have_no_longer_bar_than_the_coarser) {
  const auto make = [](double i) { return make_level({1000 * std::sqrt(1 + i)}, {i}); };
  const std::vector<Level> levels{make(0.03), make(0.018), make(0.0145)};
  const auto find = [&](std::size_t meshes) { return error_bars::calc_corrections(levels[meshes], std::span(levels).first(meshes)); };
  EXPECT_EQ(find(1).correction[0], Correction::kTwoMeshes);
  const error_bars::Corrections near = error_bars::calc_corrections(levels[2], std::span(levels).subspan(1, 1));
  EXPECT_EQ(near.correction[0], Correction::kOneMesh) << "too near for a verdict";
  EXPECT_LE(near.cents[0], error_bars::calc_corrections(levels[1]).cents[0]);
  EXPECT_LT(find(2).cents[0], find(1).cents[0]) << "all coarser meshes are compared";
  std::vector<Level> apart{make(0.02), make(0.01), make(0.0099)};
  apart[0].lambda[0] *= 1.004;  // agrees with the second mesh by a little, with the third no more
  apart[2].lambda[0] *= 0.993;
  const error_bars::Corrections before = error_bars::calc_corrections(apart[1], std::span(apart).first(1)),
                                after = error_bars::calc_corrections(apart[2], std::span(apart).first(2));
  ASSERT_EQ(before.correction[0], Correction::kTwoMeshes);
  ASSERT_EQ(after.correction[0], Correction::kOneMesh);
  const double shift = std::abs(600 * std::log2(before.lambda[0] / after.lambda[0]));
  EXPECT_NEAR(after.cents[0], before.cents[0] + shift, 1e-9) << "the coarser's interval";
}

TEST(Degenerate, modes_are_corrected_alike_whatever_basis_their_shapes_are) {
  Level level = make_level({500, 1000, 1000, 1500}, {0.01, 0.08, 0.02, 0.03});
  const error_bars::Corrections first = error_bars::calc_corrections(level);
  std::swap(level.parts[1].interpolation, level.parts[2].interpolation);
  level.parts[1].interpolation += 0.01;  // another basis of the same space: the sum is constant
  level.parts[2].interpolation -= 0.01;
  const error_bars::Corrections other = error_bars::calc_corrections(level);
  EXPECT_EQ(first.lambda[1], first.lambda[2]);
  for (std::size_t m = 0; m < 4; ++m) EXPECT_NEAR(other.lambda[m] / first.lambda[m], 1, 1e-15) << m;
}

TEST(Order, of_corrected_frequencies_is_their_own_and_decides_which_are_the_lowest) {
  // Bending (the third) is too high on the mesh; its true place is second.
  const Level level = make_level({1000, 1500, 1600, 2500}, {0.001, 0.001, 0.3, 0.001});
  const error_bars::Corrections corrections = error_bars::calc_corrections(level);
  EXPECT_LT(corrections.lambda[2], corrections.lambda[1]);
  EXPECT_EQ(error_bars::find_computed_count(1), 12U);
  EXPECT_EQ(error_bars::find_computed_count(30), 36U);
  EXPECT_EQ(error_bars::find_computed_count(800), 820U);
}

TEST(Bars, of_a_mode_itself_are_those_that_it_has_without_neighbours) {
  // The second is corrected to the first's place, with a bar that covers it many times.
  const error_bars::Corrections both = error_bars::calc_corrections(make_level({1000, 1010}, {0.001, 0.02}));
  for (const auto& [m, hz, interpolation] : {std::tuple{0, 1000.0, 0.001}, std::tuple{1, 1010.0, 0.02}}) {
    const error_bars::Corrections alone = error_bars::calc_corrections(make_level({hz}, {interpolation}));
    EXPECT_NEAR(both.own_cents[m], alone.cents[0], 1e-9);
    EXPECT_NEAR(alone.own_cents[0], alone.cents[0], 1e-9);
  }
  EXPECT_GT(both.cents[0], 5 * both.own_cents[0]);
}

TEST(ShortLists, of_lumped_T4_hold_the_truth) {
  // One to three modes of thin bodies: unlisted kinds of modes, far above on the mesh, fall between them.
  for (const char* name : {"plate-thin", "strip-thick", "slab", "tile", "stick"}) {
    const Outcome outcome = solve(PETSC_COMM_WORLD, get_body(name), get_body(name).fineness.front(), MeshKind::T4Lumped);
    for (std::size_t m = 0; m < 3; ++m) {
      EXPECT_LE(std::abs(outcome.corrected_error_cents(m)), 1.05 * outcome.corrected_bar_cents(m)) << name << " " << m;
    }
  }
}

TEST(Levels, that_are_predicted_keep_what_is_believed_and_shrink_its_bars) {
  const Level level = make_level({1000, 1500, 1600, 2500}, {0.01, 0.02, 0.2, 0.04});
  const Level then = error_bars::predict_level(level, 4.0, false, 0.5);
  EXPECT_TRUE(std::is_sorted(then.lambda.begin(), then.lambda.end()));
  auto believed = error_bars::calc_corrections(level).lambda, later = error_bars::calc_corrections(then, std::span(&level, 1)).lambda;
  std::sort(believed.begin(), believed.end());
  std::sort(later.begin(), later.end());
  for (std::size_t m = 0; m < 4; ++m) EXPECT_NEAR(later[m] / believed[m], 1, 1e-12);
  EXPECT_NEAR(error_bars::find_order(then, &level, 2.0), 4.0, 1e-9);
  Level thin = level;
  thin.one_layer = 0.9;
  EXPECT_EQ(error_bars::find_order(thin, nullptr, 1.0), 2.0);
  EXPECT_EQ(error_bars::find_order(level, nullptr, 1.0), 4.0);
  for (ErrorParts& parts : thin.parts) parts.bent = 0.1 * parts.interpolation;
  EXPECT_EQ(error_bars::find_order(thin, nullptr, 1.0), 3.0) << "bent walls";
}

}  // namespace
}  // namespace carillon::tests
