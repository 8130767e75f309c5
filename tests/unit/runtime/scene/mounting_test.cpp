// Supports of bodies in scenes: summaries, banks, and warnings.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "runtime/scene/banks.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::scene {
namespace {

namespace fs = std::filesystem;

/// A folder with a bank with one support, "end", rigid by default, and a bank of a free body.
class Mounting : public ::testing::Test {
 protected:
  Mounting() {
    fs::create_directories(folder_);
    bank::write_bank(bank::example::make_bank(), folder_ / "free.hdf");
    bank::Bank fixed = bank::example::make_bank();
    const std::size_t modes = fixed.mode_count();
    fixed.supports = {R"({"supports": [{"name": "end"}]})", {{0.05, -0.09, 0.205}}, {{-1, 0, 0}}, {2e-4}, {0.01}, {},
                      std::vector<double>(modes, 0.2)};
    for (std::size_t m = 0; m < modes; ++m)
      for (int k = 0; k < 6; ++k) fixed.supports.reaction.push_back(k < 3 ? 500.0 : 5.0);
    bank::write_bank(fixed, folder_ / "fixed.hdf");
  }
  ~Mounting() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  Scene parse(const std::string& bodies) const {
    return parse_scene(base::parse_document("{\"duration_s\": 1,\n\"bodies\": [" + bodies + "]}", folder_ / "scene.json"));
  }
  std::string fail(const std::string& bodies) const {
    return tests::catch_message<InputError>([&] {
      Scene scene = parse(bodies);
      read_banks(scene);
    });
  }

  fs::path folder_ = fs::temp_directory_path() / ("carillon-mounting-" + std::to_string(getpid()));
};

TEST_F(Mounting, DefaultIsTheBankBitByBit) {
  Scene scene = parse(R"({"name": "a", "bank": "fixed.hdf", "fixed": true}, {"name": "b", "bank": "free.hdf"})");
  const Banks banks = read_banks(scene);
  const bank::Bank file = bank::read_bank(folder_ / "fixed.hdf");
  EXPECT_EQ(scene.bodies[0].spec.bank->decay_per_s, file.decay_per_s);
  EXPECT_EQ(scene.bodies[0].spec.bank->eigenvalue_rad2_s2, file.eigenvalue_rad2_s2);
  for (const SceneBody& body : scene.bodies) EXPECT_TRUE(body.mounting.text.empty());
  EXPECT_TRUE(scene.warnings.empty());
}

TEST_F(Mounting, BodiesOfOneBankHaveOwnDecaysAndShareEqualOnes) {
  Scene scene = parse(R"({"name": "a", "bank": "fixed.hdf"}, {"name": "b", "bank": "fixed.hdf", "on": "brick wall"},
    {"name": "c", "bank": "fixed.hdf", "on": "brick wall", "joint": "screwed"}, {"name": "d", "bank": "fixed.hdf", "on": "brick wall"},
    {"name": "e", "bank": "fixed.hdf", "supports": {"end": {"loss": 0.1}}})");
  const Banks banks = read_banks(scene);
  EXPECT_EQ(banks.size(), 4U);
  const auto get = [&](int body) -> const bank::Bank& { return *scene.bodies[body].spec.bank; };
  EXPECT_EQ(&get(1), &get(3));
  for (std::size_t m = 0; m < get(0).mode_count(); ++m) {
    EXPECT_LT(get(0).decay_per_s[m], get(1).decay_per_s[m]);
    EXPECT_LT(get(1).decay_per_s[m], get(2).decay_per_s[m]);
    EXPECT_DOUBLE_EQ(get(4).decay_per_s[m] - get(0).decay_per_s[m], 0.5 * 0.1 * 0.2 * std::sqrt(get(0).eigenvalue_rad2_s2[m]));
  }
  EXPECT_NE(scene.bodies[3].mounting.text.find("end on brick wall, T60 at"), std::string::npos) << scene.bodies[3].mounting.text;
  EXPECT_EQ(scene.bodies[3].mounting.decay_per_s, get(3).decay_per_s);
  EXPECT_EQ(scene.bodies[3].mounting.decay_before_per_s, get(0).decay_per_s);
}

TEST_F(Mounting, FreeBodyIsHeldAtPoints) {
  Scene scene = parse(R"({"name": "a", "bank": "free.hdf"},
    {"name": "b", "bank": "free.hdf", "held": [{"by": "cord", "point_m": [0.05, -0.1, 0.2]}, {"by": {"damping_n_s_m": 1}, "point_m": [0.3, -0.1, 0.2]}]})");
  const Banks banks = read_banks(scene);
  for (std::size_t m = 0; m < scene.bodies[0].spec.bank->mode_count(); ++m)
    EXPECT_LT(scene.bodies[0].spec.bank->decay_per_s[m], scene.bodies[1].spec.bank->decay_per_s[m]);
  EXPECT_NE(scene.bodies[1].mounting.text.find("held by cord"), std::string::npos);
}

TEST_F(Mounting, BeyondFirstOrderIsOneWarningPerBank) {
  Scene scene = parse(
      R"({"name": "a", "bank": "fixed.hdf", "on": {"stiffness_n_m": 1}}, {"name": "b", "bank": "fixed.hdf", "on": {"stiffness_n_m": 1}})");
  read_banks(scene);
  ASSERT_EQ(scene.warnings.size(), 1U);
  EXPECT_NE(scene.warnings[0].find("first order"), std::string::npos);
}

TEST_F(Mounting, InvalidSupportIsRefusedWithItsLine) {
  const auto expect = [&](const std::string& body, const std::string& words) {
    const std::string said = fail(body);
    EXPECT_NE(said.find(words), std::string::npos) << said;
    EXPECT_NE(said.find("scene.json:2"), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  };
  expect(R"({"name": "a", "bank": "free.hdf", "on": "brick wall"})", "no supports");
  expect(R"({"name": "a", "bank": "fixed.hdf", "supports": {"ent": {"loss": 0.1}}})", "did you mean \"end\"?");
  expect(R"({"name": "a", "bank": "fixed.hdf", "supports": {"end": {}}})", R"(is empty; give "on", "joint" or "loss")");
  expect(R"({"name": "a", "bank": "free.hdf", "held": "cord"})", "\"point_m\": [x, y, z]");
  expect(R"({"name": "a", "bank": "free.hdf", "held": {"by": "rope", "point_m": [0, 0, 0]}})", "cord");
  expect(R"({"name": "a", "bank": "free.hdf", "held": {"by": "cord"}})", "point_m");
  expect(R"({"name": "a", "bank": "fixed.hdf", "on": "brick wall", "joont": "screwed"})", "joint");
}

}  // namespace
}  // namespace carillon::scene
