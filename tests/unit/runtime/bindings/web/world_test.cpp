// The physics of a page: rows of numbers in, event rows out.
#include "runtime/bindings/web/world.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <span>
#include <variant>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/bindings/web/event_words.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::web {
namespace {

const std::vector<double> kWorld{0, 0, -9.81, 1, 0, 30e9, 0.2, 0.5, 0.5, 1e-3, 2400, 20e-6, 1, 1};

std::vector<double> make_body(double height_m, bool is_fixed, bool is_absent) {
  return {0, 0, height_m, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.3, 0.4, 1e-3, 2e-6, is_fixed ? 1.0 : 0.0, is_absent ? 1.0 : 0.0};
}

class PageWorldTest : public ::testing::Test {
 protected:
  void SetUp() override {
    bank::write_bank(testing::make_cube_bank({{600.0, 4.0, 1.0, {0, 0, 1}, 0.1}}), folder_.path() / "cube.hdf");
    std::ifstream file(folder_.path() / "cube.hdf", std::ios::binary);
    const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
    world_.add_bank(1, std::as_bytes(std::span(bytes)), "cube.hdf");
  }

  tests::Folder folder_;
  PageWorld world_;
};

TEST_F(PageWorldTest, EventsOfAFallAsRows) {
  EXPECT_EQ(world_.add_body(1, make_body(3.0, false, false), "cube"), 0);
  EXPECT_EQ(world_.add_body(1, make_body(0.0, false, true), "spare"), 1);
  world_.start(kWorld);
  std::vector<double> words;
  EXPECT_NEAR(world_.advance(0.3, words), 0.3, 1e-9);
  double last_m = 0.0, last_s = 0.0;
  read_words(words, [&](const events::Event& event, Timing timing) {
    EXPECT_EQ(timing, Timing::kExact);
    const auto* motion = std::get_if<events::BodyMotion>(&event);
    if (motion != nullptr && motion->body == 0) last_m = motion->position_m[2], last_s = motion->time_s;
  });
  const double start_m = 3.0 + world_.get_world().get_centre(0)[2] - world_.get_world().get_pose(0).position_m[2];
  EXPECT_NEAR(last_m, start_m - 0.5 * 9.81 * last_s * last_s, 1e-9);
  EXPECT_TRUE(world_.get_world().is_absent(1));
}

TEST_F(PageWorldTest, RefusesWhatItCannotUse) {
  std::vector<double> words;
  EXPECT_THROW(world_.advance(1.0, words), InputError) << "has not started";
  EXPECT_THROW(world_.add_body(2, make_body(3.0, false, false), "cube"), InputError) << "no such bank";
  EXPECT_THROW(world_.add_body(1, std::vector<double>(18, 1.0), "cube"), InputError) << "too few numbers";
  EXPECT_THROW(world_.start(std::vector<double>(3, 0.0)), InputError) << "too few numbers";
  world_.start(kWorld);
  EXPECT_THROW(world_.add_body(1, make_body(3.0, false, false), "cube"), InputError) << "too late";
}

}  // namespace
}  // namespace carillon::web
