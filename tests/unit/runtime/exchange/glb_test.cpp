// GLB: lossless round trip of banks; import from other programs; damaged and modified files are rejected.
#include "runtime/exchange/glb.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/write.hpp"
#include "runtime/base/error.hpp"
#include "runtime/material/table.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"
#include "tests/support/paths.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::exchange {
namespace {

std::string to_glb(const bank::Bank& bank, const GlbOptions& options = {}) {
  std::string bytes;
  write_glb(bank, options, [&](std::string_view piece) { bytes += piece; });
  return bytes;
}

std::string find_error(const std::string& bytes, const GlbReading& reading = {}) {
  return tests::catch_message<InputError>([&] { (void)parse_glb(bytes, "body.glb", reading); });
}

/// Replaces a text in the JSON chunk and corrects the lengths.
std::string replace_json(const std::string& glb, const std::string& from, const std::string& to) {
  std::uint32_t length = 0;
  std::memcpy(&length, glb.data() + 12, 4);
  std::string json = glb.substr(20, length);
  const std::size_t at = json.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  json.replace(at, from.size(), to);
  while (json.size() % 4 != 0) json += ' ';
  const auto put = [](std::string& bytes, std::size_t place, std::size_t value) {
    const auto narrow = static_cast<std::uint32_t>(value);
    std::memcpy(bytes.data() + place, &narrow, 4);
  };
  std::string changed = glb.substr(0, 20) + json + glb.substr(20 + length);
  put(changed, 8, changed.size());
  put(changed, 12, json.size());
  return changed;
}

/// Two under-damped modes and an over-damped one.
bank::Bank make_damped() {
  bank::Bank bank = testing::make_cube_bank({{100.0, 900.0, 0.02, {0.4, 0.7, 1.1}, 0.07},
                                             {820.0, 12.0, 0.3, {0.4, -0.7, 1.1}, 0.07},
                                             {1730.0, 40.0, 0.3, {1.0, 0.1, 0.2}, 0.05}});
  bank.damping.law = "mixed";
  bank.material.alpha2_per_s = 0.0;
  return bank;
}

// The extension has the order and decays in air; the bank returns without them.
TEST(Glb, of_a_bank_with_multipoles_is_lossless) {
  const bank::Bank bank = bank::example::make_radiating_bank(2, 9), played = bank::calc_corrected(bank);
  const std::string glb = to_glb(bank);
  EXPECT_EQ(bank::make_bank_bytes(parse_glb(glb, "body.glb")), bank::make_bank_bytes(bank));
  const bank::Bank plain = parse_glb(glb, "body.glb", {.ignores_extras = true});
  EXPECT_TRUE(plain.multipoles.is_empty());
  ASSERT_EQ(plain.mode_count(), played.mode_count());
  for (std::size_t m = 0; m < plain.mode_count(); ++m) {
    EXPECT_NEAR(plain.freq_hz(m) / played.freq_hz(m), 1.0, 1e-6);
    EXPECT_NEAR(plain.decay_per_s[m] / played.decay_per_s[m], 1.0, 1e-6);
  }
}

TEST(Glb, of_released_banks_is_lossless) {
  int count = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(carillon::tests::get_source_dir()) / "tests/unit/runtime/bank/pinned")) {
    const bank::Bank bank = bank::read_bank(entry.path());
    EXPECT_EQ(bank::make_bank_bytes(parse_glb(to_glb(bank), "body.glb")), bank::make_bank_bytes(bank)) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 5);
}

TEST(Glb, keeps_overdamped_modes_and_narrow_shapes) {
  const bank::Bank damped = make_damped();
  EXPECT_EQ(bank::make_bank_bytes(parse_glb(to_glb(damped), "body.glb")), bank::make_bank_bytes(damped));
  EXPECT_EQ(parse_glb(to_glb(damped), "body.glb", {.model = {}, .ignores_extras = true, .material = nullptr}).mode_count(), 2);
  const bank::Bank narrow = bank::calc_reduced(damped, {.shape_bits = 8});
  ASSERT_EQ(narrow.shape_bytes, 1);
  EXPECT_EQ(bank::make_bank_bytes(parse_glb(to_glb(narrow), "body.glb")), bank::make_bank_bytes(narrow));
  const bank::Bank one = bank::calc_reduced(damped, {.modes = 1});
  EXPECT_EQ(bank::make_bank_bytes(parse_glb(to_glb(one), "body.glb")), bank::make_bank_bytes(one));
  EXPECT_THROW(to_glb(testing::make_cube_bank({})), InputError);
  bank::Bank still = testing::make_cube_bank({{100.0, 900.0, 0.02}});
  EXPECT_THROW(to_glb(still), InputError);
}

TEST(Glb, of_many_vertices_is_lossless) {
  bank::Bank bank = bank::example::make_bank(105, 2);
  ASSERT_GT(bank.vertex_count(), 65535);
  const std::string bytes = to_glb(bank);
  EXPECT_EQ(bank::make_bank_bytes(parse_glb(bytes, "body.glb")), bank::make_bank_bytes(bank));
  EXPECT_LT(bytes.size(), bank.vertex_count() * (2 * 12 + 24 + 2 * 12) + bank.triangles.size() * 12 + 100000);
}

TEST(Glb, read_plainly_has_single_precision) {
  const bank::Bank bank = make_damped();
  const bank::Bank plain = parse_glb(to_glb(bank), "body.glb", {.model = {}, .ignores_extras = true, .material = nullptr});
  ASSERT_EQ(plain.mode_count(), 2);
  for (std::size_t m = 0; m < 2; ++m) {
    EXPECT_NEAR(plain.freq_hz(m) / bank.freq_hz(m + 1), 1.0, 1e-7);
    EXPECT_NEAR(plain.decay_per_s[m] / bank.decay_per_s[m + 1], 1.0, 1e-7);
    for (std::size_t v = 0; v < bank.vertex_count(); ++v)
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(plain.shape_at(v, m)[c], bank.shape_at(v, m + 1)[c], 1.01 * bank.shape_scale[m + 1]);
  }
  EXPECT_NEAR(plain.rigid.mass_kg, bank.rigid.mass_kg, 1e-9);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(plain.rigid.inertia_kg_m2[i], bank.rigid.inertia_kg_m2[i], 1e-9);
  EXPECT_EQ(plain.damping.law, "mixed");
}

TEST(Glb, of_another_program_may_scale_and_omit_mass) {
  const bank::Bank bank = testing::make_cube_bank({{820.0, 12.0, 0.3, {0.4, -0.7, 1.1}, 0.07}});
  std::string bytes = replace_json(to_glb(bank), R"("massProperties")", R"("ignored")");
  bytes = replace_json(bytes, R"("nodes": [{"name": "body", )", R"("nodes": [{"children": [1], "scale": [2, 2, 2]}, {"name": "body", )");
  const GlbReading plain{.model = {}, .ignores_extras = true, .material = nullptr};
  const bank::Bank scaled = parse_glb(bytes, "body.glb", plain);
  EXPECT_NEAR(scaled.vertices_m[7][0], 0.1, 1e-7);  // a cube of 0.2 m: 8 litres of 1000 kg/m^3, m a^2 / 6
  EXPECT_NEAR(scaled.rigid.mass_kg, 8.0, 1e-5);
  EXPECT_NEAR(scaled.rigid.volume_m3, 8e-3, 1e-8);
  EXPECT_NEAR(scaled.rigid.inertia_kg_m2[0], 8.0 * 0.04 / 6.0, 1e-6);
  EXPECT_NEAR(scaled.rigid.inertia_kg_m2[1], 0.0, 1e-8);
  EXPECT_EQ(scaled.damping.law, "rayleigh");
  EXPECT_NEAR(scaled.freq_hz(0), 820.0, 1e-3);
  EXPECT_THAT(find_error(replace_json(bytes, "[2, 2, 2]", "[2, 2, 3]"), plain),
              ::testing::HasSubstr("not scaled by the same along all axes"));
  EXPECT_THAT(find_error(replace_json(bytes, R"("scale": [2, 2, 2])", R"("scale": [0, 0, 0])"), plain), ::testing::StartsWith("body.glb"));
}

/// The same model as a .gltf file with this buffer "uri", and the bytes of the buffer.
std::pair<std::string, std::string> to_gltf(const std::string& glb, const std::string& uri) {
  std::uint32_t length = 0;
  std::memcpy(&length, glb.data() + 12, 4);
  std::string text = glb.substr(20, length);
  const std::size_t at = text.find(R"("byteLength": )", text.find(R"("buffers": )"));
  EXPECT_NE(at, std::string::npos);
  text.insert(at, "\"uri\": \"" + uri + "\", ");
  return {text, glb.substr(28 + length)};
}

std::string to_base64(const std::string& bytes) {
  static const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k) bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : digits[bits >> (18 - 6 * k) & 63];
  }
  return text;
}

TEST(Glb, as_text_is_lossless) {
  const bank::Bank bank = make_damped();
  const std::string glb = to_glb(bank);
  const std::string data = to_base64(to_gltf(glb, "").second);
  EXPECT_EQ(bank::make_bank_bytes(parse_glb(to_gltf(glb, "data:application/octet-stream;base64," + data).first, "body.gltf")),
            bank::make_bank_bytes(bank));
  const tests::Folder folder;
  const std::string name = (folder / "body.gltf").string();
  const auto [text, bytes] = to_gltf(glb, "my%20modes%20%c3%a4..bin");
  EXPECT_THAT(find_error(text), ::testing::HasSubstr("there is no such file"));
  std::ofstream(folder / "my modes \xC3\xA4..bin", std::ios::binary) << bytes;
  EXPECT_EQ(bank::make_bank_bytes(parse_glb("\xEF\xBB\xBF" + text, name)), bank::make_bank_bytes(bank));
  std::ofstream(folder / "my modes \xC3\xA4..bin", std::ios::binary) << bytes.substr(0, 100);
  EXPECT_THROW((void)parse_glb(text, name), InputError);
  for (const char* uri : {"../modes.bin", "/etc/passwd", "https://example.org/modes.bin", "data:text/plain,AAAA", "%zz"})
    EXPECT_THAT(find_error(to_gltf(glb, uri).first),
                ::testing::AnyOf(::testing::HasSubstr("is not a file in the same folder"), ::testing::HasSubstr("is not base64")))
        << uri;
  std::string wide = "\xFF\xFE";
  for (const char c : text) wide += {c, '\0'};
  EXPECT_THAT(find_error(wide), ::testing::HasSubstr("UTF-16"));
}

TEST(Glb, of_another_program_is_imported) {
  const bank::Bank plain = parse_glb(to_glb(make_damped()), "body.glb", {.model = {}, .ignores_extras = true, .material = nullptr});
  EXPECT_EQ(plain.element, "imported");
  EXPECT_THAT(bank::describe_accuracy(plain), ::testing::StartsWith("unknown"));
  const bank::Bank again = parse_glb(to_glb(plain), "again.glb");
  EXPECT_EQ(bank::make_bank_bytes(again), bank::make_bank_bytes(plain));
}

/// Cube of 0.1 m in a scaled node, with the mass properties of a cube of `mass_kg` and an edge of `size_of_mass` times 0.1 m.
std::string make_scaled(double scale, double mass_kg, double size_of_mass = 1.0) {
  bank::Bank bank = testing::make_cube_bank({{820.0, 12.0, 0.3, {0.4, -0.7, 1.1}, 0.07}});
  bank.rigid.mass_kg *= mass_kg;
  bank.material.density_kg_m3 *= mass_kg;
  for (double& x : bank.rigid.inertia_kg_m2) x *= mass_kg * size_of_mass * size_of_mass;
  const std::string size = std::to_string(scale), before = R"("nodes": [{"name": "body", )";
  std::string bytes =
      replace_json(to_glb(bank), before, R"("nodes": [{"scale": [)" + size + ", " + size + ", " + size + R"(], "name": "body", )");
  const std::size_t at = bytes.find(R"("density": )");
  return replace_json(bytes, bytes.substr(at, bytes.find(',', at) - at), R"("density": 1000)");
}

TEST(Glb, scaled_node_is_resolved_by_mass) {
  const GlbReading plain{.model = {}, .ignores_extras = true, .material = nullptr};
  std::vector<std::string> notes;
  for (const double scale : {0.5, 2.0, 3.0}) {
    const double cube = scale * scale * scale;
    const bank::Bank moved = parse_glb(make_scaled(scale, 1.0), "body.glb", plain, &notes);  // mass of 0.1 m
    EXPECT_NEAR(moved.freq_hz(0), 820.0 / scale, 1e-3);
    EXPECT_NEAR(moved.rigid.mass_kg, cube, 1e-5 * cube);
    EXPECT_NEAR(moved.rigid.inertia_kg_m2[0], cube * 0.01 * scale * scale / 6.0, 1e-5 * cube);
    EXPECT_NEAR(moved.material.density_kg_m3, 1000.0, 0.01);
    EXPECT_NEAR(moved.vertices_m[7][0], 0.05 * scale, 1e-7);
    // Mass-normalised: phi scales with 1 / sqrt(mass).
    const bank::Bank alone = parse_glb(make_scaled(1.0, 1.0), "body.glb", plain);
    EXPECT_NEAR(moved.shape_at(3, 0)[2], alone.shape_at(3, 0)[2] / std::sqrt(cube), 1e-4);
    ASSERT_EQ(notes.size(), 1u);
    const bank::Bank kept = parse_glb(make_scaled(scale, cube, scale), "body.glb", plain, &notes);  // mass of the scaled cube
    EXPECT_NEAR(kept.freq_hz(0), 820.0, 1e-3);
    EXPECT_NEAR(kept.material.density_kg_m3, 1000.0, 0.01);
    EXPECT_TRUE(notes.empty());
  }
  const bank::Bank neither = parse_glb(make_scaled(2.0, 3.0, 2.0), "body.glb", plain, &notes);
  EXPECT_NEAR(neither.freq_hz(0), 820.0, 1e-3);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_THAT(notes[0], ::testing::HasSubstr("contradicts"));
  const bank::Bank uneven = parse_glb(make_scaled(1.0, 1.0, 2.0), "body.glb", plain, &notes);
  EXPECT_NEAR(uneven.rigid.inertia_kg_m2[0], 0.01 / 6.0, 1e-6);  // from the surface
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_THAT(notes[0], ::testing::HasSubstr("moments of inertia contradict"));
}

TEST(Glb, with_invalid_provenance_is_rejected) {
  bank::Bank bank = make_damped();
  bank.provenance = "{no JSON";
  EXPECT_THAT(find_error(to_glb(bank)), ::testing::HasSubstr("provenance is not JSON text"));
}

TEST(Glb, without_a_material_uses_the_given_one) {
  const std::string bytes = replace_json(to_glb(make_damped()), R"(, "material": 0)", "");
  GlbReading plain{.model = {}, .ignores_extras = true, .material = nullptr};
  EXPECT_THAT(find_error(bytes, plain), ::testing::HasSubstr("--material NAME"));
  plain.material = &material::MaterialTable::get().require("", "steel").material;
  EXPECT_EQ(parse_glb(bytes, "body.glb", plain).material.young_modulus_pa, plain.material->young_modulus_pa);
}

TEST(Glb, damaged_files_are_rejected_with_a_message) {
  const std::string whole = to_glb(make_damped());
  const auto change = [&](const std::string& from, const std::string& to) { return find_error(replace_json(whole, from, to)); };
  for (const auto& [said, words] : {
           std::pair{find_error("hello"), "does not begin with"},
           {find_error(whole + "x"), "truncated or extended"},
           {change(R"("KHR_audio_rigid_bodies": {"acoustic)", R"("KHR_audio": {"acoustic)"), "has no KHR_audio_rigid_bodies"},
           {change(R"("modalModels": [)", R"("others": [)"), "no modal model"},
           {change(R"("decayRates": 4)", R"("decayRates": 900)"), "decayRates"},
           {change(R"("decayRates": 4)", R"("decayRates": 0)"), "has to be SCALAR"},
           {change(R"("indices": 2, "material")", R"("material")"), "no \"indices\""},
           {change(R"("modes": [)", R"("modes": [7, )"), "7 is not a mode"},
           {change(R"("name": "modes/decay")", R"("name": "modes/decays")"), "modes/decay is missing"},
           {change(R"("name": "modes/shape_scale", "type": "<f8")", R"("name": "modes/shape_scale", "type": "<i8")"), "shape_scale"},
           {change(R"("name": "rigid/mass_kg", "type": "<f8", "shape": [])", R"("name": "rigid/mass_kg", "type": "<f8", "shape": [2])"),
            "has 8 bytes"},
           {change(R"("name": "rigid/mass_kg", "type": "<f8", "shape": [])",
                   R"("name": "rigid/mass_kg", "type": "<f8", "shape": [0, 9e15])"),
            "rigid/mass_kg"},
           {find_error(whole, {.model = 3, .ignores_extras = false, .material = nullptr}), "no model 3"},
       })
    EXPECT_THAT(said, ::testing::AllOf(::testing::StartsWith("body.glb"), ::testing::HasSubstr(words)));
}

TEST(Glb, mutations_give_a_bank_or_an_error) {
  const bank::Bank bank = testing::make_cube_bank({{820.0, 12.0, 0.3, {0.4, -0.7, 1.1}, 0.07}});
  const std::string whole = to_glb(bank);
  for (std::size_t n = 0; n < whole.size(); n += n < 64 ? 1 : 7) EXPECT_NE(find_error(whole.substr(0, n)), "") << n;
  for (std::size_t n = 0; n < whole.size(); ++n) {
    std::string changed = whole;
    changed[n] = static_cast<char>(changed[n] ^ (n % 3 == 0 ? '\x01' : n % 3 == 1 ? '\x20' : '\x80'));
    find_error(changed);
  }
}

TEST(Glb, as_the_corpus_of_the_fuzz_target_is_read) {
  const std::filesystem::path file =
      std::filesystem::path(carillon::tests::get_source_dir()) / "tests/unit/runtime/exchange/corpus/box.glb";
  std::ifstream stream(file, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(stream), {});
  EXPECT_EQ(parse_glb(bytes, "box.glb").mode_count(), 6);
}

}  // namespace
}  // namespace carillon::exchange
