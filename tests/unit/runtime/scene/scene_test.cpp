// Keys and values of scenes.
#include "runtime/scene/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>

#include "runtime/scene/microphones.hpp"
#include "runtime/scene/pose.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/paths.hpp"
#include "tests/unit/runtime/scene/scene_texts.hpp"

namespace carillon::scene {
namespace {

std::string read_text(const std::string& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

TEST(Scene, CompleteSceneIsRead) {
  const Scene scene = parse(read_text(carillon::tests::get_source_dir() + "/tests/unit/runtime/scene/scenes/drop.json"));
  EXPECT_EQ(scene.duration_s, 1.5);
  EXPECT_EQ(scene.sample_rate_hz, 48000);
  ASSERT_TRUE(scene.ground.has_value());
  EXPECT_EQ(scene.ground->young_modulus_pa, 30e9);
  ASSERT_EQ(scene.bodies.size(), 2u);
  EXPECT_EQ(scene.bodies[0].bank, "/somewhere/cube.h5");
  EXPECT_EQ(scene.bodies[0].spec.velocity_m_s[2], -0.5);
  EXPECT_TRUE(scene.bodies[1].spec.fixed);
  EXPECT_NEAR(scene.listener.facing[0], -0.3 / std::sqrt(0.09 + 1.0 + 0.09), 1e-12);
  EXPECT_FALSE(scene.output.gain_per_pa.has_value());
}

TEST(Scene, BodiesMayBeDescribedInsteadOfABank) {
  const Scene scene = parse(
      "{\"duration_s\": 1, \"bodies\": [\n{\"name\": \"a\", \"shape\": {\"bowl\": {\"any\": 1}},\n\"material\": \"glass\", \"fixed\": "
      "true},\n{\"name\": \"b\", \"bank\": \"b.h5\"}]}");
  EXPECT_TRUE(scene.bodies[0].bank.empty());
  EXPECT_EQ(scene.bodies[0].job.first_line, 2);
  EXPECT_EQ(scene.bodies[0].job.text, "{\"shape\": {\"bowl\": {\"any\": 1}}, \n\"material\": \"glass\"}\n");
  EXPECT_EQ(scene.bodies[0].place, "/somewhere/scene.json:2");
  EXPECT_TRUE(scene.bodies[1].job.text.empty());
  EXPECT_THROW(parse(R"({"duration_s": 1, "bodies": [{"name": "a", "bank": "a.h5", "shape": {"bowl": {}}}]})"), InputError);
  EXPECT_THROW(parse(R"({"duration_s": 1, "bodies": [{"name": "a", "material": "glass"}]})"), InputError);
}

TEST(Scene, StrikesAreRead) {
  const Scene scene = parse("{\"duration_s\": 2, " + kBody + R"(, "strikes": [
    {"time_s": 0.5, "body": "a", "point_m": [0.1, 0, 0], "impulse_n_s": [0, 0, -0.01], "duration_s": 1e-3},
    {"time_s": 0, "body": "a", "triangle": 7, "impulse_n_s": [1, 2, 3]}]})");
  ASSERT_EQ(scene.strikes.size(), 2u);
  EXPECT_EQ(scene.strikes[0].body, 0u);
  EXPECT_EQ(scene.strikes[0].time_s, 0.5);
  EXPECT_EQ(scene.strikes[0].point_m, (Vec3{0.1, 0.0, 0.0}));
  EXPECT_FALSE(scene.strikes[0].triangle.has_value());
  EXPECT_EQ(scene.strikes[0].impulse_n_s[2], -0.01);
  EXPECT_EQ(scene.strikes[0].duration_s, 1e-3);
  EXPECT_EQ(scene.strikes[1].triangle, 7);
  EXPECT_EQ(scene.strikes[1].duration_s, 0.0);
  EXPECT_EQ(scene.strikes[1].place, "/somewhere/scene.json:3");
  EXPECT_TRUE(parse("{\"duration_s\": 2, " + kBody + "}").strikes.empty());
}

TEST(Scene, MalletsAreRead) {
  const Scene scene = parse("{\"duration_s\": 2, " + kBody + R"(, "strikes": [
    {"time_s": 0.5, "body": "a", "triangle": 7, "mallet": {"mass_kg": 0.02, "speed_m_s": 2, "radius_m": 0.01, "young_modulus_pa": 3e9}},
    {"time_s": 1, "body": "a", "triangle": 7, "mallet": {"mass_kg": 0.02, "speed_m_s": 2, "felt": {"stiffness_n_m_p": 1e8, "exponent": 3},
      "restitution": 0.5, "friction": 0.3, "direction": [0, 3, -4]}}]})");
  ASSERT_EQ(scene.strikes.size(), 2u);
  const Mallet &hard = *scene.strikes[0].mallet, &felt = *scene.strikes[1].mallet;
  EXPECT_TRUE(hard.mass_kg == 0.02 && hard.speed_m_s == 2.0 && hard.radius_m == 0.01 && hard.young_modulus_pa == 3e9 &&
              hard.poisson_ratio == 0.3);
  EXPECT_TRUE(!hard.felt && hard.restitution == 1.0 && hard.friction == 0.0 && !hard.direction);
  EXPECT_TRUE(felt.felt->stiffness_n_m_p == 1e8 && felt.felt->exponent == 3.0 && felt.restitution == 0.5 && felt.friction == 0.3);
  EXPECT_NEAR((*felt.direction)[1], 0.6, 1e-15);
  EXPECT_NEAR((*felt.direction)[2], -0.8, 1e-15);
  EXPECT_TRUE(scene.warnings.empty());
  const Scene dense =
      parse(with_strike(kMalletPlace + R"("mallet": {"mass_kg": 1, "speed_m_s": 2, "radius_m": 0.01, "young_modulus_pa": 3e9})"));
  ASSERT_EQ(dense.warnings.size(), 1u);
  EXPECT_NE(dense.warnings[0].find("denser than osmium"), std::string::npos);
}

TEST(Scene, MalletsAndMaterialsHaveNames) {
  const Scene scene = parse(R"({"duration_s": 2, "ground": {"material": "oak", "friction": 0.3}, "bodies": [{"name": "a", "bank": "a.h5"}],
  "strikes": [
    {"time_s": 0.5, "body": "a", "triangle": 7, "mallet": "steel"},
    {"time_s": 0.6, "body": "a", "triangle": 7, "mallet": {"from": "soft-felt", "speed_m_s": 3}},
    {"time_s": 0.7, "body": "a", "triangle": 7, "mallet": {"mass_kg": 0.02, "speed_m_s": 2, "radius_m": 0.01, "material": "nylon"}},
    {"time_s": 0.8, "body": "a", "triangle": 7, "mallet": {"from": "steel", "felt": {"stiffness_n_m_p": 1e8}}}]})");
  EXPECT_EQ(scene.ground->density_kg_m3, 760);
  EXPECT_EQ(scene.ground->friction, 0.3);
  EXPECT_GT(scene.ground->young_modulus_pa, 1e9);
  EXPECT_LT(scene.ground->young_modulus_pa, 13.5e9) << "wood is softer across its grain";
  const auto mallet = [&](std::size_t i) { return *scene.strikes[i].mallet; };
  EXPECT_EQ(mallet(0).young_modulus_pa, 200e9);
  EXPECT_EQ(mallet(0).speed_m_s, 1.0);
  // Mass of a steel ball of its radius.
  EXPECT_NEAR(mallet(0).mass_kg / (7850 * 4.0 / 3.0 * std::numbers::pi * std::pow(mallet(0).radius_m, 3)), 1.0, 0.01);
  EXPECT_EQ(mallet(1).speed_m_s, 3.0);
  EXPECT_EQ(mallet(1).mass_kg, 0.02);
  ASSERT_TRUE(mallet(1).felt.has_value());
  EXPECT_EQ(mallet(2).young_modulus_pa, 2.7e9);
  EXPECT_EQ(mallet(2).poisson_ratio, 0.39);
  EXPECT_EQ(mallet(3).felt->stiffness_n_m_p, 1e8);
  EXPECT_EQ(mallet(3).mass_kg, 0.033);
}

TEST(Scene, JointsAndCordsAreRead) {
  const Scene scene = parse("{\"duration_s\": 2, " + kTwo + R"(, "joints": [
    {"kind": "hinge", "body": "a", "to": "world", "at_m": [0, 0, 1], "axis": [0, 2, 0], "damping": 0.01, "limits_deg": [-90, 45], "stop_restitution": 0.3},
    {"kind": "universal", "body": "b", "to": "a", "at_m": [0, 0, 2], "axis": [1, 0, 0], "second_axis": [0, 3, 0]}],
    "cords": [{"from": {"body": "b", "at_m": [0, 0, 1]}, "to": {"at_m": [0, 0, 3]}, "length_m": 2.5, "restitution": 0.2},
              {"from": {"body": "b", "at_m": [0, 0, 1]}, "to": {"body": "a", "at_m": [0, 0, 3]}}]})");
  ASSERT_EQ(scene.joints.size(), 2u);
  EXPECT_EQ(scene.joints[0].kind, joints::Kind::kHinge);
  EXPECT_EQ(scene.joints[0].body, 0);
  EXPECT_EQ(scene.joints[0].to, -1);
  EXPECT_EQ(scene.joints[0].axis, (Vec3{0, 1, 0}));
  EXPECT_EQ(scene.joints[0].damping, 0.01);
  ASSERT_TRUE(scene.joints[0].limits);
  EXPECT_DOUBLE_EQ((*scene.joints[0].limits)[0], -0.5 * M_PI);
  EXPECT_DOUBLE_EQ((*scene.joints[0].limits)[1], 0.25 * M_PI);
  EXPECT_EQ(scene.joints[0].stop_restitution, 0.3);
  EXPECT_FALSE(scene.joints[1].limits);
  EXPECT_EQ(scene.joints[0].place, "/somewhere/scene.json:2");
  EXPECT_EQ(scene.joints[1].to, 0);
  EXPECT_EQ(scene.joints[1].second_axis, (Vec3{0, 1, 0}));
  ASSERT_EQ(scene.cords.size(), 2u);
  EXPECT_EQ(scene.cords[0].to, -1);
  EXPECT_EQ(scene.cords[0].length_m, 2.5);
  EXPECT_EQ(scene.cords[0].restitution, 0.2);
  EXPECT_EQ(scene.cords[1].to, 0);
  EXPECT_FALSE(scene.cords[1].length_m.has_value());
}

TEST(Scene, ManyStrikesAreReadInOnePass) {
  std::string text = "{\"duration_s\": 100,\n" + kBody + ", \"strikes\": [\n";
  constexpr int kStrikes = 20000;
  for (int i = 0; i < kStrikes; ++i) {
    text += "{\"time_s\": 1, \"body\": \"a\", \"triangle\": 7, \"impulse_n_s\": [0, 0, 1]}";
    text += i + 1 < kStrikes ? ",\n" : "\n";
  }
  text += "]}";
  const base::Document document = base::parse_document(text, "/somewhere/scene.json");
  const Scene scene = parse_scene(document);
  ASSERT_EQ(scene.strikes.size(), static_cast<std::size_t>(kStrikes));
  EXPECT_EQ(scene.strikes.back().place, "/somewhere/scene.json:" + std::to_string(kStrikes + 2));
  EXPECT_LE(document.count_scanned_bytes(), text.size()) << "the lines of strikes are found by one pass, not by one for each strike";
}

TEST(Scene, MissingKeysHaveDefaults) {
  const Scene scene = parse("{\"duration_s\": 2, " + kBody + "}");
  EXPECT_EQ(scene.sample_rate_hz, 48000);
  EXPECT_EQ(scene.gravity_m_s2[2], -9.81);
  EXPECT_FALSE(scene.ground.has_value());
  EXPECT_EQ(scene.listener.ear_distance_m, 0.2);
  EXPECT_EQ(scene.output.format, SampleFormat::kPcm24);
  EXPECT_EQ(scene.radiation, radiation::GainKind::kAuto);
  EXPECT_EQ(parse("{\"duration_s\": 2, \"radiation\": \"osg02\", " + kBody + "}").radiation, radiation::GainKind::kOsg02);
  EXPECT_EQ(parse("{\"duration_s\": 2, \"radiation\": \"bem\", " + kBody + "}").radiation, radiation::GainKind::kBem);
  EXPECT_EQ(parse("{\"duration_s\": 2, \"output\": {\"gain\": 0.25}, " + kBody + "}").output.gain_per_pa, 0.25);
  EXPECT_EQ(parse("{\"duration_s\": 2, \"output\": {\"gain\": \"auto\"}, " + kBody + "}").output.gain_per_pa, std::nullopt);
}

TEST(Scene, ListenerMayHaveAHead) {
  const auto parse_listener = [](const std::string& keys, const std::string& more = "") {
    return parse("{\"duration_s\": 2, \"listener\": {" + keys + "}, " + kBody + more + "}");
  };
  const Scene free = parse_listener("\"ears\": \"free\"");
  EXPECT_FALSE(has_head(free));
  EXPECT_FALSE(has_head(parse("{\"duration_s\": 2, " + kBody + "}")));
  EXPECT_FALSE(free.effects.has(synth::Effect::kHead));
  EXPECT_FALSE(make_head(free, 48000.0).has_value());
  const Scene sphere = parse_listener("\"ears\": \"hrtf\"");
  EXPECT_TRUE(has_head(sphere));
  EXPECT_TRUE(sphere.effects.has(synth::Effect::kHead));
  EXPECT_EQ(sphere.listener.ear_distance_m, 0.175);
  EXPECT_TRUE(sphere.listener.sofa.empty());
  EXPECT_TRUE(sphere.warnings.empty());
  EXPECT_EQ(parse_listener("\"ears\": \"hrtf\", \"ear_distance_m\": 0.2").listener.ear_distance_m, 0.2);
  const Scene measured = parse_listener("\"ears\": \"hrtf\", \"sofa\": \"heads/mine.sofa\"");
  EXPECT_TRUE(measured.listener.sofa.is_absolute());
  EXPECT_EQ(measured.listener.sofa.filename(), "mine.sofa");
  EXPECT_FALSE(parse_listener("\"ears\": \"hrtf\"", ", \"effects\": {\"head\": false}").effects.has(synth::Effect::kHead));
  EXPECT_FALSE(parse_listener("\"ears\": \"hrtf\"", ", \"effects\": [\"modal\"]").effects.has(synth::Effect::kHead));
  EXPECT_TRUE(parse_listener("\"ears\": \"hrtf\"", ", \"effects\": [\"two_ears\", \"head\"]").effects.has(synth::Effect::kHead));
}

TEST(Scene, RotationsAreAboutTheFixedAxesXThenYThenZ) {
  const Scene scene =
      parse(R"({"duration_s": 1, "bodies": [{"name": "a", "bank": "a.h5", "rotation_deg": [90, 0, 90], "position_m": [1, 2, 3]}]})");
  // y goes to z about x and stays there; x goes to y about z; z goes to -y, then to x.
  const auto check = [&](const Vec3& body, const Vec3& world) {
    const Vec3 x = calc_world_point(scene.bodies[0].spec.initial, body);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(x[k], world[k], 1e-12);
  };
  check({0, 1, 0}, {1, 2, 4});
  check({1, 0, 0}, {1, 3, 3});
  check({0, 0, 1}, {2, 2, 3});
}

TEST(Scene, ListenerMayMoveOrBeReplacedByMicrophones) {
  const auto parse_root = [](const std::string& keys) { return parse("{\"duration_s\": 2, " + kBody + ", " + keys + "}"); };
  const Scene moving = parse_root(R"("listener": {"path": [[0, 1, 2, 3], [0.5, 2, 2, 3]], "look_at_m": [1, 5, 3]})");
  ASSERT_EQ(moving.listener.path.size(), 2u);
  EXPECT_EQ(moving.listener.path[1].time_s, 0.5);
  EXPECT_EQ(moving.listener.path[1].position_m, (Vec3{2, 2, 3}));
  EXPECT_EQ(moving.listener.position_m, (Vec3{1, 2, 3}));
  EXPECT_NEAR(moving.listener.facing[1], 1.0, 1e-12);
  EXPECT_EQ(count_channels(moving), 2u);
  const Scene scene = parse_root(R"("microphones": [[0, 0, 1], [0, 1, 1], [2, 0, 1]])");
  EXPECT_EQ(count_channels(scene), 3u);
  EXPECT_EQ(scene.microphones_m[2], (Vec3{2, 0, 1}));
}

TEST(Scene, EffectsAreThoseOfTheList) {
  using synth::Effect;
  const auto parse_effects = [](const std::string& list) {
    return parse("{\"duration_s\": 2, " + kBody + ", \"effects\": " + list + "}").overrides;
  };
  const auto usual = parse("{\"duration_s\": 2, " + kBody + "}").overrides;
  EXPECT_TRUE(usual.automatic);
  EXPECT_EQ(usual.on.with(usual.off), synth::EffectSet{});
  EXPECT_TRUE(parse_effects("\"auto\"").automatic);
  const auto list =
      parse_effects(R"(["modal", "hertz_pulse", "acceleration_noise", "air_delay", "doppler", "two_ears", "roughness", "rolling",
    "contact_damping"])");
  EXPECT_FALSE(list.automatic);
  EXPECT_EQ(list.on, synth::EffectSet::all().without(
                         {Effect::kDirectivity, Effect::kGroundReflection, Effect::kHead, Effect::kNonlinear, Effect::kCascade}));
  EXPECT_EQ(parse_effects(R"(["doppler"])").on, synth::EffectSet{Effect::kDoppler});
  EXPECT_FALSE(parse_effects("[]").automatic);
  const auto some = parse_effects(R"({"base": "auto", "on": ["acceleration_noise"], "off": ["doppler", "two_ears"]})");
  EXPECT_TRUE(some.automatic);
  EXPECT_EQ(some.on, synth::EffectSet{Effect::kAccelerationNoise});
  EXPECT_EQ(some.off, (synth::EffectSet{Effect::kDoppler, Effect::kTwoEars}));
  EXPECT_TRUE(parse_effects("{}").automatic);
  const auto named = parse_effects(R"({"directivity": true, "doppler": false, "two_ears": "auto", "off": ["rolling"]})");
  EXPECT_TRUE(named.automatic);
  EXPECT_EQ(named.on, synth::EffectSet{Effect::kDirectivity});
  EXPECT_EQ(named.off, (synth::EffectSet{Effect::kDoppler, Effect::kRolling}));
  for (const char* wrong : {R"({"directivity": true, "off": ["directivity"]})", R"({"directivity": true, "on": ["directivity"]})",
                            R"({"directivity": "yes"})", R"({"directivities": true})"})
    EXPECT_THROW(parse_effects(wrong), InputError) << wrong;
}

TEST(Scene, GroundReflectsByItsKey) {
  const auto parse_ground = [](const std::string& ground, const std::string& more = "") {
    return parse("{\"duration_s\": 2, " + kBody + ", \"ground\": " + ground + more + "}");
  };
  EXPECT_FALSE(find_floor(parse_ground("{}")).has_value());
  EXPECT_FALSE(find_floor(parse("{\"duration_s\": 2, " + kBody + "}")).has_value());
  const auto floor = find_floor(parse_ground(R"({"height_m": -0.5, "reflection": 0.8})"));
  ASSERT_TRUE(floor.has_value());
  EXPECT_EQ(floor->reflection, 0.8);
  EXPECT_EQ(floor->calc_height_m({3.0, 2.0, 1.0}), 1.5);
  EXPECT_EQ(find_floor(parse_ground("{}", R"(, "effects": {"ground_reflection": true})"))->reflection, 1.0);
  EXPECT_THROW(parse_ground(R"({"reflection": 1.1})"), InputError);
  EXPECT_THROW(parse_ground(R"({"reflection": 1})", R"(, "microphones": [[0, 0, 1], [0, 0, -0.1]])"), InputError);
  EXPECT_NO_THROW(parse_ground("{}", R"(, "microphones": [[0, 0, 1], [0, 0, -0.1]])"));
  EXPECT_THROW(parse_ground(R"({"height_m": 0.6, "reflection": 1})"), InputError) << "the listener is at 0.5 m";
  EXPECT_THROW(parse("{\"duration_s\": 2, " + kBody + R"(, "effects": {"ground_reflection": true}})"), InputError);
}

TEST(Scene, BodyMayHaveItsOwnEffects) {
  using synth::Effect;
  const Scene scene = parse(R"({"duration_s": 2, "effects": {"off": ["two_ears"]}, "bodies": [
    {"name": "a", "bank": "a.h5"}, {"name": "b", "bank": "a.h5", "effects": ["modal"]}, {"name": "c", "bank": "a.h5", "effects": "auto"}]})");
  EXPECT_EQ(scene.bodies[0].overrides.off, synth::EffectSet{Effect::kTwoEars});
  EXPECT_TRUE(scene.bodies[0].overrides.automatic);
  EXPECT_EQ(scene.bodies[1].overrides.on, synth::EffectSet{Effect::kModal});
  EXPECT_FALSE(scene.bodies[1].overrides.automatic);
  EXPECT_EQ(scene.bodies[2].overrides.off, synth::EffectSet{});
  EXPECT_TRUE(scene.bodies[2].overrides.automatic);
}

TEST(Scene, BodyMayHaveItsOwnNonlinear) {
  using synth::Effect;
  const auto parse_all = [](const std::string& effects) {
    return parse(R"({"duration_s": 2, "effects": )" + effects + R"(, "bodies": [
      {"name": "a", "bank": "a.h5"}, {"name": "b", "bank": "a.h5", "nonlinear": true}, {"name": "c", "bank": "a.h5", "nonlinear": false}]})")
        .bodies;
  };
  for (const char* effects : {R"("auto")", R"({"nonlinear": true})", R"({"off": ["nonlinear", "doppler"]})"}) {
    const auto bodies = parse_all(effects);
    for (const SceneBody& body : bodies) EXPECT_TRUE(body.overrides.automatic);
    EXPECT_TRUE(bodies[1].overrides.on.has(Effect::kNonlinear) && !bodies[1].overrides.off.has(Effect::kNonlinear));
    EXPECT_TRUE(!bodies[2].overrides.on.has(Effect::kNonlinear) && bodies[2].overrides.off.has(Effect::kNonlinear));
    EXPECT_EQ(bodies[1].overrides.off.without(Effect::kNonlinear), bodies[0].overrides.off.without(Effect::kNonlinear));
  }
  const auto listed = parse_all(R"(["modal", "nonlinear"])");
  EXPECT_EQ(listed[0].overrides.on, (synth::EffectSet{Effect::kModal, Effect::kNonlinear}));
  EXPECT_EQ(listed[1].overrides.on, listed[0].overrides.on);
  EXPECT_EQ(listed[2].overrides.on, synth::EffectSet{Effect::kModal});
  EXPECT_TRUE(!listed[2].overrides.automatic && listed[2].overrides.off.is_empty());
  // "auto" overrides the scene for this effect.
  const Scene chosen = parse(R"({"duration_s": 2, "effects": {"nonlinear": true, "off": ["doppler"]},
    "bodies": [{"name": "a", "bank": "a.h5", "nonlinear": "auto"}]})");
  EXPECT_TRUE(chosen.bodies[0].overrides.automatic);
  EXPECT_TRUE(chosen.bodies[0].overrides.on.is_empty());
  EXPECT_EQ(chosen.bodies[0].overrides.off, synth::EffectSet{Effect::kDoppler});
  const auto refuse = [](const std::string& effects, const std::string& keys) {
    return tests::catch_message<InputError>([&] {
      (void)parse("{\"duration_s\": 2, \"effects\": " + effects + ", \"bodies\": [{\"name\": \"a\", \"bank\": \"a.h5\", " + keys + "}]}");
    });
  };
  EXPECT_NE(refuse(R"(["modal"])", R"("nonlinear": "auto")").find("give true or false"), std::string::npos);
  EXPECT_NE(refuse(R"("auto")", R"("nonlinear": "on")").find("nonlinear"), std::string::npos);
  EXPECT_NE(refuse(R"("auto")", R"("nonlinear": true, "effects": {"nonlinear": false})").find("keep one of them"), std::string::npos);
}

TEST(Scene, RoughnessIsRead) {
  const Scene usual = parse("{\"duration_s\": 2, \"ground\": {}, " + kBody + "}");
  EXPECT_EQ(usual.bodies[0].spec.roughness_m, 2e-6);
  EXPECT_EQ(usual.ground->roughness_m, 20e-6);
  const Scene scene = parse(R"({"duration_s": 2, "ground": {"roughness_m": 0}, "bodies": [
    {"name": "a", "bank": "a.h5", "roughness_m": 5e-7}]})");
  EXPECT_EQ(scene.bodies[0].spec.roughness_m, 5e-7);
  EXPECT_EQ(scene.ground->roughness_m, 0.0);
  EXPECT_THROW(parse(R"({"duration_s": 2, "bodies": [{"name": "a", "bank": "a.h5", "roughness_m": 0.01}]})"), InputError);
  EXPECT_THROW(parse(R"({"duration_s": 2, "ground": {"roughness_m": -1e-6}, "bodies": [{"name": "a", "bank": "a.h5"}]})"), InputError);
}

TEST(Scene, QualityIsReadAndHasDefaults) {
  const Quality usual = parse("{\"duration_s\": 2, " + kBody + "}").quality;
  EXPECT_EQ(usual.thresholds.audible_share, effects::kAudibleShare);
  EXPECT_FALSE(usual.silence_pa.has_value() || usual.modes.has_value());
  EXPECT_EQ(usual.contact_step_s, physics::WorldOptions{}.contact_step_s);
  EXPECT_EQ(usual.instructions, synth::Isa::kBest);
  const Quality quality = parse("{\"duration_s\": 2, " + kBody + R"(, "quality": {"planner_db": -70, "quiet_db": 90,
    "silence_pa": 1e-6, "modes": 320, "contact_step_s": 1e-4, "instructions": "avx2"}})")
                              .quality;
  EXPECT_NEAR(quality.thresholds.audible_share, 1e-7, 1e-16);
  EXPECT_EQ(quality.thresholds.below_loudest_db, 90.0);
  EXPECT_EQ(quality.silence_pa, 1e-6);
  EXPECT_EQ(quality.modes, 320);
  EXPECT_EQ(quality.contact_step_s, 1e-4);
  EXPECT_EQ(quality.instructions, synth::Isa::kAvx2);
}

TEST(Scene, LeftEarIsOnTheLeft) {
  SceneListener listener;
  listener.position_m = {1.0, 2.0, 3.0};
  listener.facing = {0.0, 1.0, 0.0};
  auto ears = calc_ears(listener);
  EXPECT_NEAR(ears[0][0], 0.9, 1e-12);
  EXPECT_NEAR(ears[1][0], 1.1, 1e-12);
  EXPECT_NEAR(ears[0][2], 3.0, 1e-12);
  listener.facing = {0.0, 0.0, -1.0};
  ears = calc_ears(listener);
  EXPECT_NEAR(std::hypot(ears[0][0] - ears[1][0], ears[0][1] - ears[1][1], ears[0][2] - ears[1][2]), 0.2, 1e-12);
}

}  // namespace
}  // namespace carillon::scene
