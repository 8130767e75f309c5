#include "runtime/events/file.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::events::tests {
namespace {

const std::string kHeader =
    R"({"carillon_contacts": 1, "bodies": [{"name": "ball", "triangles": 20}, {"name": "a \"shelf\"", "triangles": 12}]})"
    "\n";
const std::string kImpulse =
    R"({"impulse": {"time_s": 0.5, "body": 0, "triangle": 3, "barycentric": [0.25, 0.25, 0.5], "impulse_n_s": [0, 0, 1e-3], "duration_s": 1e-4}})"
    "\n";

/// Random number of any readable magnitude and sign, often a special value.
double draw(std::mt19937_64& random) {
  switch (random() % 8) {
    case 0:
      return -0.0;
    case 1:
      return static_cast<double>(random() % 100);
    case 2:
      return 5e-324;
    case 3:
      return 1e9;
    default:
      return std::ldexp(static_cast<double>(random() >> 11) - 0x1p52, -23 - static_cast<int>(random() % 200));
  }
}

double draw_amount(std::mt19937_64& random) { return std::abs(draw(random)); }

Vec3 draw_vector(std::mt19937_64& random) { return {draw(random), draw(random), draw(random)}; }

Quaternion draw_rotation(std::mt19937_64& random) {
  const double angle = 1e-3 * static_cast<double>(random() % 10000);
  return {std::cos(angle), 0.6 * std::sin(angle), -0.0, 0.8 * std::sin(angle)};
}

double draw_time(std::mt19937_64& random) { return 1e-3 * static_cast<double>(random() % 1000) / 3.0; }

Event draw_event(std::mt19937_64& random) {
  const double u = static_cast<double>(random() % 1000) / 1000.0 / 3.0, v = 1.0 / 3.0;
  const Vec3 inside{u, v, 1.0 - u - v};
  switch (random() % 6) {
    case 4: {
      Force force{draw_time(random),
                  draw_amount(random) * 6e-10 + 1e-300,
                  1,
                  0,
                  11,
                  static_cast<std::int16_t>(1 + random() % 16),
                  random() % 2 == 0,
                  inside};
      for (std::size_t k = 0; k < static_cast<std::size_t>(force.count); ++k) {
        for (float& x : force.impulse_n_s[k]) {
          const float any = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
          x = std::abs(any) <= 1e9F ? any : static_cast<float>(draw(random));
        }
      }
      return force;
    }
    case 0:
      return TimeWatermark{draw_time(random)};
    case 1:
      return Impulse{draw_time(random),
                     1,
                     -1,
                     11,
                     random() % 2 == 0 ? PulseShape::kHertz : PulseShape::kGaussian,
                     inside,
                     draw_vector(random),
                     std::min(draw_amount(random), 10.0)};
    case 2:
      return LastingContact{draw_time(random),
                            random() >> 1,
                            0,
                            1,
                            19,
                            static_cast<ContactState>(random() % 3),
                            inside,
                            {0.0, 0.6, -0.8},
                            draw_vector(random),
                            draw_amount(random),
                            draw_amount(random),
                            draw_amount(random),
                            draw_amount(random),
                            draw_amount(random) + 1e-9,
                            draw_amount(random)};
    case 3:
      return BodyMotion{draw_time(random), 1, draw_vector(random), draw_vector(random), draw_rotation(random), random() % 2 == 0};
    default:
      return Listener{draw_time(random), draw_vector(random), draw_vector(random), draw_rotation(random)};
  }
}

template <std::size_t n>
void expect_bits(const std::array<double, n>& a, const std::array<double, n>& b) {
  for (std::size_t k = 0; k < n; ++k) EXPECT_EQ(std::bit_cast<std::uint64_t>(a[k]), std::bit_cast<std::uint64_t>(b[k]));
}

void expect_bits(double a, double b) { expect_bits(std::array{a}, std::array{b}); }

void expect_same(const TimeWatermark& a, const TimeWatermark& b) { expect_bits(a.time_s, b.time_s); }

void expect_same(const Impulse& a, const Impulse& b) {
  expect_bits(a.time_s, b.time_s);
  EXPECT_TRUE(a.body == b.body && a.other == b.other && a.triangle == b.triangle && a.shape == b.shape);
  expect_bits(a.barycentric, b.barycentric);
  expect_bits(a.impulse_n_s, b.impulse_n_s);
  expect_bits(a.duration_s, b.duration_s);
}

void expect_same(const Force& a, const Force& b) {
  expect_bits(std::array{a.time_s, a.step_s}, std::array{b.time_s, b.step_s});
  EXPECT_TRUE(a.body == b.body && a.other == b.other && a.triangle == b.triangle && a.count == b.count && a.continues == b.continues);
  expect_bits(a.barycentric, b.barycentric);
  EXPECT_EQ(std::memcmp(&a.impulse_n_s, &b.impulse_n_s, sizeof a.impulse_n_s), 0);
}

void expect_same(const LastingContact& a, const LastingContact& b) {
  expect_bits(a.time_s, b.time_s);
  EXPECT_TRUE(a.id == b.id && a.body == b.body && a.other == b.other && a.triangle == b.triangle && a.state == b.state);
  expect_bits(a.barycentric, b.barycentric);
  expect_bits(a.normal, b.normal);
  expect_bits(a.slip_m_s, b.slip_m_s);
  expect_bits(std::array{a.force_n, a.sweep_m_s, a.other_sweep_m_s, a.spin_rad_s, a.patch_radius_m, a.impedance_n_s_m},
              std::array{b.force_n, b.sweep_m_s, b.other_sweep_m_s, b.spin_rad_s, b.patch_radius_m, b.impedance_n_s_m});
}

template <class T>
void expect_same_moving(const T& a, const T& b) {
  expect_bits(a.time_s, b.time_s);
  expect_bits(a.position_m, b.position_m);
  expect_bits(a.velocity_m_s, b.velocity_m_s);
  expect_bits(a.rotation, b.rotation);
}

void expect_same(const BodyMotion& a, const BodyMotion& b) {
  EXPECT_EQ(a.body, b.body);
  EXPECT_EQ(a.cut, b.cut);
  expect_same_moving(a, b);
}

void expect_same(const Listener& a, const Listener& b) { expect_same_moving(a, b); }

std::string find_error(const std::string& text) {
  return carillon::tests::catch_message<InputError>([&] { parse_recording(text, "run.jsonl"); });
}

void expect_error(const std::string& text, const std::string& part) {
  const std::string error = find_error(text);
  EXPECT_NE(error.find(part), std::string::npos) << "\"" << error << "\" lacks \"" << part << "\"";
}

std::string replace(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

const std::string kForce =
    R"({"force": {"time_s": 0.5, "step_s": 1e-5, "body": 0, "triangle": 3, "barycentric": [1, 0, 0], "impulse_n_s": [[0, 0, 1e-3], [0, 0, 2e-3]]}})"
    "\n";

TEST(Recording, ReadsAForceAndRejectsInvalidOnes) {
  const Recording read = parse_recording(kHeader + kForce, "run.jsonl");
  const auto& force = std::get<Force>(read.events[0]);
  EXPECT_TRUE(force.count == 2 && !force.continues && force.other == -1 && force.step_s == 1e-5 && force.impulse_n_s[1][2] == 2e-3F);
  const auto refuse = [&](const std::string& from, const std::string& to, const std::string& says) {
    expect_error(kHeader + replace(kForce, from, to), says);
  };
  refuse("1e-5", "0", "run.jsonl:2: the length of a step is not above 0");
  refuse("1e-5", "1", "step_s\": 1 exceeds the limit; give");
  refuse("[[0, 0, 1e-3], [0, 0, 2e-3]]", "[]", "impulse_n_s");
  refuse("2e-3]", "2e10]", "2e+10 exceeds the limit; give");
  refuse("2e-3]", "2e-3, 1]", "impulse_n_s");
  std::string many = "[[0, 0, 1e-3]";
  for (int k = 0; k < kMaxForceSteps; ++k) many += ", [0, 0, 1e-3]";
  refuse("[[0, 0, 1e-3], [0, 0, 2e-3]]", many + "]", "impulse_n_s");
  refuse("\"step_s\"", "\"steps\"", "step_s");
}

TEST(Recording, RejectsAbsurdAmounts) {
  const auto refuse = [](const std::string& from, const std::string& to, const std::string& key) {
    const std::string text = replace(kHeader + kImpulse, from, to);
    carillon::tests::expect_error<InputError>({"run.jsonl:2: \"impulse." + key, "at most"}, [&] { parse_recording(text, "run.jsonl"); });
  };
  refuse("1e-3]", "1.1e9]", "impulse_n_s");
  refuse("1e-3]", "-1e39]", "impulse_n_s");
  refuse("1e-4}", "10.1}", "duration_s");
  parse_recording(replace(kHeader + kImpulse, "1e-3]", "-1e9]"), "run.jsonl");
}

TEST(Recording, ReadsBackExactly) {
  std::mt19937_64 random(7);
  Recording recording{{{"ball", 20}, {"a \"shelf\" \\ \n", 12}}, {}};
  while (recording.events.size() < 4000) {
    const Event event = draw_event(random);
    if (find_fault(event) == nullptr) recording.events.push_back(event);
  }
  const Recording back = parse_recording(format_recording(recording), "run.jsonl");
  ASSERT_EQ(back.bodies.size(), 2U);
  EXPECT_EQ(back.bodies[1].name, recording.bodies[1].name);
  EXPECT_EQ(back.bodies[0].triangles, 20);
  ASSERT_EQ(back.events.size(), recording.events.size());
  for (std::size_t i = 0; i < back.events.size(); ++i) {
    ASSERT_EQ(back.events[i].index(), recording.events[i].index());
    std::visit([&](const auto& e) { expect_same(e, std::get<std::decay_t<decltype(e)>>(back.events[i])); }, recording.events[i]);
  }
  EXPECT_EQ(format_recording(back), format_recording(recording));
}

TEST(Recording, KeepsTheMarksOfItsSurfaces) {
  const SurfaceMark mark{{0.1, 0.2, 0.3}, {0.01, -0.02, 1.0 / 3.0}};
  const Recording back = parse_recording(format_recording({{{"ball", 20, mark}, {"shelf", 12, {}}}, {}}), "run.jsonl");
  ASSERT_TRUE(back.bodies[0].surface.has_value());
  EXPECT_EQ(back.bodies[0].surface->size_m, mark.size_m);
  EXPECT_EQ(back.bodies[0].surface->order_m, mark.order_m);
  EXPECT_FALSE(back.bodies[1].surface.has_value());
}

TEST(SurfaceMarks, AreOfOneSurfaceUpToRounding) {
  const SurfaceMark mark{{0.1, 0.2, 0.3}, {0.01, -0.02, 0.05}};
  const auto change = [&](double scale, double shift) {
    SurfaceMark other = mark;
    for (double& x : other.size_m) x *= scale;
    for (double& x : other.order_m) x = x * scale + shift;
    return other;
  };
  EXPECT_TRUE(is_same_surface(mark, mark));
  EXPECT_TRUE(is_same_surface(mark, change(1.0 + 1e-9, 1e-10)));
  EXPECT_FALSE(is_same_surface(mark, change(2.0, 0.0)));
  EXPECT_FALSE(is_same_surface(mark, change(1.001, 0.0)));
  EXPECT_FALSE(is_same_surface(mark, change(1.0, 1e-4)));
  SurfaceMark none = mark;
  none.order_m[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_same_surface(mark, none));
}

TEST(Recording, CanBeWrittenByHand) {
  const Recording read = parse_recording(kHeader + "\n" + kImpulse + "  \n", "run.jsonl");
  ASSERT_EQ(read.events.size(), 1U);
  const auto& impulse = std::get<Impulse>(read.events[0]);
  EXPECT_EQ(impulse.other, -1);
  EXPECT_EQ(impulse.triangle, 3);
  EXPECT_EQ(impulse.shape, PulseShape::kHertz);
  EXPECT_EQ(impulse.duration_s, 1e-4);
}

TEST(Recording, AContactMayLeaveTheImpedanceToTheMaterial) {
  LastingContact contact;
  contact.normal = {0.0, 0.0, 1.0}, contact.patch_radius_m = 1e-4;
  const std::string text = format_recording({{{"ball", 20}}, {contact}});
  EXPECT_EQ(text.find("impedance"), std::string::npos);
  const Recording back = parse_recording(text, "run.jsonl");
  EXPECT_EQ(std::get<LastingContact>(back.events[0]).impedance_n_s_m, LastingContact::kByMaterial);
  expect_error(replace(text, R"("patch_radius_m")", R"("impedance_n_s_m": -1, "patch_radius_m")"), "impedance_n_s_m");
}

TEST(Recording, TruncationIsRejected) {
  const Recording recording{{{"ball", 20}}, {TimeWatermark{0.25}, Impulse{}, TimeWatermark{0.5}}};
  const std::string text = format_recording(recording);
  EXPECT_EQ(find_error(text), "");
  for (std::size_t length = 0; length + 1 < text.size(); ++length) {
    EXPECT_NE(find_error(text.substr(0, length)), "") << length;  // complete without the last line feed, too
  }
}

TEST(Recording, BadLinesAreReported) {
  const auto expect_bad = [](const std::string& from, const std::string& to, const std::string& says) {
    expect_error(kHeader + replace(kImpulse, from, to), says);
  };
  expect_error("", "run.jsonl:1: the file is empty");
  expect_error(kImpulse, "run.jsonl:1: ");
  expect_error(replace(kHeader, "1,", "2,"), "carillon_contacts");
  expect_error(replace(kHeader, "20}", "0}"), "run.jsonl:1: ");
  expect_error(kHeader + "\n{\"impulse\": \n", "run.jsonl:3: this is not JSON");
  expect_error(kHeader + kImpulse + "[1]\n", "run.jsonl:3: the file must hold one JSON object");
  expect_bad("0.5,", "NaN,", "run.jsonl:2: this is not JSON");
  expect_bad("0.5,", "1e999,", "run.jsonl:2: ");
  expect_bad("0.5,", "\"soon\",", "run.jsonl:2: ");
  expect_bad("duration_s", "duration", "\"duration_s\"");
  expect_bad("\"body\": 0,", "\"body\": 0, \"bodies\": 1,", "impulse.bodies");
  expect_bad("\"body\": 0,", "\"body\": 2,", "there is no body 2; the first line names 2");
  expect_bad("\"body\": 0,", "\"body\": 0, \"other\": 7,", "there is no body 7");
  expect_bad("\"triangle\": 3", "\"triangle\": 20", "the bank of \"ball\" has 20 triangles");
  expect_bad("\"triangle\": 3", "\"triangle\": 3.5", "run.jsonl:2: ");
  expect_bad("[0.25, 0.25, 0.5]", "[0.25, 0.25]", "run.jsonl:2: ");
  expect_bad("[0.25, 0.25, 0.5]", "[0.25, 0.25, 0.75]", "do not sum to 1");
  expect_bad("1e-4", "-1e-4", "the duration is negative");
  expect_bad("impulse\"", "inpulse\"", "inpulse");
  expect_error(kHeader + "{}\n", "run.jsonl:2: this line holds no event");
  expect_bad("}}", "}, \"mark\": {\"time_s\": 1}}", "run.jsonl:2: ");
  expect_error(kHeader + "{\"mark\": {\"time_s\": 2}}\n" + kImpulse, "run.jsonl:3: time goes back from 2 s to 0.5 s");
  expect_error(replace(kHeader, "1, ", "1, \"events\": 2, ") + kImpulse, "the first line states 2 events, found 1");
}

}  // namespace
}  // namespace carillon::events::tests
