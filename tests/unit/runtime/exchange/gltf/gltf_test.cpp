// Round trip of glTF; GLB bytes by the specification.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "runtime/exchange/gltf/file.hpp"
#include "runtime/exchange/gltf/nodes.hpp"
#include "runtime/exchange/gltf/writer.hpp"

namespace carillon::gltf {
namespace {

std::string write(const Writer& writer) {
  std::string bytes;
  writer.write_glb([&](std::string_view piece) { bytes += piece; });
  return bytes;
}

std::uint32_t get_u32(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

TEST(Gltf, reads_back_exactly) {
  Writer writer("a test");
  const std::vector<float> rows{0.5F, -1.0F, 3.0F, 7.0F, 1e-7F, -2.0F}, scalars{1.0F, 2.5F, 1e30F};
  const int points = writer.add_vertices(rows, true), numbers = writer.add_scalars(scalars);
  const int corners = writer.add_indices(std::vector<std::int32_t>{0, 1, 1}, 2);
  const int blocks = writer.add_rows(2, 2, [](std::size_t block, std::span<float> values) {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(10 * block + i);
  });
  const std::vector<std::byte> raw{std::byte{1}, std::byte{2}, std::byte{3}};
  const int view = writer.add_bytes(raw);
  writer.json().set(
      "mine",
      base::Json::object().set("points", points).set("numbers", numbers).set("corners", corners).set("blocks", blocks).set("raw", view));
  const std::string bytes = write(writer);
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(get_u32(bytes, 4), 2);
  EXPECT_EQ(get_u32(bytes, 8), bytes.size());
  EXPECT_EQ(bytes.size() % 4, 0);

  File file = parse_glb(bytes, "test.glb");
  base::Object root = file.root(), mine = root.object("mine");
  const Numbers p = file.read(mine, "points", "VEC3", {Component::kFloat});
  ASSERT_EQ(p.count(), 2);
  for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(p.get(i / 3, i % 3), static_cast<double>(rows[i]));
  const Numbers s = file.read(mine, "numbers", "SCALAR", {Component::kFloat});
  ASSERT_EQ(s.count(), 3);
  EXPECT_EQ(s.get(2, 0), static_cast<double>(1e30F));
  const Numbers c = file.read(mine, "corners", "SCALAR", kIndexTypes);
  ASSERT_EQ(c.count(), 3);
  EXPECT_EQ(c.get(1, 0), 1);
  const Numbers b = file.read(mine, "blocks", "VEC3", {Component::kFloat});
  ASSERT_EQ(b.count(), 4);
  EXPECT_EQ(b.get(3, 2), 15);
  EXPECT_EQ(file.read_view(mine, "raw"), std::string("\x01\x02\x03"));
  std::vector<base::Object> accessors = root.objects("accessors"), views = root.objects("bufferViews");
  EXPECT_EQ(accessors[0].numbers<3>("min"), (std::array{0.5, -1.0, -2.0}));
  EXPECT_EQ(accessors[0].numbers<3>("max"), (std::array{7.0, static_cast<double>(1e-7F), 3.0}));
  EXPECT_EQ(views.back().integer("byteOffset", 0, 1000) % 8, 0);
}

TEST(Gltf, indices_take_32_bits_if_needed) {
  for (const auto& [vertices, component] : {std::pair<std::size_t, long long>(65535, 5123), {65536, 5125}, {70000, 5125}}) {
    Writer writer("a test");
    const auto last = static_cast<std::int32_t>(vertices - 1);
    const int corners = writer.add_indices(std::vector<std::int32_t>{0, 1, last}, vertices);
    writer.json().set("mine", base::Json::object().set("corners", corners));
    const std::string bytes = write(writer);
    File file = parse_glb(bytes, "test.glb");
    base::Object root = file.root(), mine = root.object("mine");
    EXPECT_EQ(root.objects("accessors")[0].integer("componentType", 0, 10000), component) << vertices;
    EXPECT_EQ(file.read(mine, "corners", "SCALAR", kIndexTypes).get(2, 0), last);
  }
}

TEST(Gltf, nodes_rotate_like_quaternions) {
  const base::Document document = base::parse_document(
      R"({"rotation": [0.70710678118654752, 0, 0, 0.70710678118654752], "translation": [1, 2, 3], "scale": [2, 2, 2]})", "node");
  base::Object node = document.root();
  const Vec3 moved = move(read_transform(node), {0.0, 1.0, 0.0});  // 90 degrees about x: y goes to z
  EXPECT_NEAR(moved[0], 1.0, 1e-12);
  EXPECT_NEAR(moved[1], 2.0, 1e-12);
  EXPECT_NEAR(moved[2], 5.0, 1e-12);
}

}  // namespace
}  // namespace carillon::gltf
