// Events as rows of numbers: round trip, and refusal of malformed rows.
#include "runtime/bindings/web/event_words.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/events/file.hpp"

namespace carillon::web {
namespace {

std::vector<events::Event> make_all() {
  events::Force force{.time_s = 0.5, .step_s = 1e-5, .body = 3, .other = 4, .triangle = 7, .count = 3, .continues = true};
  force.barycentric = {0.25, 0.25, 0.5};
  for (int k = 0; k < 3; ++k) force.impulse_n_s[k] = {0.1F * static_cast<float>(k), -1e-9F, 3e7F};
  events::LastingContact contact{.time_s = 1.25, .id = 0xfedcba9876543210U, .body = 1, .other = 2, .triangle = 11};
  contact.state = events::ContactState::kEnd;
  contact.barycentric = {0.5, 0.25, 0.25};
  contact.normal = {0, 0, 1};
  contact.slip_m_s = {0.1, -0.2, 0.3};
  contact.force_n = 5.0, contact.sweep_m_s = 0.4, contact.other_sweep_m_s = 0.5, contact.spin_rad_s = 6.0;
  contact.patch_radius_m = 1e-4, contact.impedance_n_s_m = 0.7;
  return {events::Impulse{.time_s = 0.1 + 1e-17,
                          .body = 5,
                          .triangle = 2147483647,
                          .shape = events::PulseShape::kGaussian,
                          .barycentric = {0.1, 0.2, 0.7},
                          .impulse_n_s = {1, 2, 3},
                          .duration_s = 1e-3},
          force,
          contact,
          events::BodyMotion{.time_s = 2.0, .body = 1, .position_m = {1, 2, 3}, .velocity_m_s = {4, 5, 6}, .rotation = {0, 1, 0, 0}},
          events::Listener{.time_s = 3.0, .position_m = {7, 8, 9}, .velocity_m_s = {1, 1, 1}, .rotation = {0, 0, 0, 1}},
          events::TimeWatermark{.time_s = 4.0}};
}

/// As text of a contacts file, with all digits of all fields.
std::string to_text(const events::Event& event) {
  std::string text;
  events::append_line(text, event);
  return text;
}

TEST(EventWords, round_trip) {
  std::vector<double> words;
  const std::vector<events::Event> all = make_all();
  for (const events::Event& event : all) append_words(words, event, event.index() % 2 == 0 ? Timing::kExact : Timing::kSoon);
  std::size_t count = 0;
  read_words(words, [&](const events::Event& event, Timing timing) {
    ASSERT_LT(count, all.size());
    EXPECT_EQ(event.index(), all[count].index());
    EXPECT_EQ(timing, event.index() % 2 == 0 ? Timing::kExact : Timing::kSoon);
    EXPECT_EQ(to_text(event), to_text(all[count]));
    ++count;
  });
  EXPECT_EQ(count, all.size());
}

TEST(EventWords, refuse_truncated_or_corrupt_rows) {
  std::vector<double> words;
  for (const events::Event& event : make_all()) append_words(words, event);
  const auto sink = [](const events::Event&, Timing) {};
  std::size_t begin = 0;
  std::vector<std::size_t> borders{0};
  while (begin < words.size()) borders.push_back(begin += static_cast<std::size_t>(words[begin]));
  for (std::size_t cut = 1; cut < words.size(); ++cut) {
    const std::vector<double> prefix(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(cut));
    if (std::find(borders.begin(), borders.end(), cut) != borders.end())
      EXPECT_NO_THROW(read_words(prefix, sink)) << cut;
    else
      EXPECT_THROW(read_words(prefix, sink), InputError) << cut;
  }
  for (std::size_t at = 0; at < words.size(); ++at) {
    for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(), -1e300, 1e300, 0.5, -7.0}) {
      std::vector<double> changed = words;
      changed[at] = bad;
      // Accepted with a fault, or refused.
      try {
        read_words(changed, [](const events::Event& event, Timing) { (void)events::find_fault(event); });
      } catch (const InputError&) {
      }
    }
  }
}

}  // namespace
}  // namespace carillon::web
