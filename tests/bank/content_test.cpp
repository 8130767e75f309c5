// What a bank holds: quantised shapes, and what is called sane.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "tests/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

TEST(Quantise, NoComponentIsOffByMoreThanHalfAStep) {
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
  EXPECT_EQ(bank.shape[4], 16384);  // 16383.5 goes away from zero
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

TEST(Quantise, ShapesThatAreNotFiniteOrNotAsManyAreRefused) {
  Bank bank = example::make_bank(1, 2);
  std::vector<double> shapes = example::calc_shapes(bank);
  shapes[6 * 3 + 4] = std::nan("");
  try {
    quantise_shapes(bank, shapes);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("mode 1 at vertex 3"), std::string::npos) << error.what();
  }
  EXPECT_THROW(quantise_shapes(bank, std::span(shapes).first(5)), InputError);
}

TEST(Bank, FrequencyIsTheRootOfTheEigenvalueOverTwoPi) {
  Bank bank;
  bank.eigenvalue_rad2_s2 = {4.0e6};
  EXPECT_NEAR(bank.freq_hz(0), 318.30988618379067, 1e-12);
}

TEST(Faults, ASaneBankHasNone) {
  EXPECT_EQ(find_faults(example::make_bank()), std::vector<std::string>{});
  EXPECT_EQ(find_faults(example::make_bank(3, 0)), std::vector<std::string>{}) << "a body may have no mode in the band";
  EXPECT_EQ(find_faults(example::make_bank(5, 40)), std::vector<std::string>{});
}

TEST(Faults, AHollowBodyWithItsInnerSkinHasNone) {
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

TEST_P(BankFaults, AreToldInWords) {
  Bank bank = example::make_bank(3, 6);
  GetParam().spoil(bank);
  const auto faults = find_faults(bank);
  ASSERT_FALSE(faults.empty());
  bool told = false;
  for (const std::string& fault : faults) told = told || fault.find(GetParam().words) != std::string::npos;
  EXPECT_TRUE(told) << faults[0];
  EXPECT_THROW(write_bank(bank, testing::TempDir() + "never_written.hdf"), InputError);
  EXPECT_FALSE(std::filesystem::exists(testing::TempDir() + "never_written.hdf"));
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

const Spoiled kSpoiled[] = {
    {"short_decay", [](Bank& b) { b.decay_per_s.pop_back(); }, "decay holds 5 values and 6 are wanted"},
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
    {"band_upside_down",
     [](Bank& b) {
       b.band_hz = {20000, 20};
     },
     "not an ascending pair"},
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
     "and the volume is said to be"},
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
       for (int k : {0, 4, 8}) b.rigid.inertia_kg_m2[k] += 1.0;
     },
     "too large for a surface"},
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

INSTANTIATE_TEST_SUITE_P(, BankFaults, testing::ValuesIn(kSpoiled), [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace carillon::bank
