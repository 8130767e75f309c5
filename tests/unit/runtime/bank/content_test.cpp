// Content of banks: quantised shapes, and validity checks.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <random>

#include "runtime/bank/edges.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

TEST(Edges, MatchAnExhaustiveSearch) {
  std::mt19937 random(7);
  for (const std::int32_t vertices : {4, 9, 60}) {  // including dense surfaces
    std::vector<std::array<std::int32_t, 3>> triangles(100);
    for (auto& corners : triangles)
      for (std::int32_t& v : corners) v = static_cast<std::int32_t>(random() % static_cast<std::uint32_t>(vertices));
    std::map<std::pair<std::int32_t, std::int32_t>, std::vector<std::int32_t>> expected;
    for (std::int32_t e = 0; e < 300; ++e) {
      const std::int32_t a = triangles[e / 3][e % 3], b = triangles[e / 3][(e % 3 + 1) % 3];
      expected[{std::min(a, b), std::max(a, b)}].push_back(e);
    }
    auto next = expected.begin();
    for_each_edge(triangles, static_cast<std::size_t>(vertices), [&](std::int32_t low, const HalfEdge* first, const HalfEdge* last) {
      std::vector<std::int32_t> numbers;
      for (const HalfEdge* edge = first; edge < last; ++edge) numbers.push_back(edge->number);
      ASSERT_NE(next, expected.end());
      EXPECT_EQ(std::pair(low, first->upper), next->first);
      EXPECT_EQ(numbers, next->second);
      ++next;
    });
    EXPECT_EQ(next, expected.end());
  }
}

TEST(Quantise, ErrorIsAtMostHalfAStep) {
  Bank bank = example::make_bank(4, 20);
  const std::vector<double> shapes = example::calc_shapes(bank);
  for (std::size_t v = 0, i = 0; v < bank.vertex_count(); ++v) {
    for (std::size_t mode = 0; mode < bank.mode_count(); ++mode) {
      for (const double back : bank.shape_at(v, mode)) {
        ASSERT_LE(std::abs(back - shapes[i++]), 0.5 * bank.shape_scale[mode] * (1.0 + 1e-9)) << "vertex " << v << " mode " << mode;
      }
    }
  }
}

TEST(Quantise, TheStepIsTheLargestComponentOver32767) {
  Bank bank = example::make_bank(1, 2);
  std::vector<double> shapes(bank.vertex_count() * 6, 0.0);
  shapes[3] = -8.0;  // vertex 0, mode 1, x
  shapes[4] = 4.0;
  quantise_shapes(bank, shapes);
  EXPECT_EQ(bank.shape_scale[0], 0.0);
  EXPECT_DOUBLE_EQ(bank.shape_scale[1], 8.0 / 32767.0);
  EXPECT_EQ(bank.shape[3], -32767);
  EXPECT_EQ(bank.shape[4], 16384);  // 16383.5 rounds away from zero
  EXPECT_DOUBLE_EQ(bank.shape_at(0, 1)[0], -8.0);
}

TEST(Quantise, TinyAndHugeShapesKeepTheErrorBound) {
  Bank bank = example::make_bank(1, 1);
  for (const double size : {1e-320, 1e-300, 1e300}) {
    std::vector<double> shapes(bank.vertex_count() * 3);
    for (std::size_t i = 0; i < shapes.size(); ++i) shapes[i] = size * std::sin(static_cast<double>(i));
    quantise_shapes(bank, shapes);
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      ASSERT_LE(std::abs(bank.shape[i] * bank.shape_scale[0] - shapes[i]), 0.5 * bank.shape_scale[0] * (1.0 + 1e-9)) << size;
    }
  }
}

TEST(Quantise, InvalidShapesAreRejected) {
  Bank bank = example::make_bank(1, 2);
  std::vector<double> shapes = example::calc_shapes(bank);
  shapes[6 * 3 + 4] = std::nan("");
  tests::expect_error<InputError>({"mode 1 at vertex 3"}, [&] { quantise_shapes(bank, shapes); });
  EXPECT_THROW(quantise_shapes(bank, std::span(shapes).first(5)), InputError);
}

TEST(Bank, FrequencyIsTheRootOfTheEigenvalueOverTwoPi) {
  Bank bank;
  bank.eigenvalue_rad2_s2 = {4.0e6};
  EXPECT_NEAR(bank.freq_hz(0), 318.30988618379067, 1e-12);
}

TEST(Faults, AValidBankHasNone) {
  EXPECT_EQ(find_faults(example::make_bank()), std::vector<std::string>{});
  EXPECT_EQ(find_faults(example::make_bank(3, 0)), std::vector<std::string>{}) << "a body may have no mode in the band";
  EXPECT_EQ(find_faults(example::make_bank(5, 40)), std::vector<std::string>{});
}

TEST(Faults, ABankWithoutProofOrCutByMaxModesHasNone) {
  EXPECT_EQ(find_faults(example::make_first_bank(2, 5)), std::vector<std::string>{});
  Bank bank = example::make_bank(2, 5);
  bank.complete = false;
  bank.proof->below[2] = 300;
  bank.proof->found = 8;
  EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
  bank.proof->below[1] += 1;  // no mode may be missing below the last one
  EXPECT_FALSE(find_faults(bank).empty());
}

TEST(Faults, UnknownCorrectionsAndBarsAreNone) {
  Bank bank = example::make_corrected_bank(3, 9);
  EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
  bank.discretisation_error_cents[1] = bank.corrected.error_cents[1] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
}

TEST(Faults, AHollowBodyHasNone) {
  Bank bank = example::make_bank(2, 3);
  const std::vector<Vec3> outer = bank.vertices_m;
  const auto skin = bank.triangles;
  const auto count = static_cast<std::int32_t>(outer.size());
  for (const Vec3& x : outer) {
    Vec3 inner;
    for (int k = 0; k < 3; ++k) inner[k] = (x[k] + bank.rigid.centre_m[k]) / 2.0;
    bank.vertices_m.push_back(inner);
  }
  for (const auto& t : skin) bank.triangles.push_back({t[0] + count, t[2] + count, t[1] + count});
  bank.rigid.volume_m3 *= 1.0 - 1.0 / 8.0;
  bank.rigid.mass_kg *= 1.0 - 1.0 / 8.0;
  for (double& moment : bank.rigid.inertia_kg_m2) moment *= 1.0 - 1.0 / 32.0;
  bank.counts.nodes = 2 * count;
  quantise_shapes(bank, example::calc_shapes(bank));
  EXPECT_EQ(find_faults(bank), std::vector<std::string>{});
}

struct Spoiled {
  const char* name;
  std::function<void(Bank&)> spoil;
  const char* words;
};

class BankFaults : public testing::TestWithParam<Spoiled> {};

TEST_P(BankFaults, AreReported) {
  Bank bank = example::make_bank(3, 6);
  GetParam().spoil(bank);
  const auto faults = find_faults(bank);
  ASSERT_FALSE(faults.empty());
  bool is_reported = false;
  for (const std::string& fault : faults) is_reported = is_reported || fault.find(GetParam().words) != std::string::npos;
  EXPECT_TRUE(is_reported) << faults[0];
  EXPECT_THROW(write_bank(bank, testing::TempDir() + "never_written.hdf"), InputError);
  EXPECT_FALSE(std::filesystem::exists(testing::TempDir() + "never_written.hdf"));
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

void scale_lengths(Bank& bank, double scale) {
  for (Vec3& vertex : bank.vertices_m) {
    for (double& x : vertex) x *= scale;
  }
  for (double& x : bank.rigid.centre_m) x *= scale;
}

/// Parts of a bank to be damaged.
Supports& support(Bank& b) { return b.supports = example::make_supported_bank(3, 6).supports; }
Corrected& correct(Bank& b) { return b.corrected = example::make_corrected_bank(3, 6).corrected; }
std::vector<double>& doubt(Bank& b) { return b.facet_error_cents = std::vector<double>(b.mode_count(), 1.0); }
void group(Bank& b, std::int64_t first, std::int64_t count) { b.proof->cluster_first = {first}, b.proof->cluster_count = {count}; }
Bank& set_law(Bank& b, const char* law) {
  b.damping.law = law;
  return b;
}

const Spoiled kSpoiled[] = {
    {"short_decay", [](Bank& b) { b.decay_per_s.pop_back(); }, "decay holds 5 values, 6 are required"},
    {"short_residual", [](Bank& b) { b.residual.clear(); }, "residual holds 0 values"},
    {"short_gain", [](Bank& b) { b.radiation_gain.pop_back(); }, "radiation_gain holds 5"},
    {"long_scale", [](Bank& b) { b.shape_scale.push_back(1); }, "shape_scale holds 7"},
    {"short_shape", [](Bank& b) { b.shape.pop_back(); }, "shape holds"},
    {"no_surface", [](Bank& b) { b.triangles.clear(); }, "at least four of each"},
    {"nan_vertex", [](Bank& b) { b.vertices_m[4][1] = kNan; }, "vertices[13] is nan"},
    {"infinite_eigenvalue", [](Bank& b) { b.eigenvalue_rad2_s2[5] = kInf; }, "eigenvalue[5] is inf"},
    {"nan_gain", [](Bank& b) { b.radiation_gain[2] = kNan; }, "radiation_gain[2] is nan"},
    {"nan_scale", [](Bank& b) { b.shape_scale[0] = kNan; }, "shape_scale[0] is nan"},
    {"nan_inertia", [](Bank& b) { b.rigid.inertia_kg_m2[4] = kNan; }, "inertia_kg_m2[4] is nan"},
    {"rigid_mode_left", [](Bank& b) { b.eigenvalue_rad2_s2[0] = 0.0; }, "eigenvalue[0] is 0 rad^2/s^2, not positive"},
    {"negative_eigenvalue", [](Bank& b) { b.eigenvalue_rad2_s2[0] = -1.0; }, "not positive"},
    {"not_ascending", [](Bank& b) { std::swap(b.eigenvalue_rad2_s2[2], b.eigenvalue_rad2_s2[3]); },
     "eigenvalue[3] is below the one before"},
    {"above_band", [](Bank& b) { b.band_hz[1] = 5000.0; }, "lies outside the band"},
    {"below_band", [](Bank& b) { b.band_hz[0] = 600.0; }, "mode 0 at 574.44 Hz lies outside the band"},
    {"band_upside_down", [](Bank& b) { std::swap(b.band_hz[0], b.band_hz[1]); }, "not an ascending pair"},
    {"negative_decay", [](Bank& b) { b.decay_per_s[1] = -1.0; }, "decay[1] is -1 1/s, negative"},
    {"other_damping", [](Bank& b) { b.material.alpha1_s *= 2.0; }, "the damping law gives"},
    {"twice_the_decay",
     [](Bank& b) {
       for (double& d : b.decay_per_s) d *= 2.0;
     },
     "the damping law gives"},
    {"unsolved_mode", [](Bank& b) { b.residual[3] = 1e-3; }, "residual[3] is 0.001"},
    {"negative_residual", [](Bank& b) { b.residual[3] = -1e-9; }, "residual[3]"},
    {"negative_gain", [](Bank& b) { b.radiation_gain[3] = -1e-9; }, "radiation_gain[3] is -1e-09, negative"},
    {"negative_scale", [](Bank& b) { b.shape_scale[3] = -1e-9; }, "shape_scale[3] is -1e-09, negative"},
    {"vertex_out_of_range", [](Bank& b) { b.triangles[7][2] = static_cast<std::int32_t>(b.vertex_count()); },
     "triangle 7 names vertex 56, and there are 56"},
    {"negative_vertex", [](Bank& b) { b.triangles[7][0] = -1; }, "triangle 7 names vertex -1"},
    {"lowest_vertex", [](Bank& b) { b.triangles[7][0] = std::numeric_limits<std::int32_t>::min(); }, "triangle 7 names vertex -2147483648"},
    {"collapsed_triangle", [](Bank& b) { b.triangles[7][0] = b.triangles[7][1]; }, "triangle 7 names a vertex twice"},
    {"hole", [](Bank& b) { b.triangles.pop_back(); }, "the surface is open"},
    {"turned_triangle", [](Bank& b) { std::swap(b.triangles[0][0], b.triangles[0][1]); }, "turned against each other"},
    {"doubled_triangle", [](Bank& b) { b.triangles.push_back(b.triangles[0]); }, "more than two triangles"},
    {"inside_out",
     [](Bank& b) {
       for (auto& t : b.triangles) std::swap(t[0], t[1]);
     },
     "face inward"},
    {"other_volume",
     [](Bank& b) {
       b.rigid.volume_m3 *= 3;
       b.material.density_kg_m3 /= 3;
     },
     "the recorded volume is"},
    {"no_mass", [](Bank& b) { b.rigid.mass_kg = 0; }, "mass_kg is 0, not positive"},
    {"other_mass", [](Bank& b) { b.rigid.mass_kg *= 1.1; }, "density times volume gives"},
    {"millimetres",
     [](Bank& b) {
       for (auto& x : b.vertices_m)
         for (double& c : x) c *= 1000;
     },
     "the surface encloses"},
    {"centre_outside", [](Bank& b) { b.rigid.centre_m[2] = 0; }, "centre_m[2] is 0 m, outside the surface"},
    {"lopsided_inertia", [](Bank& b) { b.rigid.inertia_kg_m2[1] = 1e-6; }, "not symmetric"},
    {"negative_inertia",
     [](Bank& b) {
       for (double& i : b.rigid.inertia_kg_m2) i = -i;
     },
     "not that of a solid"},
    {"impossible_inertia", [](Bank& b) { b.rigid.inertia_kg_m2[0] = 2 * b.rigid.inertia_kg_m2[8]; }, "not that of a solid"},
    {"inertia_about_origin",
     [](Bank& b) {
       for (int k = 0; k < 9; k += 4) b.rigid.inertia_kg_m2[k] += 1.0;
     },
     "too large for a surface"},
    {"short_reaction", [](Bank& b) { b.supports = example::make_supported_bank(3, 5).supports; }, "support_reaction holds 60 values, 72"},
    {"nan_reaction", [](Bank& b) { support(b).reaction[7] = kNan; }, "support_reaction[7] is nan"},
    {"huge_reaction", [](Bank& b) { support(b).reaction[14] *= 10; }, "support_reaction of mode 1"},
    {"long_normal",
     [](Bank& b) {
       support(b).normal[1] = {1, 1, 0};
     },
     "supports/normal[1] has length"},
    {"energy_from_nowhere", [](Bank& b) { support(b).energy[3] = 0.95; }, "support_energy of mode 1 sums up to"},
    {"unnamed_support", [](Bank& b) { support(b).text = R"({"supports": [{"name": "x-min"}]})"; }, "names 1 supports, and there are 2"},
    {"unreadable_support", [](Bank& b) { support(b).text = R"({"supports": [{"name": "x-min", "on": "sand"}, {"name": "x-max"}]})"; },
     "sand"},
    {"short_error", [](Bank& b) { b.algebraic_error_cents.pop_back(); }, "algebraic_error_cents holds 5 values"},
    {"short_facets", [](Bank& b) { b.facet_error_cents = {1.0}; }, "facet_error_cents holds 1 values"},
    {"negative_facets", [](Bank& b) { doubt(b)[2] = -3; }, "facet_error_cents[2] is -3, negative"},
    {"nan_facets", [](Bank& b) { doubt(b)[0] = kNan; }, "facet_error_cents[0] is nan"},
    {"nan_error", [](Bank& b) { b.discretisation_error_cents[1] = kNan; }, "discretisation_error_cents[1] is nan"},
    {"negative_error", [](Bank& b) { b.discretisation_error_cents[1] = -2; }, "discretisation_error_cents[1] is -2, negative"},
    {"unknown_law", [](Bank& b) { b.damping.law = "wishful"; }, "\"wishful\" is none that is known"},
    {"friction_without_angle", [](Bank& b) { b.damping.law = "internal_friction"; }, "not as many coefficients as it takes"},
    {"other_friction",
     [](Bank& b) {
       b.damping.law = "internal_friction";
       b.damping.coefficient = {0.01};
     },
     "the damping law gives"},
    {"table_upside_down",
     [](Bank& b) {
       b.damping.law = "loss_table";
       b.damping.freq_hz = {200, 100};
       b.damping.loss_factor = {0.1, 0.1};
     },
     "a table that does not ascend"},
    {"table_of_nothing", [](Bank& b) { b.damping.law = "loss_table"; }, "no table"},
    {"negative_mixture", [](Bank& b) { set_law(b, "mixed").decay_per_s[3] = -1; }, "decay[3] is -1 1/s, negative"},
    {"a_mode_is_missing", [](Bank& b) { b.proof->below[2] += 1; }, "modes lie between 7000 and 20000 Hz by the counts, and the bank holds"},
    {"a_mode_too_many", [](Bank& b) { b.proof->below[2] -= 1; }, "and the bank holds 3"},
    {"a_mode_in_the_wrong_slice", [](Bank& b) { b.proof->below[1] += 1; },
     "4 modes lie between 20 and 7000 Hz by the counts, and the bank holds 3"},
    {"found_too_few", [](Bank& b) { b.proof->found = 5; }, "5 modes were found, 6 are stored, and the counts give 12 - 6 = 6"},
    {"lowest_count", [](Bank& b) { b.proof->below[0] = std::numeric_limits<std::int64_t>::min(); }, "counts cannot fall"},
    {"found_far_too_many", [](Bank& b) { b.proof->found = std::int64_t{1} << 62; }, "modes were found"},
    {"counts_fall", [](Bank& b) { b.proof->below[1] = 5; }, "counts cannot fall"},
    {"cuts_fall", [](Bank& b) { std::swap(b.proof->cut_hz[0], b.proof->cut_hz[1]); }, "is not above the one before"},
    {"one_cut",
     [](Bank& b) {
       b.proof->cut_hz = {20};
       b.proof->below = {6};
       b.proof->margin = {1};
     },
     "two or more of each are wanted"},
    {"counts_missing", [](Bank& b) { b.proof->below.pop_back(); }, "3 cuts, 2 counts and 3 margins"},
    {"first_cut_inside", [](Bank& b) { b.proof->cut_hz[0] = 30; }, "the first cut at 30 Hz is inside the band"},
    {"last_cut_inside", [](Bank& b) { b.proof->cut_hz[2] = 19000; }, "the last cut at 19000 Hz is inside the band"},
    {"cut_through_a_mode",
     [](Bank& b) {
       b.algebraic_error_cents[2] = 1.0;
       b.proof->cut_hz[1] = b.freq_hz(2) * 1.0001;  // 0.17 cent
       b.proof->margin[1] = 1.0 - std::pow(b.freq_hz(2) / b.proof->cut_hz[1], 2);
     },
     "lies inside the error bar of mode 2"},
    {"cut_through_a_residual",
     [](Bank& b) {
       b.algebraic_error_cents.clear();
       b.residual[2] = 5e-5;
       b.proof->cut_hz[1] = b.freq_hz(2) * (1.0 + 1e-5);
       b.proof->margin[1] = 1.0 - std::pow(b.freq_hz(2) / b.proof->cut_hz[1], 2);
     },
     "lies inside the error bar of mode 2"},
    {"wrong_margin", [](Bank& b) { b.proof->margin[1] *= 1.1; }, "margin[1] is"},
    {"no_margin", [](Bank& b) { b.proof->margin[0] = 0.0; }, "margin[0] is 0"},
    {"nan_margin", [](Bank& b) { b.proof->margin[2] = kNan; }, "proof/margin[2] is nan"},
    {"rigid_of_another_body", [](Bank& b) { b.proof->rigid_per_component.push_back(6); }, "recorded for 2 components, and there are 1"},
    {"rigid_do_not_add_up", [](Bank& b) { b.proof->rigid_per_component = {5}; }, "5 rigid motions together, and 6 were deflated"},
    {"rigid_not_counted",
     [](Bank& b) {
       for (auto& below : b.proof->below) below -= 1;
     },
     "5 eigenvalues below the band are fewer than 6 rigid motions"},
    {"not_orthogonal", [](Bank& b) { b.proof->orthonormality = 1e-3; }, "modes may be duplicated"},
    {"bad_factor", [](Bank& b) { b.proof->backward_error = 1e-5; }, "its counts are uncertain"},
    {"group_out_of_range", [](Bank& b) { group(b, 5, 2); }, "2 degenerate modes from mode 5 cannot be"},
    {"group_overflows", [](Bank& b) { group(b, 1, std::numeric_limits<std::int64_t>::max()); }, "degenerate modes from mode 1 cannot be"},
    {"group_of_unequal_modes", [](Bank& b) { group(b, 1, 2); }, "spreads over"},
    {"giant_shape", [](Bank& b) { b.shape_scale[3] = 1e300; }, "shape_scale[3] is 1e+300, with which the mode moves by"},
    {"shape_of_a_lighter_body", [](Bank& b) { b.shape_scale[3] = 1e3; }, "shape_scale[3] is 1e+03"},
    {"giant_gain", [](Bank& b) { b.radiation_gain[3] = 1e300; }, "radiation_gain[3] is 1e+300, and a surface of this size and motion has"},
    {"gain_of_a_still_mode", [](Bank& b) { b.shape_scale[3] = 0.0; },
     "radiation_gain[3] is 3.5, and a surface of this size and motion has 0"},
    {"giant_stiffness", [](Bank& b) { b.material.young_modulus_pa = 1e300; }, "young_modulus_pa is 1e+300, outside"},
    {"no_stiffness_to_speak_of", [](Bank& b) { b.material.young_modulus_pa = 1e-300; }, "young_modulus_pa is 1e-300, outside"},
    {"neutron_star",
     [](Bank& b) {
       for (double* x : {&b.material.density_kg_m3, &b.rigid.mass_kg}) *x *= 1e12;
       for (double& x : b.rigid.inertia_kg_m2) x *= 1e12;
     },
     "density_kg_m3 is 7.8e+15, outside"},
    {"giant_alpha", [](Bank& b) { b.material.alpha1_s = 1e7; }, "alpha1_s is 1e+07, outside"},
    {"light_frequency",
     [](Bank& b) {
       b.eigenvalue_rad2_s2.back() = 1e40;
       b.band_hz[1] = 1e30;
     },
     "above the limit of 1e+12 Hz"},
    {"giant_decay", [](Bank& b) { set_law(b, "mixed").decay_per_s[3] = 1e200; }, "decay[3] is 1e+200 1/s, above the limit of"},
    {"atom", [](Bank& b) { scale_lengths(b, 1e-10); }, "bodies have 1e-09 to 1e+07 m"},
    {"galaxy", [](Bank& b) { scale_lengths(b, 1e21); }, "bodies have 1e-09 to 1e+07 m"},
    {"no_stiffness", [](Bank& b) { b.material.young_modulus_pa = 0; }, "young_modulus_pa is 0"},
    {"incompressible", [](Bank& b) { b.material.poisson_ratio = 0.5; }, "poisson_ratio is 0.5"},
    {"negative_alpha", [](Bank& b) { b.material.alpha2_per_s = -5; }, "alpha2_per_s is -5"},
    {"unknown_element", [](Bank& b) { b.element = "T11"; }, "neither T4 nor T10"},
    {"unknown_mass", [](Bank& b) { b.mass = ""; }, "neither consistent nor lumped"},
    {"too_few_nodes", [](Bank& b) { b.counts.nodes = 3; }, "3 nodes are fewer"},
    {"no_tets", [](Bank& b) { b.counts.tets = 0; }, "0 tetrahedra"},
    {"no_component", [](Bank& b) { b.counts.components = 0; }, "0 connected components"},
    {"seven_rigid_modes", [](Bank& b) { b.counts.rigid_modes = 7; }, "7 rigid modes"},
};

const Spoiled kSpoiledCorrections[] = {
    {"fewer_corrected", [](Bank& b) { correct(b).freq_hz.pop_back(); }, "corrected_frequency_hz holds 5 values"},
    {"no_corrected_frequency", [](Bank& b) { correct(b).freq_hz[2] = std::numeric_limits<double>::quiet_NaN(); },
     "corrected_frequency_hz[2] is nan"},
    {"far_corrected", [](Bank& b) { correct(b).freq_hz[2] *= 1e-3; }, "too far apart"},
    {"corrected_decay_of_another_law", [](Bank& b) { correct(b).decay_per_s[1] *= 1.01; }, "corrected_decay[1]"},
    {"negative_corrected_bar", [](Bank& b) { correct(b).error_cents[1] = -1.0; }, "corrected_error_cents[1] is -1"},
    {"unknown_correction", [](Bank& b) { correct(b).correction[0] = static_cast<Correction>(77); }, "correction[0] is 77"},
    {"kept_but_changed", [](Bank& b) { correct(b).correction[0] = Correction::kDisputed; }, "leaves it at the mesh's"},
    {"complete_only_in_part", [](Bank& b) { b.proof->complete_below_hz = 3000.0; }, "complete_below_hz is 3000"},
};

INSTANTIATE_TEST_SUITE_P(Corrected, BankFaults, testing::ValuesIn(kSpoiledCorrections),
                         [](const auto& info) { return std::string(info.param.name); });

INSTANTIATE_TEST_SUITE_P(, BankFaults, testing::ValuesIn(kSpoiled), [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace carillon::bank
