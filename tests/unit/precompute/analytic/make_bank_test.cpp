// Banks of bodies with known modes: valid, complete, with the body's data.
#include "precompute/analytic/make_bank.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/analytic/bodies.hpp"

namespace carillon::analytic {
namespace {

using testing::HasSubstr;

const std::vector<std::string> kBodies{
    R"({"string": {"length_m": 0.65, "tension_n": 70, "diameter_m": 0.001}})",
    R"({"string": {"length_m": 0.65, "lowest_hz": 200, "mass_kg_m": 1e-3}})",
    R"({"beam": {"length_m": 0.4, "width_m": 0.03, "thickness_m": 0.01}})",
    R"({"beam": {"length_m": 0.4, "diameter_m": 0.01, "ends": ["clamped", "free"]}})",
    R"({"beam": {"length_m": 0.4, "diameter_m": 0.01, "ends": ["free", "hinged"], "theory": "timoshenko"}})",
    R"({"beam": {"length_m": 0.4, "width_m": 0.03, "thickness_m": 0.03, "ends": "sliding"}})",
    R"({"membrane": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.02, "tension_n_m": 1000, "thickness_m": 2e-4}})",
    R"({"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 150, "density_kg_m2": 0.3}})",
    R"({"membrane": {"shape": "L", "side_m": 0.3, "lowest_hz": 500, "density_kg_m2": 0.3}})",
    R"({"membrane": {"shape": "polygon", "corners_m": [[0, 0], [0.5, 0.1], [0.3, 0.4], [0.1, 0.2]], "lowest_hz": 600, "density_kg_m2": 0.3}})",
    R"({"plate": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.002}})",
    R"({"plate": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.002, "edges": "hinged"}})",
    R"({"plate": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.002, "edges": ["clamped", "free", "hinged", "sliding"]}})",
    R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 0.002, "edges": "free"}})",
    R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 0.002, "edges": "sliding"}})"};

TEST(KnownBanks, are_sane_whatever_the_band) {
  for (const std::string& body : kBodies)
    for (const std::string more : {R"(, "band_hz": [20, 2000])", R"(, "band_hz": [900, 1500])",
                                   R"(, "band_hz": [20, 4000], "max_modes": 7)", R"(, "band_hz": [1, 2])"}) {
      const Made made = make_bank(parse(body, R"("steel")", more));
      const std::vector<std::string> faults = bank::find_faults(made.bank);
      EXPECT_TRUE(faults.empty()) << body << more << ": " << faults[0];
      EXPECT_EQ(made.names.size(), made.bank.mode_count());
      EXPECT_FALSE(made.theory.empty());
    }
}

TEST(KnownBanks, that_meet_at_a_mode_hold_every_mode_once) {
  // Bands split at a mode and between two: every mode is in exactly one part.
  for (const std::string& body : {kBodies[0], kBodies[7], kBodies[10]}) {
    const auto count = [&](double low, double high) {
      return make_bank(parse(body, R"("steel")", ", \"band_hz\": [" + std::to_string(low) + ", " + std::to_string(high) + "]"))
          .bank.mode_count();
    };
    const std::vector<ModeAtPoint> all = calc_modes_at(parse(body, R"("steel")", R"(, "band_hz": [20, 3000])"), {0.1, 0.1, 0});
    ASSERT_GT(all.size(), 6u);
    for (std::size_t i = 2; i < 6; ++i)
      if (all[i].freq_hz > 1.001 * all[i - 1].freq_hz) {
        const double cut = 0.9995 * all[i].freq_hz;
        EXPECT_EQ(count(20, cut) + count(cut, 3000), all.size());
      }
  }
}

TEST(KnownBanks, hold_the_shapes_of_the_body_to_their_steps) {
  for (const std::string& body : kBodies) {
    const job::JobSpec job = parse(body, R"("steel")", R"(, "band_hz": [20, 3000], "max_modes": 20)");
    const bank::Bank bank = make_bank(job).bank;
    for (const std::size_t v : {std::size_t{0}, bank.vertex_count() / 3, bank.vertex_count() - 1}) {
      const std::vector<ModeAtPoint> at = calc_modes_at(job, bank.vertices_m[v]);
      for (std::size_t m = 0; m < bank.mode_count(); ++m) {
        EXPECT_NEAR(at[m].freq_hz / bank.freq_hz(m), 1.0, 1e-12);
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(at[m].phi[c], bank.shape_at(v, m)[c], 0.51 * bank.shape_scale[m]) << body << m;
      }
    }
  }
}

TEST(KnownBanks, weigh_what_the_body_weighs) {
  const bank::Bank disc = make_bank(parse(R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 0.002}})")).bank;
  EXPECT_NEAR(disc.rigid.mass_kg / (7850 * std::numbers::pi * 0.04 * 0.002), 1.0, 2e-3);  // its rim is a polygon
  const bank::Bank rod = make_bank(parse(R"({"beam": {"length_m": 0.4, "diameter_m": 0.01}})")).bank;
  EXPECT_NEAR(rod.rigid.mass_kg / (7850 * std::numbers::pi * 25e-6 * 0.4), 1.0, 1e-12);
  EXPECT_NEAR(rod.rigid.inertia_kg_m2[8] / (rod.rigid.mass_kg * (0.16 / 12 + 25e-6 / 4)), 1.0, 1e-12);
  const bank::Bank drum =
      make_bank(parse(R"({"membrane": {"shape": "rectangle", "length_m": 1, "width_m": 0.5, "lowest_hz": 90, "density_kg_m2": 0.3}})",
                      R"("steel")", R"(, "max_modes": 5)"))
          .bank;
  EXPECT_NEAR(drum.rigid.mass_kg, 0.15, 1e-12);
  EXPECT_NEAR(drum.rigid.inertia_kg_m2[4] / (0.15 / 12), 1.0, 1e-4);
}

TEST(KnownBanks, too_large_are_refused_before_they_are_made) {
  tests::expect_error<InputError>({"make a bank of"}, [&] {
    (void)make_bank(
        parse(R"({"membrane": {"shape": "rectangle", "length_m": 1, "width_m": 1, "lowest_hz": 200, "density_kg_m2": 0.3}, "grid": 400})"));
  });
  EXPECT_THROW(make_bank(parse(R"({"plate": {"shape": "rectangle", "length_m": 10, "width_m": 10, "thickness_m": 0.001}})")), InputError);
  EXPECT_THROW(make_bank(parse(R"({"plate": {"shape": "circle", "radius_m": 1000, "thickness_m": 0.001}})")), InputError);
}

TEST(KnownBanks, with_max_modes_hold_the_lowest_however_wide_the_band) {
  for (const char* body :
       {R"({"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 110, "thickness_m": 0.00025}})",
        R"({"membrane": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "lowest_hz": 110, "thickness_m": 0.00025}})",
        R"({"membrane": {"shape": "rectangle", "length_m": 1, "width_m": 0.001, "lowest_hz": 110, "thickness_m": 0.00025}})",
        R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 0.0001}})",
        R"({"string": {"length_m": 1, "tension_n": 50, "mass_kg_m": 1e-3, "diameter_m": 0.0004}})"}) {
    const bank::Bank wide = make_bank(parse(body, R"("steel")", R"(, "band_hz": [20, 3e6], "max_modes": 30)")).bank,
                     narrow = make_bank(parse(body, R"("steel")", R"(, "band_hz": [20, 2500], "max_modes": 30)")).bank;
    ASSERT_EQ(wide.mode_count(), 30U) << body;
    ASSERT_EQ(narrow.mode_count(), 30U) << body;
    EXPECT_EQ(wide.eigenvalue_rad2_s2, narrow.eigenvalue_rad2_s2) << body;
    EXPECT_FALSE(wide.complete);
  }
}

TEST(KnownBanks, say_where_the_theory_is_not_the_body) {
  const auto warnings = make_bank(parse(R"({"beam": {"length_m": 0.2, "width_m": 0.03, "thickness_m": 0.03}})")).warnings;
  ASSERT_FALSE(warnings.empty());
  EXPECT_THAT(warnings[0], HasSubstr("timoshenko"));
  EXPECT_THAT(make_bank(parse(R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 0.02}})")).warnings.at(0),
              HasSubstr("Kirchhoff"));
  EXPECT_TRUE(make_bank(parse(R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 0.001}})", R"("steel")",
                              R"(, "band_hz": [20, 2000])"))
                  .warnings.empty());
}

std::string find_fault(const std::string& text) {
  return tests::catch_message<InputError>([&] { (void)job::parse_job(text, "/tmp/j.json"); });
}

TEST(KnownJobs, that_are_wrong_are_refused_in_words) {
  const auto fault = [](const std::string& body, const std::string& more = "") {
    return find_fault(R"({"bank": "b.hdf", "material": "steel", "body": )" + body + more + "}");
  };
  EXPECT_THAT(fault(R"({"string": {"length_m": 1, "mass_kg_m": 1e-3}})"), HasSubstr(R"(give one of "tension_n" and "lowest_hz")"));
  EXPECT_THAT(fault(R"({"string": {"length_m": 1, "tension_n": 5}})"), HasSubstr("mass_kg_m"));
  EXPECT_THAT(fault(R"({"string": {"length_m": 1, "tension_n": 5, "diameter_m": 0.9}})"), HasSubstr("too thick for a string"));
  EXPECT_THAT(fault(R"({"beam": {"length_m": 1, "width_m": 0.1}})"), HasSubstr("section"));
  EXPECT_THAT(fault(R"({"beam": {"length_m": 1, "width_m": 0.1, "thickness_m": 0.9}})"), HasSubstr("beam theory"));
  EXPECT_THAT(fault(R"({"beam": {"length_m": 1, "diameter_m": 0.1, "ends": ["free"]}})"), HasSubstr("one word for all, or 2"));
  EXPECT_THAT(fault(R"({"beam": {"length_m": 1, "diameter_m": 0.1, "ends": "loose"}})"), HasSubstr("sliding"));
  EXPECT_THAT(fault(R"({"membrane": {"shape": "L", "side_m": 1, "tension_n_m": 5}})"), HasSubstr("density_kg_m2"));
  EXPECT_THAT(fault(R"({"membrane": {"shape": "polygon", "corners_m": [[0,0],[1,1],[1,0],[0,1]], "tension_n_m": 5, "density_kg_m2": 1}})"),
              HasSubstr("cross"));
  EXPECT_THAT(fault(R"({"membrane": {"shape": "polygon", "corners_m": [[0,0],[1,0],[2,0]], "tension_n_m": 5, "density_kg_m2": 1}})"),
              HasSubstr("corners_m"));
  EXPECT_THAT(fault(R"({"membrane": {"shape": "polygon", "corners_m": [[0,0],[1,0],[1,0],[0,1]], "tension_n_m": 5, "density_kg_m2": 1}})"),
              HasSubstr("one point"));
  EXPECT_THAT(fault(R"({"plate": {"shape": "circle", "radius_m": 0.1, "thickness_m": 0.1}})"), HasSubstr("plate theory"));
  EXPECT_THAT(fault(R"({"modes_csv": "x.csv", "mass_kg": 1, "size_m": [1, 0, 1]})"), HasSubstr("size_m"));
  EXPECT_THAT(fault(R"({"modes_csv": {"file": "x.csv", "mass_kg": 1, "size_m": [1, 1, 1]}})"), HasSubstr(R"({"modes_csv": "modes.csv", )"));
  EXPECT_THAT(fault(R"({"string": {"length_m": 1}, "shape": "bar"})"), HasSubstr("already"));
  EXPECT_THAT(fault(R"({"string": {"length_m": 1, "tension_n": 5, "mass_kg_m": 1}})", R"(, "element": "T4")"),
              HasSubstr("for finite elements"));
  EXPECT_THAT(fault(R"({"string": {"length_m": 1, "tension_n": 5, "mass_kg_m": 1, "mass_kg": 3}})"), HasSubstr("mass_kg"));
}

TEST(KnownJobs, resolve_to_themselves) {
  for (const std::string& body : kBodies) {
    const job::JobSpec job = parse(body, R"("steel")", R"(, "max_modes": 9)");
    const std::string text = job::resolved_json(job, "/tmp", "");
    EXPECT_EQ(job::resolved_json(job::parse_job(text, "/tmp/job.json"), "/tmp", ""), text);
  }
}

TEST(KnownJobs, bring_a_material_where_none_is_given) {
  const auto read = [](const std::string& body, const std::string& more = "") {
    return job::parse_job(R"({"bank": "b.hdf", "body": )" + body + more + "}", "/tmp/j.json").material;
  };
  EXPECT_EQ(read(kBodies[0]).name, "steel");
  EXPECT_EQ(read(kBodies[7]).name, "polyester film");
  const material::Material damped = read(kBodies[7], R"(, "material": {"damping": {"internal_friction": {"tan_phi": 0.02}}})");
  EXPECT_EQ(damped.tan_phi, 0.02);
  EXPECT_EQ(damped.density_kg_m3, read(kBodies[7]).density_kg_m3);
  EXPECT_THAT(find_fault(R"({"bank": "b.hdf", "body": )" + kBodies[10] + "}"), HasSubstr("material"));
}

}  // namespace
}  // namespace carillon::analytic
