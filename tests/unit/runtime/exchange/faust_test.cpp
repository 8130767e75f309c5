// Selection of modes and points of a Faust program, and the omitted energy. Its sound: tests/system/exchange.
#include "runtime/exchange/faust.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::exchange {
namespace {

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

TEST(Faust, has_the_loudest_modes_and_states_the_rest) {
  // Three modes that differ in gain only: two of them omit 1 / (1 + 4 + 100) of the energy.
  const auto make = [](double freq, double gain) { return testing::InventedMode{freq, 10.0, gain, {0.0, 0.0, 1.0}}; };
  const bank::Bank bank = testing::make_cube_bank({make(1000.0, 1e-3), make(1000.001, 2e-3), make(1000.002, 1e-2)});
  const FaustProgram program =
      make_faust(bank, {.name = "cube", .modes = 2, .points_m = {{0.0, 0.0, 0.06}}, .radiation = radiation::GainKind::kOsg02});
  EXPECT_EQ(program.modes, 2);
  EXPECT_EQ(count(program.text, "  swing("), 2);
  EXPECT_THAT(program.text, ::testing::Not(::testing::HasSubstr("swing(1000, ")));
  EXPECT_NEAR(program.left_out_db, -10.0 * std::log10(105.0), 0.01);
  EXPECT_NEAR(program.points_m[0][2], 0.05, 1e-12);
  const FaustProgram all = make_faust(bank, {.modes = 9, .points_m = {{0.0, 0.0, 0.06}}});
  EXPECT_EQ(all.modes, 3);
  EXPECT_TRUE(std::isinf(all.left_out_db));
}

TEST(Faust, includes_overdamped_modes) {
  bank::Bank bank = testing::make_cube_bank({{100.0, 900.0, 0.02}, {200.0, 400.0 * M_PI, 0.02}, {820.0, 12.0, 0.3}});
  const FaustProgram program = make_faust(bank, {.point_count = 2});
  EXPECT_EQ(count(program.text, "  creep("), 1);
  EXPECT_EQ(count(program.text, "  swing("), 2);  // including the critical one
}

TEST(Faust, names_are_sanitised) {
  const FaustProgram program = make_faust(testing::make_cube_bank({{820.0, 12.0, 0.3}}), {.name = "a\"; process = 1;\n\\"});
  EXPECT_THAT(program.text, ::testing::HasSubstr("declare name \"a_; process = 1;__\";\n"));
}

TEST(Faust, rejects_silent_requests) {
  EXPECT_THROW(make_faust(testing::make_cube_bank({}), {}), InputError);
  EXPECT_THROW(make_faust(testing::make_cube_bank({{820.0, 12.0, 0.3}}), {.modes = 0}), InputError);
  EXPECT_THROW(make_faust(testing::make_cube_bank({{820.0, 12.0, 0.3}}), {.points_m = std::vector<Vec3>(65)}), InputError);
  EXPECT_THROW(make_faust(testing::make_cube_bank({{820.0, 12.0, 0.3}}), {.points_m = {{9.0, 9.0, 9.0}}}), InputError);
}

}  // namespace
}  // namespace carillon::exchange
