// Supports in jobs and scenes.
#include "runtime/material/supports.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/base/printable.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::material {
namespace {

using testing::HasSubstr;

std::optional<Fixing> read_supports(const std::string& members) {
  base::Object object = base::parse_document("{" + members + "}", "test.json").root();
  const auto fixing = read_fixing(object);
  object.finish();
  return fixing;
}

std::string fail(const std::string& members) {
  return tests::catch_message<InputError>([&] { read_supports(members); });
}

/// Input of read_supports().
std::string write_members(const Fixing& fixing) {
  const std::string object = write_fixing(fixing).line();
  return object.substr(1, object.size() - 2);
}

TEST(Words, of_all_names_read_back) {
  for (const std::string& wall : list_base_names()) {
    for (const std::string& joint : list_joint_names()) {
      const auto fixing = read_supports("\"on\": " + base::quote(wall) + ", \"joint\": " + base::quote(joint));
      ASSERT_TRUE(fixing);
      EXPECT_EQ(write_fixing(*read_supports(write_members(*fixing))).line(), write_fixing(*fixing).line());
      EXPECT_EQ(fixing->joint, joint);
      EXPECT_GT(fixing->joint_loss, 0.0);
      EXPECT_THAT(describe(*fixing), HasSubstr(wall));
    }
  }
}

TEST(Words, of_numbers_read_back_exactly) {
  const auto wall =
      read_supports(R"("on": {"young_modulus_pa": 1.23456789012345e10, "density_kg_m3": 1801, "thickness_m": 0.2401}, "loss": 0.0123)");
  ASSERT_TRUE(wall);
  EXPECT_EQ(wall->base.kind, BaseKind::kPlate);
  const auto again = read_supports(write_members(*wall));
  EXPECT_EQ(again->base.young_modulus_pa, 1.23456789012345e10);
  EXPECT_EQ(again->base.thickness_m, 0.2401);
  EXPECT_EQ(again->joint_loss, 0.0123);
  const auto lumped = read_supports(R"("on": {"mass_kg": 0.3, "damping_n_s_m": 7, "stiffness_n_m": 1e6, "loss_factor": 0.1})");
  EXPECT_EQ(read_supports(write_members(*lumped))->base.stiffness_n_m, 1e6);
}

TEST(Words, missing_give_nothing) {
  EXPECT_FALSE(read_supports(""));
  EXPECT_EQ(write_fixing(Fixing{}).line(), "{}");
  EXPECT_EQ(write_fixing(*read_supports(R"("on": "rigid")")).line(), "{}");
}

TEST(Words, invalid_are_rejected_with_a_suggestion) {
  EXPECT_THAT(fail(R"("on": "brik wall")"), HasSubstr("did you mean \"brick wall\"?"));
  EXPECT_THAT(fail(R"("on": "felt")"), HasSubstr("\"held\""));
  EXPECT_THAT(fail(R"("joint": "nailed")"), HasSubstr("screwed"));
  EXPECT_THAT(fail(R"("joint": "glued", "loss": 0.1)"), HasSubstr("keep one of them"));
  EXPECT_THAT(fail(R"("loss": -0.1)"), HasSubstr("from 0 to 1"));
  EXPECT_THAT(fail(R"("loss": 1.1)"), HasSubstr("from 0 to 1"));
  EXPECT_THAT(fail(R"("on": {})"), HasSubstr("an impedance of 0"));
  EXPECT_THAT(fail(R"("on": {"stiffness_n_m": -1})"), HasSubstr("stiffness_n_m"));
  EXPECT_THAT(fail(R"("on": {"young_modulus_pa": 1e9, "density_kg_m3": 2000})"), HasSubstr("thickness_m"));
  EXPECT_THAT(fail(R"("on": {"stifness_n_m": 1})"), HasSubstr("stifness_n_m"));
}

}  // namespace
}  // namespace carillon::material
