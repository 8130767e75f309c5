#include "runtime/render/report.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "runtime/base/document.hpp"

namespace carillon::render {
namespace {

class Report : public ::testing::Test {
 protected:
  Report() {
    scene_.file = "/scene.json";
    scene_.duration_s = 2.0;
    for (const char* name : {"ball", "gong"}) scene_.bodies.emplace_back().name = name;
  }

  scene::Scene scene_;
};

TEST_F(Report, PairsAreNamedWithGroundOrNone) {
  EXPECT_EQ(describe_pair(scene_, 0, 1), "'ball' and 'gong'");
  EXPECT_EQ(describe_pair(scene_, 1, -1), "'gong' and the ground");
  EXPECT_EQ(describe_pair(scene_, -1, -1), "none");
}

TEST_F(Report, ContactWarningsHaveThresholds) {
  physics::ContactAudit contacts;
  physics::EnergyAudit energy;
  energy.kinetic_j = 1.0;
  contacts.unexplained = {.body = 0, .other = -1, .unexplained_m = 0.9e-4, .thickness_m = 1.0};
  energy.lifted_j = 0.009;
  contacts.busiest = {.body = 0, .other = 1, .per_s = 499.0};
  EXPECT_TRUE(list_contact_warnings(scene_, contacts, energy).empty());
  contacts.unexplained.unexplained_m = 1.1e-4;
  energy.lifted_j = 0.011;
  contacts.busiest.per_s = 501.0;
  const std::vector<std::string> warnings = list_contact_warnings(scene_, contacts, energy);
  ASSERT_EQ(warnings.size(), 3u);
  EXPECT_NE(warnings[0].find("'ball' and the ground were 0.11 mm"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[1].find("0.011 J, 1.1 %"), std::string::npos) << warnings[1];
  EXPECT_NE(warnings[2].find("'ball' and 'gong' struck each other 501 times"), std::string::npos) << warnings[2];
}

TEST_F(Report, ModalEnergyOfTheSoundIsDeductedFromLossesOfThePhysicsOnly) {
  physics::EnergyAudit physics;
  physics.start_j = 10.0, physics.lost_j = 4.0, physics.modes_j = 1.0, physics.max_modes_j = 2.0;
  Sound sound;
  sound.mode_energy.held_j = 3.0, sound.max_modes_j = 5.0, sound.energy_rise = 1e-9;
  const EnergyBooks books = make_books(scene_, physics, sound);
  EXPECT_DOUBLE_EQ(books.bodies.modes_j, 3.0);
  EXPECT_DOUBLE_EQ(books.bodies.max_modes_j, 5.0);
  EXPECT_DOUBLE_EQ(books.bodies.lost_j, 2.0);
  EXPECT_DOUBLE_EQ(books.modes_rise, 1e-9);
  physics.start_j = 0.0;  // contacts file
  EXPECT_DOUBLE_EQ(make_books(scene_, physics, sound).bodies.lost_j, 4.0);
  physics.start_j = 10.0;
  scene_.strikes.emplace_back();
  EXPECT_DOUBLE_EQ(make_books(scene_, physics, sound).bodies.lost_j, 4.0);
  sound.mode_energy.held_j = 0.5;
  EXPECT_DOUBLE_EQ(make_books(scene_, physics, sound).bodies.modes_j, 1.0);
}

TEST_F(Report, JsonHasAuditAndMalletsOnRequestAndNullForSilence) {
  scene_.bodies.clear();
  scene_.warnings.push_back("a warning");
  Sound sound;
  sound.levels.mean_db = sound.levels.loudest_db = -std::numeric_limits<double>::infinity();
  effects::SceneFacts facts;
  facts.microphones_m = {{0.0, 0.0, 0.0}};
  const scene::Plan plan{facts, effects::EffectSelector(facts)};
  Figures figures;
  const auto read = [&] { return make_report_json(scene_, sound, plan, figures); };
  const std::string plain = read();
  EXPECT_NE(plain.find("\"mean_db_spl\": null"), std::string::npos) << plain;
  EXPECT_NE(plain.find("a warning"), std::string::npos) << plain;
  for (const char* key : {"energy", "depth_and_hits", "mallets", "recordings"})
    EXPECT_EQ(plain.find('"' + std::string(key) + '"'), std::string::npos) << key;
  figures.audit.emplace();
  figures.blows.emplace_back();
  base::Object report = base::parse_document(read(), "/report.json").root();
  for (const char* key : {"energy", "depth_and_hits", "mallets"}) EXPECT_TRUE(report.has(key)) << key;
}

}  // namespace
}  // namespace carillon::render
