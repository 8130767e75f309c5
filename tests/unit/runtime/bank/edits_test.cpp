#include "runtime/bank/edits.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/bank/of_material.hpp"
#include "runtime/material/table.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

TEST(Edits, AreValidAndInvertible) {
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

TEST(Edits, ReactionsScaleWithMassAndAcceleration) {
  const Bank bank = example::make_supported_bank(3, 4);
  const double s = 0.3, k = 4.0, g = 2.5;
  const Bank there = calc_edited(bank, {.density_scale = s, .stiffness_scale = k, .size_scale = g});
  EXPECT_EQ(find_faults(there), std::vector<std::string>{});
  for (std::size_t i = 0; i < bank.supports.reaction.size(); ++i) {
    // lambda times the integral of rho phi: for unit modal mass it scales with lambda sqrt(mass).
    const double scale = there.eigenvalue_rad2_s2[i / 12] / bank.eigenvalue_rad2_s2[i / 12] *
                         std::sqrt(there.rigid.mass_kg / bank.rigid.mass_kg) * (i % 6 < 3 ? 1.0 : g);
    EXPECT_NEAR(there.supports.reaction[i] / bank.supports.reaction[i], scale, 1e-12 * scale);
  }
  EXPECT_EQ(there.supports.energy, bank.supports.energy);
  EXPECT_NEAR(there.supports.area_m2[0] / bank.supports.area_m2[0], g * g, 1e-12);
  EXPECT_NEAR(there.supports.centre_m[1][0] / bank.supports.centre_m[1][0], g, 1e-12);
  EXPECT_NEAR(there.supports.thickness_m[1] / bank.supports.thickness_m[1], g, 1e-12);
}

TEST(Edits, AlphasReplaceTheLaw) {
  const Bank edited = calc_edited(example::make_bank(2, 5), {.alphas = {{2e-8, 7.0}}});
  for (std::size_t m = 0; m < edited.mode_count(); ++m) {
    EXPECT_NEAR(edited.decay_per_s[m], 0.5 * (2e-8 * edited.eigenvalue_rad2_s2[m] + 7.0), 1e-9);
  }
  EXPECT_EQ(find_faults(edited), std::vector<std::string>{});
}

TEST(Edits, ALawGivesItsDecaysAndIsRecorded) {
  const Bank bank = example::make_bank(2, 9);
  Damping friction, table, series;
  friction.law = "internal_friction";
  friction.coefficient = {0.02};
  table.law = "loss_table";
  table.freq_hz = {100.0, 10000.0};
  table.loss_factor = {0.01, 0.03};
  series.law = "caughey";
  series.power = {0.0, 1.0};
  series.coefficient = {7.0, 2e-8};
  for (const Damping& law : {friction, table, series}) {
    const Bank edited = calc_edited(bank, {.size_scale = 2.0, .damping = law});
    EXPECT_EQ(find_faults(edited), std::vector<std::string>{});
    EXPECT_EQ(edited.damping.law, law.law);
    EXPECT_EQ(edited.material.alpha1_s + edited.material.alpha2_per_s, 0.0);
    EXPECT_NE(edited.provenance.find("\"law\": \"" + law.law + "\""), std::string::npos) << edited.provenance;
    for (std::size_t m = 0; m < bank.mode_count(); ++m) {
      const double omega = std::sqrt(bank.eigenvalue_rad2_s2[m]) / 2.0, f = omega / (2.0 * 3.14159265358979323846);
      const double loss = f < 100.0 ? 0.01 : f > 10000.0 ? 0.03 : 0.01 + 0.02 * (std::log10(f) - 2.0) / 2.0;
      const double decay = law.law == "caughey"      ? 0.5 * (7.0 + 2e-8 * omega * omega)
                           : law.law == "loss_table" ? 0.5 * loss * omega
                                                     : 0.01 * omega;
      EXPECT_NEAR(edited.decay_per_s[m] / decay, 1.0, 1e-12) << law.law << " mode " << m;
    }
    const Bank back = calc_edited(edited, {.alphas = {{1e-8, 3.0}}});
    EXPECT_EQ(back.damping.law, "rayleigh");
    EXPECT_EQ(find_faults(back), std::vector<std::string>{});
  }
}

TEST(Edits, AnInvalidLawIsRejected) {
  const Bank bank = example::make_bank(2, 5);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto make = [](const char* name, std::vector<double> coefficient, std::vector<double> power, std::vector<double> freq_hz,
                       std::vector<double> loss_factor) {
    Damping law;
    law.law = name;
    law.coefficient = std::move(coefficient);
    law.power = std::move(power);
    law.freq_hz = std::move(freq_hz);
    law.loss_factor = std::move(loss_factor);
    return law;
  };
  for (const Damping& law :
       {make("internal_friction", {-0.1}, {}, {}, {}), make("internal_friction", {2.0}, {}, {}, {}),
        make("internal_friction", {nan}, {}, {}, {}), make("internal_friction", {}, {}, {}, {}), make("caughey", {-1.0}, {0.0}, {}, {}),
        make("caughey", {1.0}, {9.0}, {}, {}), make("caughey", {nan}, {0.0}, {}, {}), make("caughey", {1.0}, {}, {}, {}),
        make("loss_table", {}, {}, {200.0, 100.0}, {0.1, 0.1}), make("loss_table", {}, {}, {0.0}, {0.1}),
        make("loss_table", {}, {}, {100.0}, {3.0}), make("loss_table", {}, {}, {nan}, {0.1}), make("mixed", {}, {}, {}, {}),
        make("x", {}, {}, {}, {})}) {
    EXPECT_THROW(calc_edited(bank, {.damping = law}), InputError) << law.law;
  }
  EXPECT_THROW(calc_edited(bank, {.alphas = {{0.0, 1.0}}, .damping = make("internal_friction", {0.1}, {}, {}, {})}), InputError);
}

TEST(Edits, InvalidEditsAreRejected) {
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
  EXPECT_THROW(calc_edited(several, {.size_scale = 2.0}), InputError);
}

TEST(Edits, WoodPermitsScalingOnly) {
  Bank wood = example::make_bank(2, 5);
  wood.regions = R"([{"region":"","volume_m3":0.25,"orthotropic":{"poisson_ratio":[0.3,0.4,0.4]}}, {"volume_m3": 1e-3}, {"volume_m3":)";
  const Bank larger = calc_edited(wood, {.size_scale = 2.0});
  for (std::size_t m = 0; m < wood.mode_count(); ++m) EXPECT_NEAR(larger.freq_hz(m) / wood.freq_hz(m), 0.5, 1e-12);
  EXPECT_EQ(larger.regions,
            R"([{"region":"","volume_m3":2,"orthotropic":{"poisson_ratio":[0.3,0.4,0.4]}}, {"volume_m3": 0.008}, {"volume_m3":)");
  EXPECT_THROW(calc_edited(wood, {.density_scale = 2.0}), InputError);
  EXPECT_THROW(calc_edited(wood, {.stiffness_scale = 2.0}), InputError);
  EXPECT_THROW(calc_edited(wood, {.alphas = {{0.0, 1.0}}}), InputError);
}

TEST(Edits, AnotherMaterialHasItsSpeedOfSoundAndItsLoss) {
  const Bank bank = example::make_bank(3, 12);
  const material::MaterialTable& table = material::MaterialTable::get();
  const material::Material& glass = table.find("glass")->material;
  const Bank of_glass = calc_edited(bank, make_edits(bank, glass));
  EXPECT_EQ(find_faults(of_glass), std::vector<std::string>{});
  const double faster =
      std::sqrt(glass.young_modulus_pa / bank.material.young_modulus_pa / (glass.density_kg_m3 / bank.material.density_kg_m3));
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    EXPECT_NEAR(of_glass.freq_hz(m) / bank.freq_hz(m), faster, 1e-12);
    EXPECT_NEAR(of_glass.decay_per_s[m] / (std::numbers::pi * of_glass.freq_hz(m) * 1e-3), 1.0, 1e-12);
  }
  EXPECT_NEAR(of_glass.rigid.mass_kg / bank.rigid.mass_kg, 2500 / bank.material.density_kg_m3, 1e-12);
  EXPECT_NEAR(of_glass.material.young_modulus_pa / 72e9, 1.0, 1e-12);
  const double poisson = bank.material.poisson_ratio;
  EXPECT_NEAR(calc_poisson_cents(bank, glass), std::abs(1200 * std::log2(std::sqrt((1 + 0.22) / (1 + poisson)))), 1e-9);
  EXPECT_THROW(make_edits(bank, table.find("oak")->material), InputError);
}

}  // namespace
}  // namespace carillon::bank
