// Requests of a page: bodies with edits, blows, plans, and refusals.
#include "runtime/bindings/web/workshop.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "runtime/bank/edits.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/bindings/web/event_words.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::web {
namespace {

constexpr const char* kScene = R"({"duration_s": 10, "bodies": [{"name": "cup", "bank": "bank", "position_m": [1, 2, 3]}]})";

/// A workshop with the bank of a cube as number 1.
Workshop make_workshop(const std::filesystem::path& folder) {
  bank::write_bank(testing::make_cube_bank({{600.0, 4.0, 1.0, {0, 0, 1}, 0.1}, {1310.0, 4.0, 0.5, {0, 1, 0}, 0.2}}), folder / "cube.hdf");
  std::ifstream file(folder / "cube.hdf", std::ios::binary);
  const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
  Workshop workshop(48000.0);
  workshop.add_bank(1, std::as_bytes(std::span(bytes)), "cube.hdf");
  return workshop;
}

TEST(Workshop, edits_give_the_edited_bank) {
  const tests::Folder folder;
  Workshop workshop = make_workshop(folder.path());
  workshop.make_body(4, 1, kScene, R"({"size_scale": 2, "density_scale": 1.5, "damping_scale": 3})");
  const bank::Bank& as_read = workshop.get_bank(1);
  const bank::Bank& played = *workshop.get_body(4).played;
  for (std::size_t m = 0; m < 2; ++m) {
    // lambda' = lambda / (1.5 * 4); Rayleigh's d = alpha2 / 2, three times as much.
    EXPECT_NEAR(played.eigenvalue_rad2_s2[m], as_read.eigenvalue_rad2_s2[m] / 6.0, 1e-9 * as_read.eigenvalue_rad2_s2[m]);
    EXPECT_NEAR(played.decay_per_s[m], 3.0 * as_read.decay_per_s[m], 1e-9);
  }
  EXPECT_NEAR(played.rigid.mass_kg, as_read.rigid.mass_kg * 12.0, 1e-9);
}

TEST(Workshop, bodies_of_one_bank_share_their_surface_through_edits) {
  const tests::Folder folder;
  Workshop workshop = make_workshop(folder.path());
  workshop.make_body(4, 1, kScene, "{}");
  const auto surface = workshop.get_body(4).model->get_surface();
  workshop.make_body(5, 1, kScene, "{}");
  EXPECT_EQ(workshop.get_body(5).model->get_surface(), surface);
  workshop.make_body(4, 1, kScene, R"({"damping_scale": 7, "size_scale": 1.1})");
  EXPECT_EQ(workshop.get_body(4).model->get_surface(), surface);
  workshop.make_body(4, 1, kScene, R"({"size_scale": 0.04})");  // 15 and 33 kHz: one mode less
  EXPECT_NE(workshop.get_body(4).model->get_surface(), surface);
  EXPECT_EQ(workshop.get_body(4).model->get_mode_count(), 1);
}

TEST(Workshop, errors_are_reported_and_change_nothing) {
  const tests::Folder folder;
  Workshop workshop = make_workshop(folder.path());
  workshop.make_body(4, 1, kScene, "{}");
  const auto before = workshop.get_body(4).model;
  const auto say = [&](const char* scene, const char* edits) {
    return tests::catch_message<InputError>([&] { workshop.make_body(4, 1, scene, edits); });
  };
  EXPECT_NE(say(kScene, R"({"siz_scale": 2})").find("size_scale"), std::string::npos);
  EXPECT_NE(say(kScene, R"({"size_scale": 1e9})").find("1e"), std::string::npos);
  EXPECT_NE(say(kScene, R"({"material": "unobtainium"})").find("unobtainium"), std::string::npos);
  EXPECT_NE(say(R"({"duration_s": 10, "bodies": [{"name": "cup", "bank": "bank", "frictio": 1}]})", "{}").find("friction"),
            std::string::npos);
  EXPECT_NE(say(R"({"duration_s": 10, "bodies": []})", "{}").find("bodies"), std::string::npos);
  EXPECT_EQ(workshop.get_body(4).model, before);
  EXPECT_THROW(workshop.make_body(9, 1, kScene, R"({"size_scale": -1})"), InputError);
  EXPECT_THROW((void)workshop.get_body(9), InputError);
  EXPECT_THROW(workshop.make_body(4, 2, kScene, "{}"), InputError);
  EXPECT_THROW((void)workshop.calc_shape(1, 2), InputError);
  EXPECT_THROW((void)workshop.calc_levels(4, 12, {1, 0, 0}), InputError);
  for (const double rate : {0.0, 7999.0, 192001.0, std::nan("")}) EXPECT_THROW(Workshop{rate}, InputError) << rate;
}

TEST(Workshop, a_ping_excites_its_mode_to_the_requested_pressure) {
  const tests::Folder folder;
  Workshop workshop = make_workshop(folder.path());
  workshop.make_body(4, 1, kScene, "{}");
  std::vector<double> words;
  workshop.make_ping(4, 1, 0.02, 6, words);
  int count = 0;
  read_words(words, [&](const events::Event& event, Timing timing) {
    ++count;
    const auto& impulse = std::get<events::Impulse>(event);
    EXPECT_EQ(impulse.body, 6);
    EXPECT_EQ(timing, Timing::kSoon);
    const bank::Bank& b = *workshop.get_body(4).played;
    const std::vector<double> shape = bank::calc_shapes(b, impulse.triangle, impulse.barycentric);
    const double velocity = shape[3] * impulse.impulse_n_s[0] + shape[4] * impulse.impulse_n_s[1] + shape[5] * impulse.impulse_n_s[2];
    EXPECT_NEAR(std::abs(b.radiation_gain[1] * velocity), 0.02, 1e-4 * 0.02);
  });
  EXPECT_EQ(count, 1);
}

TEST(Workshop, a_blow_conserves_momentum) {
  const tests::Folder folder;
  Workshop workshop = make_workshop(folder.path());
  workshop.make_body(4, 1, kScene, "{}");
  const std::string scene =
      R"({"duration_s": 10, "bodies": [{"name": "cup", "bank": "bank"}], "strikes": [{"time_s": 1, "body": "cup", "triangle": 0, "mallet": {"from": "rubber", "speed_m_s": 2}}]})";
  std::vector<double> words;
  base::Document blow = base::parse_document(workshop.make_blow(4, scene, 3, {0.2, 0.3, 0.5}, std::nullopt, 0, words), "blow");
  base::Object said = blow.root();
  const double impulse = said.number("impulse_n_s"), before = said.number("before_j"), after = said.number("after_j");
  // The head of 20 g arrives at 2 m/s and leaves with the remaining momentum.
  const double leaves = 2.0 - impulse / 0.020;
  EXPECT_NEAR(before, 0.5 * 0.020 * 4.0, 1e-9);
  EXPECT_NEAR(after, 0.5 * 0.020 * leaves * leaves, 1e-6);
  Vec3 sum{};
  read_words(words, [&](const events::Event& event, Timing) { sum = sum + events::calc_impulse(std::get<events::Force>(event)); });
  EXPECT_NEAR(norm(sum), impulse, 1e-5 * impulse);
}

}  // namespace
}  // namespace carillon::web
