// GLB: lossless round trip of banks; import from other programs; damaged and modified files are rejected.
#include "runtime/exchange/glb.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
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

/// Component `i` of the coefficients of mode `m` [Pa s m^-1 kg^-1/2], i below 2 (order + 1)^2.
double get_component(const bank::Multipoles& air, std::size_t m, std::size_t i) {
  std::size_t first = 0;
  for (std::size_t k = 0; k < m; ++k) first += 2 * bank::count_coefficients(air.order[k]);
  return air.scale[m] * air.coefficient[first + i];
}

/// Both banks radiate the same, up to the rounding of float and, for coefficients, of 16 bits; lengths of `found` times `size`.
void compare_air(const bank::Bank& found, const bank::Bank& played, double size = 1.0) {
  const bank::Multipoles &a = found.multipoles, &b = played.multipoles;
  ASSERT_EQ(a.order, b.order);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(a.centre_m[c], size * b.centre_m[c], 1e-15);
  EXPECT_NEAR(a.radius_m, size * b.radius_m, 1e-15);
  EXPECT_NEAR(a.nearest_m, size * b.nearest_m, 1e-15);
  EXPECT_EQ(a.air_density_kg_m3, b.air_density_kg_m3);
  EXPECT_EQ(a.sound_speed_ms, b.sound_speed_ms);
  for (std::size_t m = 0; m < a.order.size(); ++m) {
    const double scale = b.scale[m] / std::pow(size, 1.5);
    EXPECT_NEAR(a.freq_hz[m] * size / b.freq_hz[m], 1.0, 1e-6);
    EXPECT_NEAR(a.decay_per_s[m] * size / b.decay_per_s[m], 1.0, 1e-7);
    EXPECT_NEAR(a.error_db[m], b.error_db[m], 1e-5);
    for (std::size_t i = 0; i < 2 * bank::count_coefficients(a.order[m]); ++i)
      EXPECT_NEAR(get_component(a, m, i), get_component(b, m, i) / std::pow(size, 1.5), 1e-7 * 32767.0 * scale) << m << " " << i;
  }
}

constexpr GlbReading kPlain{.model = {}, .ignores_extras = true, .material = nullptr};

// The extension has the order and decays in air.
TEST(Glb, of_a_bank_with_multipoles_is_lossless) {
  const bank::Bank bank = bank::example::make_radiating_bank(2, 9), played = bank::calc_corrected(bank);
  const std::string glb = to_glb(bank);
  EXPECT_EQ(bank::make_bank_bytes(parse_glb(glb, "body.glb")), bank::make_bank_bytes(bank));
  const bank::Bank plain = parse_glb(glb, "body.glb", kPlain), again = bank::calc_corrected(plain);
  EXPECT_TRUE(bank::find_faults(plain).empty());
  compare_air(plain, played);
  ASSERT_EQ(plain.mode_count(), played.mode_count());
  for (std::size_t m = 0; m < plain.mode_count(); ++m) {
    EXPECT_NEAR(again.freq_hz(m) / played.freq_hz(m), 1.0, 1e-6);
    EXPECT_NEAR(again.decay_per_s[m] / played.decay_per_s[m], 1.0, 1e-6);  // radiation counts once
    EXPECT_NEAR(again.radiation_gain[m] / played.radiation_gain[m], 1.0, 1e-6);
    EXPECT_NEAR(plain.decay_per_s[m], played.decay_per_s[m] - played.multipoles.decay_per_s[m], 1e-6 * played.decay_per_s[m]);
  }
  // Once more, nothing changes.
  const bank::Bank twice = parse_glb(to_glb(plain), "body.glb", kPlain);
  EXPECT_EQ(twice.multipoles.coefficient, plain.multipoles.coefficient);
  EXPECT_EQ(twice.shape, plain.shape);
}

TEST(Glb, coupled_modes_have_their_shapes_in_air) {
  bank::Bank bank = bank::example::make_radiating_bank(2, 9);
  bank::Multipoles& air = bank.multipoles;
  const std::size_t modes = bank.mode_count();
  for (std::size_t m = 0; m < modes; ++m) {
    const double whole = 1.0 / std::sqrt(1.0 + air.added_mass[m]);
    const std::size_t other = m == 0 ? 1 : 0;
    air.mixing.count.push_back(m < 2 ? 3 : 1);
    if (m >= 2) {
      air.mixing.motion.push_back(static_cast<std::int32_t>(m));
      air.mixing.part.push_back(whole);
      continue;
    }
    for (const std::size_t j : {std::min(m, other), std::max(m, other)}) {
      air.mixing.motion.push_back(static_cast<std::int32_t>(j));
      air.mixing.part.push_back((j == m ? 0.8 : m == 0 ? 0.48 : -0.48) * whole);
    }
    air.mixing.motion.push_back(static_cast<std::int32_t>(modes + 2));  // a translation
    air.mixing.part.push_back(0.36 * whole);
  }
  ASSERT_TRUE(bank::find_faults(bank).empty()) << bank::find_faults(bank)[0];
  const std::string glb = to_glb(bank);
  EXPECT_EQ(bank::make_bank_bytes(parse_glb(glb, "body.glb")), bank::make_bank_bytes(bank));
  const bank::Bank plain = parse_glb(glb, "body.glb", kPlain), played = bank::calc_corrected(bank);
  compare_air(plain, played);
  EXPECT_TRUE(plain.multipoles.mixing.is_empty());
  for (std::size_t m = 0; m < modes; ++m)
    for (std::size_t v = 0; v < bank.vertex_count(); ++v)
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(plain.shape_at(v, m)[c], played.shape_at(v, m)[c], 1e-3 * played.shape_scale[m]);
}

TEST(Glb, multipoles_scale_with_the_node) {
  const bank::Bank bank = bank::example::make_radiating_bank(2, 9);
  const std::string glb =
      replace_json(to_glb(bank), R"("nodes": [{"name": "body", )", R"("nodes": [{"scale": [2, 2, 2], "name": "body", )");
  const bank::Bank plain = parse_glb(glb, "body.glb", kPlain);
  compare_air(plain, bank::calc_corrected(bank), 2.0);
}

TEST(Glb, multipoles_are_checked) {
  const std::string whole = to_glb(bank::example::make_radiating_bank(2, 9));
  const auto change = [&](const std::string& from, const std::string& to) { return replace_json(whole, from, to); };
  const std::size_t at = whole.find("\"CARILLON_multipoles\": {");
  ASSERT_NE(at, std::string::npos);
  const auto find_number = [&](const std::string& key) {
    const std::size_t from = whole.find("\"" + key + "\": ", at);
    return whole.substr(from, whole.find_first_of(",}", from) - from);
  };
  const std::string coefficients = find_number("coefficients"), orders = find_number("orders"), radius = find_number("radius");
  const std::string place = "modalModels[0].extensions.CARILLON_multipoles.";
  const struct {
    std::string bytes, path, words;
  } cases[] = {
      {change(coefficients, R"("coefficients": 900)"), "coefficients", "no accessor has this index"},
      {change(coefficients, R"("coefficients": -1)"), "coefficients", "no accessor has this index"},
      {change(coefficients, R"("coefficients": 0)"), "", "has to be VEC2"},
      {change(coefficients, R"("coefficient": 0)"), "coefficients", "is missing"},
      {change(find_number("decayRates"), find_number("errors").replace(1, 6, "decayRates")), "decayRates", "not between 0 and"},
      {change(find_number("decayRates"), R"("decayRates": 2)"), "", "is not a type of"},
      {change(orders, R"("orders": [121)"), "orders", "121; an order is a whole number from 0 to 120"},
      {change(orders, R"("orders": [-1)"), "orders", "-1; an order"},
      {change(orders, R"("orders": [0.5)"), "orders", "0.5; an order"},
      {change(orders, orders + ", 1"), "orders", "10 numbers, but the model has 9 modes"},
      {change(orders, R"("orders": [120)"), "coefficients", "need"},
      {change(radius, R"("radius": 0)"), "radius", ""},
      {change(radius, R"("radius": 1e999)"), "", "number too big"},
      {change(radius, R"("radius": 9e9)"), "validRadius", "inside the sphere"},
  };
  for (const auto& one : cases)
    for (const bool is_plain : {false, true}) {
      const std::string said = find_error(one.bytes, {.model = {}, .ignores_extras = is_plain, .material = nullptr});
      EXPECT_THAT(said, ::testing::AllOf(::testing::StartsWith("body.glb"), ::testing::HasSubstr(one.words)));
      EXPECT_THAT(said, ::testing::HasSubstr(one.path.empty() ? "" : place + one.path));
    }
  // Numbers that are not finite: the first coefficient.
  std::uint32_t length = 0;
  std::memcpy(&length, whole.data() + 12, 4);
  const std::size_t accessor = std::stoul(coefficients.substr(coefficients.find(' ')));
  const auto find_nth = [&](const std::string& what, std::size_t from, std::size_t n) {
    std::size_t place_of = whole.find(what, from);
    for (std::size_t k = 0; k < n; ++k) place_of = whole.find(what, place_of + 1);
    return place_of;
  };
  const std::size_t view_at = find_nth("\"bufferView\": ", whole.find("\"accessors\": "), accessor);
  const std::size_t view = std::stoul(whole.substr(view_at + 14));
  const std::size_t offset_at = find_nth("\"byteOffset\": ", whole.find("\"bufferViews\": "), view);
  const std::size_t first = 20 + length + 8 + std::stoul(whole.substr(offset_at + 14));
  for (const float value : {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    std::string bytes = whole;
    std::memcpy(bytes.data() + first, &value, 4);
    EXPECT_THAT(find_error(bytes, kPlain),
                ::testing::AllOf(::testing::HasSubstr("coefficients"), ::testing::HasSubstr("not a finite number")));
  }
  // Another coefficient than in the extras.
  std::string bytes = whole;
  const float value = 1.0F;
  std::memcpy(bytes.data() + first, &value, 4);
  EXPECT_THAT(find_error(bytes), ::testing::HasSubstr("CARILLON_multipoles differs from its extras"));
}

TEST(Glb, without_the_multipoles_is_read_as_before) {
  const bank::Bank bank = bank::example::make_radiating_bank(2, 9), played = bank::calc_corrected(bank);
  const std::string glb = replace_json(to_glb(bank), R"("CARILLON_multipoles": {)", R"("OTHER_multipoles": {)");
  EXPECT_EQ(bank::make_bank_bytes(parse_glb(glb, "body.glb")), bank::make_bank_bytes(bank));
  const bank::Bank plain = parse_glb(glb, "body.glb", kPlain);
  EXPECT_TRUE(plain.multipoles.is_empty());
  for (std::size_t m = 0; m < plain.mode_count(); ++m) EXPECT_NEAR(plain.decay_per_s[m] / played.decay_per_s[m], 1.0, 1e-6);
  EXPECT_EQ(to_glb(make_damped()).find("CARILLON"), std::string::npos);
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
    EXPECT_THAT(notes, ::testing::ElementsAre(::testing::HasSubstr("unscaled")));
    const bank::Bank kept = parse_glb(make_scaled(scale, cube, scale), "body.glb", plain, &notes);  // mass of the scaled cube
    EXPECT_NEAR(kept.freq_hz(0), 820.0, 1e-3);
    EXPECT_NEAR(kept.material.density_kg_m3, 1000.0, 0.01);
    EXPECT_THAT(notes, ::testing::ElementsAre(::testing::HasSubstr("of the initial node")));
  }
  const bank::Bank neither = parse_glb(make_scaled(2.0, 3.0, 2.0), "body.glb", plain, &notes);
  EXPECT_NEAR(neither.freq_hz(0), 820.0, 1e-3);
  EXPECT_THAT(notes, ::testing::ElementsAre(::testing::HasSubstr("the masses do not say"), ::testing::HasSubstr("the mass is kept")));
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
  const auto read = [](const std::string& name) {
    const std::filesystem::path folder = std::filesystem::path(carillon::tests::get_source_dir()) / "tests/unit/runtime/exchange/corpus";
    std::ifstream stream(folder / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  EXPECT_EQ(parse_glb(read("box.glb"), "box.glb").mode_count(), 6);
  EXPECT_EQ(parse_glb(read("air.glb"), "air.glb", kPlain).multipoles.order.size(), 3);
}

}  // namespace
}  // namespace carillon::exchange
