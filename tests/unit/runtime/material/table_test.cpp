// Named materials: plausible values with sources; extension by a user file.
#include "runtime/material/table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "runtime/material/read_material.hpp"
#include "runtime/material/solids.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::material {
namespace {

constexpr std::array<double, 2> kBandHz{20.0, 20000.0};

Material read(const std::string& text) {
  base::Document document = base::parse_document("{\"material\": " + text + "}", "/job.json");
  base::Object root = document.root();
  std::vector<std::string> warnings;
  return read_material(root, "material", kBandHz, warnings);
}

std::string find_error(const std::string& text) {
  return tests::catch_message<InputError>([&] { read(text); });
}

TEST(MaterialTable, has_solids_of_every_kind_with_sources) {
  std::set<std::string> names, groups;
  for (const Row& row : MaterialTable::get().rows()) {
    SCOPED_TRACE(row.material.name);
    EXPECT_TRUE(names.insert(row.material.name).second);
    for (const std::string& other : row.also) EXPECT_TRUE(names.insert(other).second) << other;
    groups.insert(row.group);
    EXPECT_GT(row.elasticity_source.size(), 10);
    EXPECT_GT(row.loss_source.size(), 10);
    const bool is_panel = row.group == "wood" && (row.material.name == "plywood" || row.material.name == "chipboard" ||
                                                  row.material.name == "mdf" || row.material.name == "cork");
    EXPECT_EQ(row.material.orthotropic.has_value(), (row.group == "wood" && !is_panel) || row.material.name == "bone");
    // Fastest waves: diamond is the upper limit, soft rubber has about 70 m/s.
    const Elasticity c = row.material.calc_elasticity_pa();
    const double fast = std::sqrt(calc_eigenvalues(c)[5] / row.material.density_kg_m3);
    EXPECT_GT(fast, 60);
    EXPECT_LT(fast, 20000);
    EXPECT_FALSE(ask_about_solid(row.material.young_modulus_pa, row.material.density_kg_m3).has_value());
    // Steel rings for seconds at 1 kHz, rubber for hundredths.
    const double omega = 2 * std::numbers::pi * 1000;
    const double loss = 2 * row.material.calc_decay_per_s(omega * omega) / omega;
    EXPECT_GE(loss, 1e-6);
    EXPECT_LE(loss, 0.2);
  }
  EXPECT_GE(MaterialTable::get().rows().size(), 30);
  EXPECT_EQ(groups, (std::set<std::string>{"metal", "glass", "ceramic", "stone", "wood", "plastic", "nature"}));
}

TEST(MaterialTable, lies_within_the_charts_of_each_group) {
  // Ashby, Materials Selection in Mechanical Design, 4th ed., 2011, chapter 4: modulus, density and loss coefficient of the families, and
  // Poisson's ratio, each as [min, max]. Detects wrong powers of ten and exchanged columns.
  struct Chart {
    const char* group;
    double young_gpa[2], density[2], poisson[2], loss[2];
  };
  for (const Chart& chart : {Chart{"metal", {14, 420}, {1700, 19400}, {0.24, 0.45}, {5e-5, 3e-2}},
                             {"glass", {50, 80}, {2100, 3200}, {0.15, 0.25}, {1e-6, 3e-3}},
                             {"ceramic", {10, 420}, {1700, 4100}, {0.15, 0.28}, {1e-5, 2e-2}},
                             {"stone", {3, 100}, {1100, 3000}, {0.1, 0.3}, {1e-3, 3e-2}},
                             {"wood", {0.015, 10}, {100, 1300}, {0.0, 0.4}, {5e-3, 0.2}},
                             {"plastic", {1e-3, 150}, {850, 2300}, {0.29, 0.49999}, {1e-3, 0.3}},
                             {"nature", {5, 25}, {900, 2100}, {0.25, 0.47}, {1e-3, 5e-2}}}) {  // bone: isotropic equivalent
    for (const Row& row : MaterialTable::get().rows()) {
      if (row.group != chart.group) continue;
      SCOPED_TRACE(row.material.name);
      const auto expect_within = [](double x, const double(&range)[2]) {
        EXPECT_GE(x, range[0]);
        EXPECT_LE(x, range[1]);
      };
      const double omega = 2 * std::numbers::pi * 1000;
      expect_within(1e-9 * row.material.young_modulus_pa, chart.young_gpa);
      expect_within(row.material.density_kg_m3, chart.density);
      expect_within(row.material.poisson_ratio, chart.poisson);
      expect_within(2 * row.material.calc_decay_per_s(omega * omega) / omega, chart.loss);
    }
  }
}

TEST(MaterialTable, woods_are_physically_possible) {
  int woods = 0;
  for (const Row& row : MaterialTable::get().rows()) {
    if (!row.material.orthotropic) continue;
    SCOPED_TRACE(row.material.name);
    const auto& [e, g, nu, axes] = *row.material.orthotropic;
    // Compliance [1/E1, -nu12/E1, -nu13/E1; ...]: positive leading minors, by Sylvester's criterion.
    const double s11 = 1 / e[0], s22 = 1 / e[1], s33 = 1 / e[2], s12 = -nu[0] / e[0], s23 = -nu[1] / e[1], s13 = -nu[2] / e[0];
    EXPECT_GT(s11 * s22 - s12 * s12, 0);
    EXPECT_GT(s11 * (s22 * s33 - s23 * s23) - s12 * (s12 * s33 - s23 * s13) + s13 * (s12 * s23 - s22 * s13), 0);
    for (const double shear : g) EXPECT_GT(shear, 0);
    EXPECT_GT(calc_definiteness(row.material.calc_elasticity_pa()), 1e-4);
    if (row.group != "wood") continue;
    ++woods;
    // Over E along the grain (Wood Handbook, table 5-1): tangential 0.015 to 0.09, radial 0.04 to 0.2, rolling shear 0.003 to 0.03; beech
    // 0.034 (Hearmon 1948).
    EXPECT_GT(e[1], e[2]);
    EXPECT_GE(e[2] / e[0], 0.014);
    EXPECT_LE(e[2] / e[0], 0.09);
    EXPECT_GE(e[1] / e[0], 0.04);
    EXPECT_LE(e[1] / e[0], 0.2);
    EXPECT_LE(g[1] / e[0], row.material.name == "beech" ? 0.035 : 0.031);
    EXPECT_EQ(*std::min_element(g.begin(), g.end()), g[1]);
    // Speed of sound along the grain of all woods: 3,500 to 6,000 m/s (Cremer; Wegst 2006); of all but four here 4,000 to 5,400.
    const double speed = std::sqrt(e[0] / row.material.density_kg_m3);
    const bool is_slow = std::set<std::string>{"rosewood", "grenadilla", "pear", "boxwood"}.contains(row.material.name);
    EXPECT_NEAR(speed, is_slow ? 3800 : 4700, is_slow ? 300 : 700) << row.material.name;
    // Q along the grain of woods of instruments: 70 to 200 (Haines 1979; Bremaud 2012).
    const double omega = 2 * std::numbers::pi * 1000, q = omega / (2 * row.material.calc_decay_per_s(omega * omega));
    EXPECT_GE(q, 70);
    EXPECT_LE(q, 200);
  }
  EXPECT_GE(woods, 40);
}

TEST(MaterialTable, has_the_woods_of_instrument_makers_under_their_usual_names) {
  for (const char* name : {"rosewood",
                           "Indian rosewood",
                           "Brazilian rosewood",
                           "Honduras rosewood",
                           "cocobolo",
                           "padauk",
                           "padouk",
                           "bubinga",
                           "wenge",
                           "zebrawood",
                           "purpleheart",
                           "jatoba",
                           "sapele",
                           "koa",
                           "ebony",
                           "grenadilla",
                           "African blackwood",
                           "hard maple",
                           "soft maple",
                           "walnut",
                           "black cherry",
                           "cherry",
                           "ash",
                           "beech",
                           "birch",
                           "pear",
                           "sycamore",
                           "boxwood",
                           "mahogany",
                           "khaya",
                           "alder",
                           "basswood",
                           "poplar",
                           "Sitka spruce",
                           "Engelmann spruce",
                           "Norway spruce",
                           "western red cedar",
                           "cedar",
                           "red oak",
                           "teak"})
    EXPECT_NE(MaterialTable::get().find(name), nullptr) << name;
  // Each name, in any spelling, belongs to one row.
  std::set<std::string> folded;
  for (const Row& row : MaterialTable::get().rows()) {
    std::vector<std::string> names{row.material.name};
    names.insert(names.end(), row.also.begin(), row.also.end());
    for (std::string name : names) {
      std::erase_if(name, [](char c) { return c == ' ' || c == '-' || c == '_'; });
      EXPECT_TRUE(folded.insert(name).second) << name;
    }
  }
  // Density at 12 % moisture [kg/m^3] and bending modulus [GPa] of the sources, 10 % below E along the grain. The Wood Handbook gives
  // oven-dry mass over the volume at 12 %: density is 1.12 of that, to 5 kg/m^3; from birch to basswood, its table in inch-pound units.
  for (const auto& [name, density, bending] : {std::tuple{"rosewood", 830, 11.50},
                                               {"brazilian rosewood", 835, 13.93},
                                               {"honduran rosewood", 1025, 22.0},
                                               {"cocobolo", 1095, 18.7},
                                               {"padauk", 745, 11.72},
                                               {"bubinga", 890, 18.41},
                                               {"wenge", 870, 17.59},
                                               {"zebrawood", 805, 16.37},
                                               {"purpleheart", 905, 20.26},
                                               {"jatoba", 910, 18.93},
                                               {"sapele", 670, 12.04},
                                               {"koa", 610, 10.37},
                                               {"ebony", 1035, 17.20},
                                               {"grenadilla", 1270, 17.95},
                                               {"pear", 690, 7.80},
                                               {"boxwood", 965, 12.27},
                                               {"sycamore", 640, 10.0},
                                               {"american sycamore", 545, 9.791},
                                               {"teak", 655, 12.28},
                                               {"iroko", 660, 10.90},
                                               {"norway spruce", 405, 9.70},
                                               {"engelmann spruce", 390, 8.9},
                                               {"douglas fir", 540, 13.4},
                                               {"cherry", 560, 10.3},
                                               {"ash", 670, 12.0},
                                               {"maple", 705, 12.6},
                                               {"red oak", 705, 12.5},
                                               {"oak", 760, 12.3},
                                               {"yellow poplar", 470, 10.9},
                                               {"birch", 695, 13.86},
                                               {"soft maple", 605, 11.31},
                                               {"alder", 460, 9.51},
                                               {"basswood", 415, 10.07}}) {
    const Material& m = MaterialTable::get().find(name)->material;
    EXPECT_EQ(m.density_kg_m3, density) << name;
    EXPECT_NEAR(m.orthotropic->young_modulus_pa[0] / (1.1e9 * bending), 1, 5e-3) << name;
  }
}

TEST(MaterialTable, has_the_elastic_ratios_of_the_wood_handbook) {
  // Tables 5-1 and 5-2: ET, ER, GLR, GLT, GRT over EL; nu LR, LT, RT. 0: missing, or not compared.
  struct Ratios {
    const char* name;
    double et, er, glr, glt, grt, lr, lt, rt;
  };
  for (const Ratios& r : {Ratios{"maple", 0.065, 0.132, 0.111, 0.063, 0, 0.424, 0.476, 0.774},
                          {"douglas fir", 0.050, 0.068, 0.064, 0.078, 0.007, 0, 0, 0},
                          {"balsa", 0.015, 0.046, 0, 0, 0, 0, 0, 0},
                          {"red oak", 0.082, 0.154, 0, 0, 0, 0, 0, 0},
                          {"oak", 0.072, 0.163, 0, 0, 0, 0, 0, 0}}) {
    const auto& [e, g, nu, axes] = *MaterialTable::get().find(r.name)->material.orthotropic;
    const std::array<std::array<double, 2>, 8> pairs{{{r.et, e[2] / e[0]},
                                                      {r.er, e[1] / e[0]},
                                                      {r.glr, g[0] / e[0]},
                                                      {r.glt, g[2] / e[0]},
                                                      {r.grt, g[1] / e[0]},
                                                      {r.lr, nu[0]},
                                                      {r.lt, nu[2]},
                                                      {r.rt, nu[1]}}};
    for (const auto& [table, ours] : pairs) {
      if (table > 0) {
        EXPECT_NEAR(ours, table, 1e-3) << r.name;
      }
    }
  }
}

TEST(MaterialTable, has_the_known_speeds_of_sound) {
  // Speed of sound in a rod [m/s] from physics tables.
  for (const auto& [name, speed] : {std::pair{"steel", 5050}, {"aluminium", 5090}, {"glass", 5370}, {"lead", 1190}, {"copper", 3740}}) {
    const Material& m = MaterialTable::get().find(name)->material;
    EXPECT_NEAR(std::sqrt(m.young_modulus_pa / m.density_kg_m3) / speed, 1, 0.02) << name;
  }
  const Material& oak = MaterialTable::get().find("oak")->material;
  ASSERT_TRUE(oak.orthotropic);
  EXPECT_NEAR(oak.orthotropic->young_modulus_pa[0], 13.5e9, 0.1e9);
  EXPECT_GT(oak.orthotropic->young_modulus_pa[1], oak.orthotropic->young_modulus_pa[2]) << "radial and tangential";
}

TEST(MaterialTable, ignores_case_and_separators) {
  for (const char* name : {"stainless steel", "Stainless-Steel", "STAINLESS_STEEL", "stainlesssteel"})
    EXPECT_EQ(read('"' + std::string(name) + '"').name, "stainless steel");
  EXPECT_EQ(read("\"PMMA\"").name, "acrylic");
  EXPECT_THAT(find_error("\"aluminim\""),
              testing::AllOf(testing::HasSubstr("/job.json:1"), testing::HasSubstr("did you mean \"aluminium\"?"),
                             testing::HasSubstr("carillon materials")));
  EXPECT_THAT(find_error("\" - \""), testing::HasSubstr("no known material"));
}

TEST(MaterialTable, materials_may_be_overridden) {
  const Material steel = read("\"steel\""), damped = read(R"({"from": "steel", "damping": {"rayleigh": {"alpha2_per_s": 3}}})");
  EXPECT_EQ(damped.young_modulus_pa, steel.young_modulus_pa);
  EXPECT_EQ(damped.law, DampingLaw::rayleigh);
  EXPECT_EQ(damped.alpha2_per_s, 3);
  const Material light =
      read(R"({"from": "steel", "name": "foam", "density_kg_m3": 4000, "young_modulus_pa": 5e10, "poisson_ratio": 0.1})");
  EXPECT_EQ(light.density_kg_m3, 4000);
  EXPECT_EQ(light.poisson_ratio, 0.1);
  EXPECT_EQ(light.tan_phi, steel.tan_phi);
  EXPECT_EQ(light.name, "foam");
  const Material upright = read(R"({"from": "spruce", "axes": [[0, 0, 2], [1, 0, 0]]})"), flat = read("\"spruce\"");
  EXPECT_EQ(upright.orthotropic->axes[0], (std::array<double, 3>{0, 0, 1}));
  EXPECT_EQ(upright.orthotropic->young_modulus_pa, flat.orthotropic->young_modulus_pa);
  EXPECT_NE(upright.calc_elasticity_pa(), flat.calc_elasticity_pa());
  const Material plain = read(R"({"from": "spruce", "young_modulus_pa": 1e10, "poisson_ratio": 0.3})");
  EXPECT_FALSE(plain.orthotropic);
}

TEST(MaterialTable, rejects_invalid_materials) {
  EXPECT_THAT(find_error(R"({"from": "steel", "axes": [[0, 0, 1], [1, 0, 0]]})"), testing::HasSubstr("same in all directions"));
  EXPECT_THAT(find_error(R"({"from": "stel"})"), testing::HasSubstr("did you mean \"steel\"?"));
  EXPECT_THAT(find_error(R"({"from": "steel", "young_modulus_pa": 1e10})"), testing::HasSubstr("poisson_ratio"));
  EXPECT_THAT(find_error(R"({"young_modulus_pa": 1e10, "poisson_ratio": 0.3, "density_kg_m3": 1000})"),
              testing::HasSubstr("\"damping\" is missing"));
  EXPECT_THAT(find_error(R"({"from": "steel", "densty_kg_m3": 4000})"), testing::HasSubstr("density_kg_m3"));
}

MaterialTable read_own(const std::string& text) {
  return MaterialTable::read(base::parse_document(text, "/own.json"), &MaterialTable::get());
}

TEST(MaterialTable, is_extended_by_a_file_that_comes_first) {
  const MaterialTable table = read_own(R"({"materials": [
    {"name": "my bronze", "from": "bronze", "damping": {"internal_friction": {"tan_phi": 1e-4}}},
    {"name": "steel", "also": ["stahl"], "young_modulus_pa": 2.1e11, "poisson_ratio": 0.3, "density_kg_m3": 7800,
     "damping": {"loss_table": [[100, 1e-4], [1000, 2e-4]]}, "loss_source": "own measurement"}]})");
  EXPECT_EQ(table.rows().size(), MaterialTable::get().rows().size() + 2);
  EXPECT_EQ(table.find("my-bronze")->material.tan_phi, 1e-4);
  EXPECT_EQ(table.find("my-bronze")->material.density_kg_m3, 8800);
  EXPECT_EQ(table.find("my-bronze")->place, "/own.json:2");
  EXPECT_EQ(table.find("steel")->material.density_kg_m3, 7800);
  EXPECT_EQ(table.find("Stahl"), table.find("steel"));
  EXPECT_EQ(table.find("brass")->place, "");
}

TEST(MaterialTable, reports_lines_of_user_files) {
  for (const auto& [text, words] : {
           std::pair{R"({"materials": [{"name": "a", "from": "b"}]})", "no known material"},
           {R"({"materials": [{"from": "steel"}]})", "name"},
           {R"({"materials": [{"name": " -", "from": "steel"}]})", "needs a name"},
           {R"({"materials": [{"name": "x", "from": "steel"}, {"name": "X", "from": "steel"}]})", "already defined"},
           {R"({"materials": [{"name": "x", "from": "steel", "colour": 3}]})", "colour"},
           {R"({"material": []})", "materials"},
           {R"({"materials": [{"name": "x", "also": [{}], "from": "steel"}]})", "as texts"},
       }) {
    try {
      read_own(text);
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::StartsWith("/own.json:")) << text;
      EXPECT_THAT(error.what(), testing::HasSubstr(words)) << text;
    }
  }
}

}  // namespace
}  // namespace carillon::material
