#include "runtime/bank/edits.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

TEST(Edits, AnEditedBankIsSaneAndTheWayBackIsTheBankItself) {
  const Bank bank = example::make_bank(3, 12);
  const Bank there = calc_edited(bank, {.density_scale = 0.3, .stiffness_scale = 4.0, .size_scale = 2.5});
  EXPECT_EQ(find_faults(there), std::vector<std::string>{});
  const Bank back = calc_edited(there, {.density_scale = 1 / 0.3, .stiffness_scale = 0.25, .size_scale = 0.4});
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    EXPECT_NEAR(there.freq_hz(m), bank.freq_hz(m) * std::sqrt(4.0 / 0.3) / 2.5, 1e-9 * bank.freq_hz(m));
    EXPECT_NEAR(back.eigenvalue_rad2_s2[m] / bank.eigenvalue_rad2_s2[m], 1.0, 1e-13);
    EXPECT_NEAR(back.decay_per_s[m] / bank.decay_per_s[m], 1.0, 1e-12);
    EXPECT_NEAR(back.radiation_gain[m] / bank.radiation_gain[m], 1.0, 1e-12);
    EXPECT_NEAR(back.shape_scale[m] / bank.shape_scale[m], 1.0, 1e-13);
  }
  EXPECT_NEAR(there.rigid.mass_kg / bank.rigid.mass_kg, 0.3 * 2.5 * 2.5 * 2.5, 1e-12);
  EXPECT_NEAR(there.rigid.inertia_kg_m2[0] / bank.rigid.inertia_kg_m2[0], 0.3 * std::pow(2.5, 5), 1e-10);
  EXPECT_EQ(there.shape, bank.shape);
  EXPECT_NE(there.provenance.find("\"size_scale\": 2.5"), std::string::npos);
}

TEST(Edits, OtherAlphasTakeThePlaceOfTheLaw) {
  const Bank edited = calc_edited(example::make_bank(2, 5), {.alphas = {{2e-8, 7.0}}});
  for (std::size_t m = 0; m < edited.mode_count(); ++m) {
    EXPECT_NEAR(edited.decay_per_s[m], 0.5 * (2e-8 * edited.eigenvalue_rad2_s2[m] + 7.0), 1e-9);
  }
  EXPECT_EQ(find_faults(edited), std::vector<std::string>{});
}

TEST(Edits, WhatMeansNothingIsRefused) {
  const Bank bank = example::make_bank(2, 5);
  for (const double scale : {0.0, -1.0, 1e-7, 1e7, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(calc_edited(bank, {.density_scale = scale}), InputError);
    EXPECT_THROW(calc_edited(bank, {.stiffness_scale = scale}), InputError);
    EXPECT_THROW(calc_edited(bank, {.size_scale = scale}), InputError);
  }
  EXPECT_THROW(calc_edited(bank, {.alphas = {{-1.0, 0.0}}}), InputError);
  Bank several = bank;
  several.damping.law = "mixed";
  EXPECT_THROW(calc_edited(several, {}), InputError);
}

}  // namespace
}  // namespace carillon::bank
