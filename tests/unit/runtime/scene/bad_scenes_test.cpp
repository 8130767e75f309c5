// Invalid scenes: each is refused with a message that names its place.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/scene/scene_texts.hpp"

namespace carillon::scene {
namespace {

std::string with_joint(const std::string& keys) { return "{\"duration_s\": 1, " + kTwo + ",\n\"joints\": [{" + keys + "}]}"; }
std::string with_cord(const std::string& keys) { return "{\"duration_s\": 1, " + kTwo + ",\n\"cords\": [{" + keys + "}]}"; }

struct BadScene {
  const char* name;
  std::string text;
  std::vector<const char*> words;
};

void PrintTo(const BadScene& bad, std::ostream* out) { *out << bad.name; }

class BadSceneTest : public ::testing::TestWithParam<BadScene> {};

TEST_P(BadSceneTest, IsRefusedWithAMessageThatNamesThePlace) {
  try {
    parse(GetParam().text);
    FAIL() << "it was accepted";
  } catch (const InputError& error) {
    const std::string message = error.what();
    EXPECT_EQ(message.rfind("/somewhere/scene.json:", 0), 0u) << message;
    for (const char* word : GetParam().words) EXPECT_NE(message.find(word), std::string::npos) << "no \"" << word << "\" in: " << message;
  }
}

std::string with_body(const std::string& keys) {
  return "{\"duration_s\": 1,\n \"bodies\": [{\"name\": \"a\", \"bank\": \"a.h5\",\n  " + keys + "}]}";
}
std::string with_root(const std::string& keys) { return "{\"duration_s\": 1, " + kBody + ",\n" + keys + "}"; }

INSTANTIATE_TEST_SUITE_P(
    Scene, BadSceneTest,
    ::testing::Values(
        BadScene{"empty", "", {"JSON"}}, BadScene{"cut_short", "{\"duration_s\": 1, \"bodies\": [", {"JSON"}},
        BadScene{"a_list", "[1, 2]", {"object"}}, BadScene{"no_duration", "{" + kBody + "}", {"duration_s", "missing"}},
        BadScene{"negative_duration", "{\"duration_s\": -1, " + kBody + "}", {":1:", "duration_s", "out of range", "0.001"}},
        BadScene{"duration_as_text", "{\"duration_s\": \"1\", " + kBody + "}", {"duration_s", "number"}},
        BadScene{"endless", "{\"duration_s\": 1e9, " + kBody + "}", {"duration_s", "out of range", "3600"}},
        BadScene{"an_instant", "{\"duration_s\": 1e-9, " + kBody + "}", {"duration_s", "out of range", "0.001"}},
        BadScene{"low_rate", with_root("\"sample_rate_hz\": 100"), {":2:", "sample_rate_hz", "8000"}},
        BadScene{"no_bodies", "{\"duration_s\": 1}", {"bodies", "at least one"}},
        BadScene{"mistyped_bodies", "{\"duration_s\": 1,\n \"bodys\": []}", {":2:", "bodys", "did you mean \"bodies\"?"}},
        BadScene{"empty_bodies", "{\"duration_s\": 1, \"bodies\": []}", {"bodies", "at least one"}},
        BadScene{"misspelt_key", with_root("\"gravity_ms2\": [0, 0, 0]"), {":2:", "gravity_ms2", "gravity_m_s2"}},
        BadScene{"misspelt_body_key", with_body("\"positon_m\": [0, 0, 0]"), {":3:", "positon_m", "position_m"}},
        BadScene{"joint_of_no_kind", with_joint(R"("kind": "glue", "body": "a", "to": "b", "at_m": [0, 0, 0])"), {":2:", "kind", "hinge"}},
        BadScene{"joint_of_an_unknown_body",
                 with_joint(R"("kind": "ball", "body": "c", "to": "b", "at_m": [0, 0, 0])"),
                 {":2:", "no body is called \"c\""}},
        BadScene{"joint_without_end", with_joint(R"("kind": "ball", "body": "a", "at_m": [0, 0, 0])"), {":2:", "to", "missing"}},
        BadScene{"joint_without_a_place", with_joint(R"("kind": "ball", "body": "a", "to": "b")"), {":2:", "at_m", "missing"}},
        BadScene{
            "hinge_without_axis", with_joint(R"("kind": "hinge", "body": "a", "to": "b", "at_m": [0, 0, 0])"), {":2:", "axis", "missing"}},
        BadScene{"hinge_of_zero_axis",
                 with_joint(R"("kind": "hinge", "body": "a", "to": "b", "at_m": [0, 0, 0], "axis": [0, 0, 0])"),
                 {":2:", "axis", "no direction"}},
        BadScene{"ball_with_axis",
                 with_joint(R"("kind": "ball", "body": "a", "to": "b", "at_m": [0, 0, 0], "axis": [0, 0, 1])"),
                 {":2:", "axis", "remove it"}},
        BadScene{
            "universal_with_parallel_axes",
            with_joint(R"("kind": "universal", "body": "a", "to": "b", "at_m": [0, 0, 0], "axis": [0, 0, 1], "second_axis": [0, 0.1, 1])"),
            {":2:", "second_axis", "right angles"}},
        BadScene{"slider_with_limits_of_a_hinge",
                 with_joint(R"("kind": "slider", "body": "a", "to": "b", "at_m": [0, 0, 0], "axis": [0, 0, 1], "limits_deg": [-1, 1])"),
                 {":2:", "limits_deg", "limits_m"}},
        BadScene{"hinge_that_starts_beyond_its_stop",
                 with_joint(R"("kind": "hinge", "body": "a", "to": "b", "at_m": [0, 0, 0], "axis": [0, 0, 1], "limits_deg": [1, 2])"),
                 {":2:", "limits_deg", "the start, 0, between them"}},
        BadScene{"restitution_of_no_stop",
                 with_joint(R"("kind": "hinge", "body": "a", "to": "b", "at_m": [0, 0, 0], "axis": [0, 0, 1], "stop_restitution": 0.5)"),
                 {":2:", "stop_restitution", "limits_deg"}},
        BadScene{"joint_that_drives",
                 with_joint(R"("kind": "ball", "body": "a", "to": "b", "at_m": [0, 0, 0], "damping": -1)"),
                 {":2:", "damping", "out of range"}},
        BadScene{"cord_from_an_unknown_body",
                 with_cord(R"("from": {"body": "c", "at_m": [0, 0, 0]}, "to": {"at_m": [0, 0, 1]})"),
                 {":2:", "no body is called \"c\""}},
        BadScene{"cord_without_a_place",
                 with_cord(R"("from": {"body": "a", "at_m": [0, 0, 0]}, "to": {"body": "b"})"),
                 {":2:", "at_m", "missing"}},
        BadScene{"short_cord",
                 with_cord(R"("from": {"body": "a", "at_m": [0, 0, 0]}, "to": {"at_m": [0, 0, 1]}, "length_m": 0.5)"),
                 {":2:", "length_m", "at least"}},
        BadScene{"body_without_bank", "{\"duration_s\": 1, \"bodies\": [{\"name\": \"a\"}]}", {"bank", "missing"}},
        BadScene{"body_without_name", "{\"duration_s\": 1, \"bodies\": [{\"bank\": \"a.h5\"}]}", {"name", "missing"}},
        BadScene{"twice_the_name",
                 "{\"duration_s\": 1, \"bodies\": [{\"name\": \"a\", \"bank\": \"a.h5\"}, {\"name\": \"a\", \"bank\": \"b.h5\"}]}",
                 {"already", "\"a\"", "another name"}},
        BadScene{"two_numbers", with_body("\"position_m\": [0, 0]"), {":3:", "position_m", "3 numbers"}},
        BadScene{"far_away", with_body("\"position_m\": [0, 0, 1e9]"), {"position_m", "out of range", "10000"}},
        BadScene{"bent_quaternion", with_body("\"quaternion\": [1, 1, 0, 0]"), {"quaternion", "1.41421", "length 1"}},
        BadScene{"two_rotations",
                 with_body("\"quaternion\": [1, 0, 0, 0], \"rotation_deg\": [0, 0, 0]"),
                 {"quaternion", "rotation_deg", "keep one"}},
        BadScene{"moving_shelf", with_body("\"fixed\": true, \"velocity_m_s\": [1, 0, 0]"), {"velocity_m_s", "fixed"}},
        BadScene{"too_bouncy", with_body("\"restitution\": 1.5"), {"restitution", "from 0 to 1"}},
        BadScene{"sticky", with_body("\"restitution\": -0.1"), {"restitution", "from 0 to 1"}},
        BadScene{"negative_friction", with_body("\"friction\": -0.1"), {"friction", "out of range"}},
        BadScene{"faster_than_sound", with_body("\"velocity_m_s\": [400, 0, 0]"), {"velocity_m_s", "300"}},
        BadScene{"fixed_as_number", with_body("\"fixed\": 1"), {"fixed", "true or false"}},
        BadScene{"soft_ground", with_root("\"ground\": {\"young_modulus_pa\": 0}"), {"young_modulus_pa", "greater than 0"}},
        BadScene{"impossible_ground", with_root("\"ground\": {\"poisson_ratio\": 0.5}"), {"poisson_ratio", "0.5"}},
        BadScene{"ground_as_number", with_root("\"ground\": 0"), {"ground", "object"}},
        BadScene{"nowhere_to_look",
                 with_root("\"listener\": {\"position_m\": [1, 1, 1], \"look_at_m\": [1, 1, 1]}"),
                 {"look_at_m", "direction"}},
        BadScene{"two_directions",
                 with_root("\"listener\": {\"facing\": [1, 0, 0], \"look_at_m\": [1, 1, 1]}"),
                 {"look_at_m", "facing", "keep one"}},
        BadScene{"giant_head", with_root("\"listener\": {\"ear_distance_m\": 11}"), {"ear_distance_m", "from 0 to 10"}},
        BadScene{"ears_of_an_elf", with_root("\"listener\": {\"ears\": \"pointed\"}"), {"ears", "free", "hrtf"}},
        BadScene{"file_without_head", with_root("\"listener\": {\"sofa\": \"a.sofa\"}"), {":2:", "sofa", "\"ears\": \"hrtf\""}},
        BadScene{"order_without_ambisonics", with_root("\"listener\": {\"order\": 2}"), {":2:", "order", "\"ears\": \"ambisonic\""}},
        BadScene{"order_too_high", with_root("\"listener\": {\"ears\": \"ambisonic\", \"order\": 4}"), {":2:", "order", "1", "3"}},
        BadScene{"head_in_ambisonics",
                 with_root("\"listener\": {\"ears\": \"ambisonic\", \"sofa\": \"a.sofa\"}"),
                 {":2:", "sofa", "leave it out"}},
        BadScene{"file_as_number", with_root("\"listener\": {\"ears\": \"hrtf\", \"sofa\": 3}"), {"sofa"}},
        BadScene{"head_of_two_widths",
                 with_root("\"listener\": {\"ears\": \"hrtf\", \"sofa\": \"a.sofa\", \"ear_distance_m\": 0.18}"),
                 {"ear_distance_m", "leave it out"}},
        BadScene{"head_of_a_giant",
                 with_root("\"listener\": {\"ears\": \"hrtf\", \"ear_distance_m\": 0.7}"),
                 {"ear_distance_m", "from 0.06 to 0.6"}},
        BadScene{"heard_by_no_head", with_root("\"effects\": {\"head\": true}"), {"head", "\"ears\": \"hrtf\""}},
        BadScene{"heard_by_no_head_but_microphones",
                 with_root("\"effects\": {\"on\": [\"head\"]}, \"microphones\": [[0, 0, 1], [0, 0, 2]]"),
                 {"head", "\"ears\": \"hrtf\""}},
        BadScene{"gain_word", with_root("\"output\": {\"gain\": \"loud\"}"), {"gain", "auto", "number"}},
        BadScene{"gain_list", with_root("\"output\": {\"gain\": [1]}"), {"gain", "auto", "number"}},
        BadScene{"gain_zero", with_root("\"output\": {\"gain\": 0}"), {"gain", "greater than 0"}},
        BadScene{"unknown_format", with_root("\"output\": {\"format\": \"pcm25\"}"), {"format", "pcm24"}},
        BadScene{"unknown_effect", with_root("\"effects\": [\"dopler\"]"), {":2:", "effects", "dopler", "did you mean \"doppler\"?"}},
        BadScene{"effect_of_tomorrow", with_root("\"effects\": [\"reverberation\"]"), {"reverberation", "acceleration_noise"}},
        BadScene{"effect_twice", with_root("\"effects\": [\"modal\", \"modal\"]"), {"effects", "twice"}},
        BadScene{"object_in_effects", with_root("\"effects\": [{}]"), {":2:", "effects", "list of names"}},
        BadScene{"effects_by_another_word", with_root("\"effects\": \"all\""), {"effects", "\"all\"", "\"auto\""}},
        BadScene{"effects_as_number", with_root("\"effects\": 3"), {":2:", "effects"}},
        BadScene{"effect_on_and_off",
                 with_root("\"effects\": {\"on\": [\"doppler\"],\n\"off\": [\"modal\", \"doppler\"]}"),
                 {":3:", "off", "doppler", "keep one"}},
        BadScene{
            "unknown_effect_on", with_root("\"effects\": {\n\"on\": [\"hertz_puls\"]}"), {":3:", "on", "did you mean \"hertz_pulse\"?"}},
        BadScene{"unknown_key_of_effects", with_root("\"effects\": {\"onn\": []}"), {"onn", "\"on\""}},
        BadScene{"unknown_base_of_effects", with_root("\"effects\": {\"base\": \"all\"}"), {"base", "auto"}},
        BadScene{"unknown_effect_of_a_body",
                 R"({"duration_s": 1, "bodies": [{"name": "a", "bank": "a.h5",
  "effects": ["modl"]}]})",
                 {":2:", "modl", "did you mean \"modal\"?"}},
        BadScene{"path_and_position",
                 with_root("\"listener\": {\"path\": [[0, 0, 0, 0]], \"position_m\": [1, 1, 1]}"),
                 {":2:", "path", "position_m", "keep one"}},
        BadScene{"path_without_rows", with_root("\"listener\": {\"path\": []}"), {"path", "lists of 4"}},
        BadScene{"path_back_in_time", with_root("\"listener\": {\"path\": [[1, 0, 0, 0], [1, 0, 0, 1]]}"), {"path", "order of time"}},
        BadScene{
            "path_faster_than_sound", with_root("\"listener\": {\"path\": [[0, 0, 0, 0], [1, 0, 0, 400]]}"), {"path", "400 m/s", "300"}},
        BadScene{"path_far_away", with_root("\"listener\": {\"path\": [[0, 0, 0, 1e6]]}"), {"path", "out of range"}},
        BadScene{"path_for_ever", with_root("\"listener\": {\"path\": [[1e9, 0, 0, 0]]}"), {"path", "out of range"}},
        BadScene{"no_microphones", with_root("\"microphones\": []"), {":2:", "microphones", "1 to 16"}},
        BadScene{"flat_microphones", with_root("\"microphones\": [0, 0, 1]"), {"microphones", "list of 3 numbers"}},
        BadScene{"microphones_and_listener",
                 with_root("\"microphones\": [[0, 0, 1]], \"listener\": {}"),
                 {"microphones", "listener", "keep one"}},
        BadScene{"high_rate", with_root("\"sample_rate_hz\": 192001"), {":2:", "sample_rate_hz", "192000"}},
        BadScene{"broken_rate", with_root("\"sample_rate_hz\": 44100.5"), {":2:", "sample_rate_hz"}},
        BadScene{"head_inside_out", with_root("\"listener\": {\"ear_distance_m\": -1}"), {"ear_distance_m", "from 0 to 10"}},
        BadScene{"fade_as_number", with_root("\"output\": {\"fade_end\": 1}"), {":2:", "fade_end"}},
        BadScene{"misspelt_quality", with_root("\"quality\": {\"silence\": 1e-3}"), {":2:", "silence", "silence_pa"}},
        BadScene{"quality_that_is_a_number", with_root("\"quality\": 3"), {":2:", "quality", "object"}},
        BadScene{"loud_silence", with_root("\"quality\": {\"silence_pa\": 2}"), {":2:", "silence_pa", "out of range"}},
        BadScene{"coarse_contacts", with_root("\"quality\": {\"contact_step_s\": 0.1}"), {":2:", "contact_step_s", "0.002"}},
        BadScene{"fewer_modes_than_a_group", with_root("\"quality\": {\"modes\": 1}"), {":2:", "modes", "16"}},
        BadScene{"loud_effects", with_root("\"quality\": {\"planner_db\": 3}"), {":2:", "planner_db", "-10"}},
        BadScene{"unknown_instructions", with_root("\"quality\": {\"instructions\": \"altivec\"}"), {":2:", "instructions", "avx2"}},
        BadScene{"unknown_radiation", with_root("\"radiation\": \"sfere\""), {":2:", "radiation", "sphere"}},
        BadScene{"strikes_as_object", with_root("\"strikes\": {}"), {":2:", "strikes", "list"}},
        BadScene{"strike_at_no_body",
                 with_strike("\"time_s\": 0, \"body\": \"b\", \"triangle\": 0, \"impulse_n_s\": [0, 0, 1]"),
                 {":2:", "body", "no body is called \"b\""}},
        BadScene{"mallet_and_impulse",
                 with_strike(kMalletPlace +
                             R"("impulse_n_s": [0, 0, 1], "mallet": {"mass_kg": 1, "speed_m_s": 1, "felt": {"stiffness_n_m_p": 1e8}})"),
                 {"impulse_n_s", "follows from the \"mallet\""}},
        BadScene{
            "mallet_and_duration",
            with_strike(kMalletPlace + R"("duration_s": 0, "mallet": {"mass_kg": 1, "speed_m_s": 1, "felt": {"stiffness_n_m_p": 1e8}})"),
            {"duration_s", "follows from the \"mallet\""}},
        BadScene{"mallet_of_no_hardness",
                 with_strike(kMalletPlace + R"("mallet": {"mass_kg": 1, "speed_m_s": 1})"),
                 {"young_modulus_pa", "felt"}},
        BadScene{"mallet_of_no_name", with_strike(kMalletPlace + R"("mallet": "hammer")"), {"\"hammer\" is no known mallet", "soft-felt"}},
        BadScene{"mallet_from_nothing", with_strike(kMalletPlace + R"("mallet": {"from": "hammer"})"), {"no known mallet"}},
        BadScene{"mallet_of_no_material",
                 with_strike(kMalletPlace + R"("mallet": {"mass_kg": 1, "speed_m_s": 1, "radius_m": 0.01, "material": "glas"})"),
                 {"did you mean \"glass\""}},
        BadScene{"ground_of_no_material", with_root("\"ground\": {\"material\": \"concreet\"}"), {"did you mean \"concrete\""}},
        BadScene{"mallet_without_radius",
                 with_strike(kMalletPlace + R"("mallet": {"mass_kg": 1, "speed_m_s": 1, "young_modulus_pa": 3e9})"),
                 {"radius_m", "missing"}},
        BadScene{
            "mallet_hard_and_felt",
            with_strike(kMalletPlace + R"("mallet": {"mass_kg": 1, "speed_m_s": 1, "radius_m": 0.01, "felt": {"stiffness_n_m_p": 1e8}})"),
            {"radius_m", "felt", "keep one"}},
        BadScene{"mallet_without_mass",
                 with_strike(kMalletPlace + R"("mallet": {"mass_kg": 0, "speed_m_s": 1, "felt": {"stiffness_n_m_p": 1e8}})"),
                 {"mass_kg", "out of range"}},
        BadScene{"mallet_at_rest",
                 with_strike(kMalletPlace + R"("mallet": {"mass_kg": 1, "speed_m_s": -2, "felt": {"stiffness_n_m_p": 1e8}})"),
                 {"speed_m_s", "out of range"}},
        BadScene{
            "mallet_with_a_wild_exponent",
            with_strike(kMalletPlace + R"("mallet": {"mass_kg": 1, "speed_m_s": 1, "felt": {"stiffness_n_m_p": 1e8, "exponent": 60}})"),
            {"exponent", "out of range"}},
        BadScene{"mallet_without_direction",
                 with_strike(kMalletPlace +
                             R"("mallet": {"mass_kg": 1, "speed_m_s": 1, "felt": {"stiffness_n_m_p": 1e8}, "direction": [0, 0, 0]})"),
                 {"direction", "no direction"}},
        BadScene{"mallet_mistyped",
                 with_strike(kMalletPlace + R"("mallet": {"mass_kg": 1, "speed_m_s": 1, "felt": {"stifness": 1e8}})"),
                 {"stiffness_n_m_p"}},
        BadScene{"strike_without_time", with_strike("\"body\": \"a\", \"triangle\": 0, \"impulse_n_s\": [0, 0, 1]"), {"time_s", "missing"}},
        BadScene{"strike_after_the_end",
                 with_strike("\"time_s\": 1.5, \"body\": \"a\", \"triangle\": 0, \"impulse_n_s\": [0, 0, 1]"),
                 {"time_s", "1.5", "out of range"}},
        BadScene{"strike_before_the_beginning",
                 with_strike("\"time_s\": 0.001, \"duration_s\": 0.003, \"body\": \"a\", \"triangle\": 0, "
                             "\"impulse_n_s\": [0, 0, 1]"),
                 {"time_s", "out of range", "beginning"}},
        BadScene{
            "strike_nowhere", with_strike("\"time_s\": 0, \"body\": \"a\", \"impulse_n_s\": [0, 0, 1]"), {"point_m", "triangle", "either"}},
        BadScene{"strike_in_two_places",
                 with_strike("\"time_s\": 0, \"body\": \"a\", \"triangle\": 0, \"point_m\": [0, 0, 0], "
                             "\"impulse_n_s\": [0, 0, 1]"),
                 {"point_m", "triangle", "either"}},
        BadScene{"strike_without_impulse", with_strike("\"time_s\": 0, \"body\": \"a\", \"triangle\": 0"), {"impulse_n_s", "missing"}},
        BadScene{"strike_with_a_number",
                 with_strike("\"time_s\": 0, \"body\": \"a\", \"triangle\": 0, \"impulse_n_s\": 1"),
                 {"impulse_n_s", "3 numbers"}},
        BadScene{"strike_of_a_giant",
                 with_strike("\"time_s\": 0, \"body\": \"a\", \"triangle\": 0, \"impulse_n_s\": [0, 0, 1e9]"),
                 {"impulse_n_s", "out of range"}},
        BadScene{"endless_strike",
                 with_strike("\"time_s\": 0, \"body\": \"a\", \"triangle\": 0, \"impulse_n_s\": [0, 0, 1], \"duration_s\": 2"),
                 {"duration_s", "from 0 to 1"}},
        BadScene{"negative_triangle",
                 with_strike("\"time_s\": 0, \"body\": \"a\", \"triangle\": -1, \"impulse_n_s\": [0, 0, 1]"),
                 {"triangle", "-1"}},
        BadScene{
            "half_a_triangle", with_strike("\"time_s\": 0, \"body\": \"a\", \"triangle\": 0.5, \"impulse_n_s\": [0, 0, 1]"), {"triangle"}},
        BadScene{"misspelt_strike_key",
                 with_strike("\"time_s\": 0, \"body\": \"a\", \"triangle\": 0, \"impulse_n_s\": [0, 0, 1], \"durations\": 0"),
                 {":2:", "durations", "duration_s"}},
        BadScene{"key_twice", "{\"duration_s\": 1, \"duration_s\": 2, " + kBody + "}", {"duration_s"}}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace carillon::scene
