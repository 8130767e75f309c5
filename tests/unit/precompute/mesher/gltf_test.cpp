// glTF and GLB: files of common programs give the body of their OFF file; faults give one error.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>
#include <string>

#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/mesher/surfaces.hpp"

namespace carillon::mesher {
namespace {

using namespace testing;

template <class T>
void put(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string pad(std::string bytes, char with) {
  while (bytes.size() % 4 != 0) bytes += with;
  return bytes;
}

std::string to_glb(const std::string& json, const std::string& binary) {
  const std::string text = pad(json, ' '), data = pad(binary, '\0');
  std::string glb = "glTF";
  put(glb, std::uint32_t{2});
  put(glb, static_cast<std::uint32_t>(12 + 8 + text.size() + (data.empty() ? 0 : 8 + data.size())));
  put(glb, static_cast<std::uint32_t>(text.size()));
  glb += "JSON" + text;
  if (data.empty()) return glb;
  put(glb, static_cast<std::uint32_t>(data.size()));
  glb += std::string("BIN\0", 4) + data;
  return glb;
}

/// One mesh of points and 16-bit indices.
struct Model {
  std::string binary;
  std::size_t points = 0, indices = 0;
  std::string nodes = R"([{"mesh": 0}])", scene = R"("scenes": [{"nodes": [0]}], "scene": 0)", primitive = "", more = "";

  std::string json(const std::string& buffer = "") const {
    const std::size_t at = 12 * points;
    return R"({"asset": {"version": "2.0", "generator": "a test"}, "buffers": [{"byteLength": )" + std::to_string(binary.size()) + buffer +
           R"(}], "bufferViews": [{"buffer": 0, "byteLength": )" + std::to_string(at) + R"(}, {"buffer": 0, "byteOffset": )" +
           std::to_string(at) + R"(, "byteLength": )" + std::to_string(2 * indices) +
           R"(}], "accessors": [{"bufferView": 0, "componentType": 5126, "count": )" + std::to_string(points) +
           R"(, "type": "VEC3", "min": [0, 0, 0]}, {"bufferView": 1, "componentType": 5123, "count": )" + std::to_string(indices) +
           R"(, "type": "SCALAR"}], "meshes": [{"name": "body", "primitives": [{"attributes": {"POSITION": 0, "NORMAL": 7}, "indices": 1)" +
           primitive + R"(}]}], "nodes": )" + nodes + ", " + scene + more + "}";
  }
};

Model make_model(const Polygons& body) {
  Model model;
  model.points = body.points.size();
  for (const auto& p : body.points)
    for (const double x : p) put(model.binary, static_cast<float>(x));
  for (const auto& f : body.faces)
    for (const int v : f) put(model.binary, static_cast<std::uint16_t>(v));
  model.indices = 3 * body.faces.size();
  return model;
}

TriangleSurface read(const Model& model) { return parse_surface(to_glb(model.json(), model.binary), "body.glb", "glb"); }

std::string find_error(const std::string& bytes, const std::string& format = "glb") {
  return tests::catch_message<InputError>([&] { parse_surface(bytes, "body." + format, format); });
}

/// Chain of child nodes; the last has the mesh.
std::string make_chain(int count) {
  std::string nodes = "[";
  for (int n = 1; n < count; ++n) nodes += "{\"children\": [" + std::to_string(n) + "]}, ";
  return nodes + "{\"mesh\": 0}]";
}

TEST(Gltf, points_and_indices) {
  const Polygons ball = make_sphere(0.5, 3);
  const TriangleSurface read_back = read(make_model(ball)), plain = to_triangles(ball);
  EXPECT_EQ(read_back.triangles, plain.triangles);
  for (std::size_t v = 0; v < plain.points.size(); ++v) EXPECT_LT(norm(read_back.points[v] - plain.points[v]), 1e-7);
}

TEST(Gltf, node_transforms) {
  Model model = make_model(make_box(1, 2, 3));
  // Turned by 90 degrees about z, stretched by 2 along its own x, moved; inside a node that is moved too.
  model.nodes = R"([{"children": [1], "translation": [10, 0, 0]},
    {"mesh": 0, "rotation": [0, 0, 0.70710678118654752, 0.70710678118654752], "scale": [2, 1, 1], "translation": [0, 0, 5]}])";
  const TriangleSurface turned = read(model);
  const Box box = calc_box(turned.points);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(box.low[c], (Vec3{8, 0, 5}[c]), 1e-6);
    EXPECT_NEAR(box.high[c], (Vec3{10, 2, 8}[c]), 1e-6);
  }
  EXPECT_NEAR(calc_volume(turned), 12, 1e-5);
  // Mirrored: the triangles still face out.
  model.nodes = R"([{"mesh": 0, "scale": [-1, 1, 1]}])";
  EXPECT_NEAR(calc_volume(read(model)), 6, 1e-5);
  model.nodes = R"([{"mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 4, 0, 0, 1]}])";
  EXPECT_NEAR(calc_box(read(model).points).high[0], 4, 1e-6);
  EXPECT_NEAR(calc_volume(read(model)), 6, 1e-5);
  // Meshes outside the scene are ignored; a mesh used by two nodes is duplicated.
  model.nodes = R"([{"mesh": 0}, {"mesh": 0, "translation": [9, 0, 0]}])";
  EXPECT_EQ(read(model).triangles.size(), 12);
  model.scene = R"("scenes": [{"nodes": [0, 1]}])";
  EXPECT_EQ(read(model).triangles.size(), 24);
  model.scene = R"("materials": [])";  // without a scene all meshes count
  EXPECT_EQ(read(model).triangles.size(), 12);
}

TEST(Gltf, strips_fans_and_integers) {
  Model strip;
  for (const auto& p : {Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{1, 1, 0}, Vec3{0, 2, 0}})
    for (const double x : p) put(strip.binary, static_cast<float>(x));
  for (const int v : {0, 1, 2, 3, 4}) put(strip.binary, static_cast<std::uint16_t>(v));
  strip.points = strip.indices = 5;
  strip.primitive = R"(, "mode": 5)";
  const TriangleSurface of_strip = read(strip);
  ASSERT_EQ(of_strip.triangles.size(), 3);
  for (const Triangle& t : of_strip.triangles)
    EXPECT_GT(cross(of_strip.points[t[1]] - of_strip.points[t[0]], of_strip.points[t[2]] - of_strip.points[t[0]])[2], 0);
  strip.primitive = R"(, "mode": 6)";
  EXPECT_EQ(read(strip).triangles.size(), 3);
  strip.primitive = R"(, "mode": 1)";
  EXPECT_THAT(find_error(to_glb(strip.json(), strip.binary)), ::testing::HasSubstr("no triangles in its scene"));

  // Positions as normalised bytes, four apart.
  std::string binary;
  for (const auto& p : {std::array{0, 0, 0}, std::array{127, 0, 0}, std::array{0, 127, 0}, std::array{0, 0, -127}})
    for (const int x : {p[0], p[1], p[2], 0}) put(binary, static_cast<std::int8_t>(x));
  const std::string json =
      R"({"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_mesh_quantization"], "buffers": [{"byteLength": 16}],
      "bufferViews": [{"buffer": 0, "byteLength": 16, "byteStride": 4}],
      "accessors": [{"bufferView": 0, "componentType": 5120, "normalized": true, "count": 3, "type": "VEC3"}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})";
  const TriangleSurface bytes = parse_surface(to_glb(json, binary), "b.glb", "glb");
  EXPECT_EQ(bytes.points[1], (Vec3{1, 0, 0}));
  EXPECT_EQ(bytes.triangles.size(), 1);
}

TEST(Gltf, embedded_and_external_buffers) {
  const Model model = make_model(make_box(1, 1, 1));
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string base64;
  for (std::size_t i = 0; i < model.binary.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < model.binary.size() ? static_cast<unsigned char>(model.binary[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) base64 += i * 8 + 6 * k < model.binary.size() * 8 ? kDigits[bits >> (18 - 6 * k) & 63] : '=';
  }
  const auto text = model.json(R"(, "uri": "data:application/octet-stream;base64,)" + base64 + "\"");
  EXPECT_NEAR(calc_volume(parse_surface(text, "b.gltf", "gltf")), 1, 1e-6);
  write_text("part.bin", model.binary);
  EXPECT_NEAR(calc_volume(read_surface(write_text("b.gltf", model.json(R"(, "uri": "part.bin")")))), 1, 1e-6);
  write_text("my part \xC3\xA4.bin", model.binary);  // URIs have escapes, and many programs write none
  EXPECT_NEAR(calc_volume(read_surface(write_text("b.gltf", model.json(R"(, "uri": "my%20part%20%C3%a4.bin")")))), 1, 1e-6);
  EXPECT_NEAR(calc_volume(read_surface(write_text("b.gltf", model.json(", \"uri\": \"my part \xC3\xA4.bin\"")))), 1, 1e-6);
  for (const char* uri : {"%2e%2e/part.bin", "%2Fetc/passwd", "part%.bin", "part%0.bin", "part%zz.bin", "part.bin%00"})
    EXPECT_THAT(find_error(model.json(", \"uri\": \"" + std::string(uri) + "\""), "gltf"),
                ::testing::HasSubstr("not a file in the same folder"))
        << uri;
  EXPECT_THAT(find_error(model.json(R"(, "uri": "/etc/passwd")"), "gltf"), ::testing::HasSubstr("not a file in the same folder"));
  EXPECT_THAT(find_error(model.json(R"(, "uri": "../part.bin")"), "gltf"), ::testing::HasSubstr("not a file in the same folder"));
  EXPECT_THAT(find_error(model.json(R"(, "uri": "data:text/plain,hello")"), "gltf"), ::testing::HasSubstr("not base64"));
  EXPECT_THAT(find_error(model.json(), "gltf"), ::testing::HasSubstr("has no bytes"));
}

TEST(Gltf, refusals) {
  const Model box = make_model(make_box(1, 1, 1));
  const auto with = [&](const std::string& nodes, const std::string& primitive, const std::string& more) {
    Model model = box;
    if (!nodes.empty()) model.nodes = nodes;
    model.primitive = primitive;
    model.more = more;
    return find_error(to_glb(model.json(), model.binary));
  };
  const auto replace = [&](const std::string& from, const std::string& to) {
    std::string json = box.json();
    const std::size_t at = json.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return find_error(to_glb(json.replace(at, from.size(), to), box.binary));
  };
  for (const auto& [said, words] : {
           std::pair{with(R"([{"mesh": 0, "skin": 0}])", "", ""), "bent by bones"},
           {with("", "", R"(, "animations": [{"channels": []}])"), "animated"},
           {with("", R"(, "targets": [{"POSITION": 0}])", ""), "morph targets"},
           {with("", "", R"(, "extensionsRequired": ["KHR_draco_mesh_compression"])"), "without compression"},
           {with(R"([{"mesh": 0, "children": [0]}])", "", ""), "inside itself"},
           {with(R"([{"mesh": 1}])", "", ""), "is 1, but no mesh has this index (there are 1)"},
           {with(R"([{"mesh": -1}])", "", ""), "is -1, but no mesh has this index"},
           {with(R"([{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {}}}])", "", ""), "in many places"},
           {with("", R"(, "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0}})", ""), "without compression"},
           {with(R"([{"children": [1]}, {"children": [0], "mesh": 0}])", "", ""), "inside itself"},
           {with(make_chain(300), "", ""), "200 deep"},
           {replace(R"("count": 36)", R"("count": 35)"), "35 corners, which is not a multiple of three"},
           {replace(R"("byteLength": 96)", R"("byteLength": 96, "byteStride": 0)"), "byteStride"},
           {replace(R"("byteLength": 96)", R"("byteLength": 96, "byteStride": 8)"), "a stride of 8 for 12 bytes"},
           {replace(R"("byteLength": 96)", R"("byteLength": 9223372036854775807)"), "byteLength"},
           {replace(R"({"bufferView": 0, )", R"({"bufferView": 0, "byteOffset": 9223372036854775807, )"), "byteOffset"},
           {replace(R"("buffer": 0, "byteLength": 96)", R"("buffer": 3, "byteLength": 96)"), "no buffer has this index"},
           {replace(R"("POSITION": 0)", R"("POSITION": 70)"), "no accessor has this index"},
           {replace(R"("scene": 0)", R"("scene": 4)"), "no scene has this index"},
           {with(R"([{"mesh": 0, "children": [7]}])", "", ""), "7 is not a node"},
           {with(R"([{"mesh": 0, "rotation": [0, 0, 0, 0]}])", "", ""), "not a rotation"},
           {with(R"([{"mesh": 0, "scale": [1e300, 1, 1]}])", "", ""), "is not finite or too large"},
           {with(R"([{"camera": 0}])", "", ""), "no triangles in its scene"},
           {replace(R"("count": 8)", R"("count": 800000000000)"), "more than its bufferView"},
           {replace(R"("count": 8)", R"("count": 9)"), "more than its bufferView"},
           {replace(R"("count": 8)", R"("count": -1)"), "count"},
           {replace(R"("count": 8)", R"("count": 5)"), "its index"},
           {replace(R"("byteOffset": 96)", R"("byteOffset": 1000)"), "ends at byte"},
           {replace(R"("componentType": 5126)", R"("componentType": 5124)"), "not a type of a position"},
           {replace(R"("componentType": 5123)", R"("componentType": 5126)"), "not a type of an index"},
           {replace(R"("type": "VEC3")", R"("type": "VEC4")"), "has to be VEC3"},
           {replace(R"("type": "VEC3")", R"("type": "VEC3", "sparse": {})"), "sparse"},
           {replace(R"("version": "2.0")", R"("version": "1.0")"), "only glTF 2"},
           {replace(R"({"bufferView": 0, )", "{"), "bufferView"},
       })
    EXPECT_THAT(said, ::testing::AllOf(::testing::StartsWith("body.glb:"), ::testing::HasSubstr(words)));
  const std::string whole = to_glb(box.json(), box.binary);
  EXPECT_THAT(find_error("hello"), ::testing::HasSubstr("does not begin with"));
  EXPECT_THAT(find_error(whole + "x"), ::testing::HasSubstr("truncated or extended"));
  EXPECT_THAT(find_error(to_glb("{", "")), ::testing::HasSubstr("body.glb"));
  EXPECT_THAT(find_error(to_glb(R"({"asset": {"version": "2.0"}, "images": [{"uri": "a.png"}]})", "")),
              ::testing::HasSubstr("no triangles"));
}

TEST(Gltf, triangle_limit) {
  Model many;
  for (int i = 0; i < 9; ++i) put(many.binary, static_cast<float>(i % 4));
  many.points = 3;
  many.indices = 30'000'000;
  many.binary.append(2 * many.indices, '\0');
  EXPECT_THAT(find_error(to_glb(many.json(), many.binary)), ::testing::HasSubstr("more than 5,000,000 triangles; reduce it"));
}

TEST(Gltf, value_and_buffer_limits) {
  Model box = make_model(make_box(1, 1, 1));
  box.nodes = R"([{"mesh": 0})";
  for (int n = 0; n < 3'000'000; ++n) box.nodes += ",{}";
  box.nodes += "]";
  EXPECT_THAT(find_error(to_glb(box.json(), box.binary)), ::testing::HasSubstr("more than 3000000 values; export the object alone"));
  const std::string buffer = R"({"byteLength": 3000000000, "uri": "none.bin"})";
  EXPECT_THAT(find_error(R"({"asset": {"version": "2.0"}, "buffers": [)" + buffer + ", " + buffer + "]}", "gltf"),
              ::testing::AllOf(::testing::HasSubstr("buffers[1].byteLength"), ::testing::HasSubstr("more than 4 GiB")));
}

TEST(Gltf, damaged_files) {
  const Model box = make_model(make_box(1, 1, 1));
  const std::string whole = to_glb(box.json(), box.binary);
  for (std::size_t n = 0; n < whole.size(); ++n) {
    EXPECT_NE(find_error(whole.substr(0, n)), "") << n;
    for (const char flip : {'\x01', '\x10', '\x80'}) {
      std::string changed = whole;
      changed[n] = static_cast<char>(changed[n] ^ flip);
      find_error(changed);
    }
  }
}

}  // namespace
}  // namespace carillon::mesher
