#include "runtime/material/solids.hpp"

#include <gtest/gtest.h>

#include <string>

namespace {

using carillon::material::ask_about_solid;

struct Solid {
  const char* name;
  double e_pa, rho;
};
// Handbook values of existing solids, from the softest to the stiffest.
constexpr Solid kReal[]{{"steel", 2.1e11, 7850},
                        {"aluminium", 7e10, 2700},
                        {"glass", 7.2e10, 2500},
                        {"beryllium", 2.87e11, 1850},
                        {"diamond", 1.2e12, 3510},
                        {"tungsten", 4.1e11, 19300},
                        {"lead", 1.6e10, 11340},
                        {"gold", 7.8e10, 19300},
                        {"osmium", 5.6e11, 22590},
                        {"nylon", 2.5e9, 1150},
                        {"spruce across", 4e8, 430},
                        {"balsa", 1e9, 120},
                        {"cork", 2e7, 180},
                        {"hard rubber", 5e6, 1200},
                        {"soft rubber", 1e6, 950},
                        {"polystyrene foam", 5e6, 30},
                        {"soft foam", 1e5, 25},
                        {"aerogel", 1e6, 30},
                        {"soil", 5e7, 1800},
                        {"concrete", 3e10, 2400},
                        {"ice", 9e9, 917},
                        {"bone", 1.8e10, 1900},
                        {"silicon carbide", 4.5e11, 3200}};

TEST(Solids, existing_solids_cause_no_warning) {
  for (const Solid& solid : kReal)
    EXPECT_FALSE(ask_about_solid(solid.e_pa, solid.rho)) << solid.name << ": " << *ask_about_solid(solid.e_pa, solid.rho);
}

TEST(Solids, wrong_units_are_recognised) {
  constexpr Solid kOrdinary[]{
      {"steel", 2.1e11, 7850}, {"aluminium", 7e10, 2700}, {"glass", 7.2e10, 2500}, {"brass", 1e11, 8500}, {"concrete", 3e10, 2400}};
  for (const Solid& solid : kOrdinary) {
    const auto expect = [&](double e, double rho, const char* unit, const char* other) {
      const auto text = ask_about_solid(e, rho);
      ASSERT_TRUE(text) << solid.name << " in " << unit << other;
      EXPECT_NE(text->find(std::string("was it given in ") + unit), std::string::npos) << solid.name << ": " << *text;
      EXPECT_NE(text->find(*other == 0 ? std::string() : std::string("was it given in ") + other), std::string::npos)
          << solid.name << ": " << *text;
      EXPECT_EQ(text->find('\n'), std::string::npos);
    };
    expect(solid.e_pa / 1e9, solid.rho, "GPa", "");
    expect(solid.e_pa / 1e6, solid.rho, "MPa", "");
    expect(solid.e_pa / 6894.757, solid.rho, "psi", "");
    expect(solid.e_pa, solid.rho / 1e3, "g/cm^3", "");
    expect(solid.e_pa / 1e9, solid.rho / 1e3, "GPa", "g/cm^3");
    expect(solid.e_pa / 1e6, solid.rho / 1e12, "MPa", "t/mm^3");
  }
}

TEST(Solids, gels_and_soft_rubbers_cause_a_warning) {
  for (const auto& [e, rho] : {std::pair(1e4, 1000.0), {3e3, 1010.0}, {1e5, 1100.0}}) {
    const auto text = ask_about_solid(e, rho);
    ASSERT_TRUE(text) << e;
    EXPECT_NE(text->find("ignore this for a gel or a soft rubber"), std::string::npos) << *text;
  }
  // Wood in N/mm^2 and a plastic in psi are in the range of gels and must cause a warning.
  EXPECT_NE(ask_about_solid(12000.0, 700.0)->find("MPa"), std::string::npos);
  EXPECT_NE(ask_about_solid(4e5, 1200.0)->find("psi"), std::string::npos);
}

TEST(Solids, unexplained_values_cause_a_warning) {
  for (const auto& [e, rho] : {std::pair(1e-3, 1e-3), {1e15, 1e3}, {1e-6, 1e8}, {2e11, 1e7}, {1e300, 1.0}}) {
    const auto text = ask_about_solid(e, rho);
    ASSERT_TRUE(text);
    EXPECT_NE(text->find("unit"), std::string::npos) << *text;
  }
}

TEST(Solids, warnings_name_the_given_number) {
  const auto text = ask_about_solid(72.0, 2500.0, "lame_mu_pa", "density_kg_m3", 29.5);
  ASSERT_TRUE(text);
  EXPECT_NE(text->find("lame_mu_pa is 29.5"), std::string::npos) << *text;
}

}  // namespace
