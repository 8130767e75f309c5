// Surface readers: variants of valid files, and safety for arbitrary bytes.
#include <gtest/gtest.h>

#include <bit>
#include <cctype>
#include <cmath>

#include "precompute/mesher/surface.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/mesher/surfaces.hpp"

namespace carillon::mesher {
namespace {

using namespace testing;

std::string refusal(const std::string& text, const std::string& format) {
  return tests::catch_message<InputError>([&] { parse_surface(text, "body." + format, format); });
}

double volume_of(const std::string& text, const std::string& format) { return calc_volume(parse_surface(text, "body." + format, format)); }

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
  return text;
}

/// Line ends of another system.
std::string with_ends(const std::string& text, const std::string& end) {
  std::string out;
  for (const char c : text) out += c == '\n' ? end : std::string(1, c);
  return out;
}

const Polygons kBox = make_box(0.5, 0.25, 0.125);
const double kVolume = 0.5 * 0.25 * 0.125;

TEST(readers, line_ends_blanks_and_comments) {
  const std::pair<const char*, std::string> files[] = {
      {"obj", to_obj(kBox)}, {"off", to_off(kBox)}, {"ply", to_ply(kBox)}, {"stl", to_stl(kBox)}};
  for (const auto& [format, text] : files)
    for (const char* end : {"\n", "\r\n", "\r"}) {
      SCOPED_TRACE(format);
      EXPECT_NEAR(volume_of(with_ends(text, end), format), kVolume, 1e-12);
      EXPECT_NEAR(volume_of("\xEF\xBB\xBF" + with_ends(text, end), format), kVolume, 1e-12);
      EXPECT_NEAR(volume_of(text.substr(0, text.size() - 1), format), kVolume, 1e-12);
    }
  EXPECT_NEAR(volume_of("# first\n\n" + replaced(to_off(kBox), "OFF\n", "OFF # kind\n\n# counts\n"), "off"), kVolume, 1e-12);
  EXPECT_NEAR(volume_of(to_off(kBox).substr(4), "off"), kVolume, 1e-12);                                        // the word may be left out
  EXPECT_NEAR(volume_of(replaced(to_off(kBox), "OFF\n", "OFF "), "off"), kVolume, 1e-12);                       // or share its line
  EXPECT_NEAR(volume_of(replaced(to_off(kBox), "3 0 2 3\n", "3 0 2 3 0.1 0.2 0.3\n"), "off"), kVolume, 1e-12);  // colours
  EXPECT_NEAR(volume_of(replaced(to_off(kBox), "OFF", "COFF"), "off"), kVolume, 1e-12);
}

TEST(readers, obj_syntax) {
  const std::string text =
      "mtllib a.mtl\nv 0 0 0 1.0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nf 1/2/3 3//1 2\nf 1 2 4 # a side\nf -3 \\\n -2 -1\nf 1 4 3\nl 1 "
      "2\ns off\n";
  EXPECT_NEAR(volume_of(text, "obj"), 1.0 / 6, 1e-15);
  EXPECT_NE(refusal("v 0 0 0\nf -2 1 1\n", "obj").find("body.obj:2: the face names the vertex '-2'"), std::string::npos);
  EXPECT_NE(refusal("v 0 0\n", "obj").find("body.obj:1: a vertex has fewer"), std::string::npos);
}

/// The box as binary PLY of either byte order, with more around it than is needed: normals, colours, lists, elements of other names.
std::string to_rich_ply(const Polygons& s, bool big, const char* index_type) {
  std::string out =
      std::string("ply\nformat ") + (big ? "binary_big_endian" : "binary_little_endian") +
      " 1.0\ncomment a word\nobj_info more\nelement camera 1\nproperty list uchar double view\nproperty short flag\nelement vertex " +
      std::to_string(s.points.size()) +
      "\nproperty uchar red\nproperty double z\nproperty float nx\nproperty double x\nproperty double y\nelement face " +
      std::to_string(s.faces.size()) + "\nproperty char mark\nproperty list int " + index_type +
      " vertex_index\nproperty list uchar float texcoord\nend_header\n";
  const auto put = [&](auto value) {
    std::string bytes;
    append(bytes, value);
    out += big ? std::string(bytes.rbegin(), bytes.rend()) : bytes;
  };
  put(std::uint8_t{2});
  put(1.0), put(std::nan(""));
  put(std::int16_t{-3});
  for (const auto& p : s.points) put(std::uint8_t{255}), put(p[2]), put(0.5f), put(p[0]), put(p[1]);
  for (const auto& f : s.faces) {
    put(std::int8_t{-1});
    put(static_cast<std::int32_t>(f.size()));
    for (const int v : f) std::string(index_type) == "ushort" ? put(static_cast<std::uint16_t>(v)) : put(static_cast<std::uint32_t>(v));
    put(std::uint8_t{1});
    put(2.0f);
  }
  return out;
}

TEST(readers, binary_ply) {
  for (const bool big : {false, true})
    for (const char* type : {"ushort", "uint"}) EXPECT_NEAR(volume_of(to_rich_ply(kBox, big, type), "ply"), kVolume, 1e-12);
}

TEST(readers, ply_refusals) {
  const std::pair<std::string, const char*> cases[] = {
      {"ply\nformat ascii 1.0\nproperty float x\nend_header\n", "body.ply:3: a property before the first element"},
      {"ply\nelement vertex 0\nend_header\n", "has no format"},
      {"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nelement face 0\nend_header\n",
       "needs the properties x, y and z"},
      {"ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", "the header promises -1"},
      {"ply\nformat ascii 1.0\nelement vertex 3\nproperty quad x\n", "'quad' is no type"},
      {"ply\nformat ascii 1.0\n", "has no end_header"},
      {replaced(to_ply(kBox), "property list uchar int vertex_indices\n", ""), "has no property"},
      {replaced(to_ply(kBox), "list uchar int", "list float int"), "cannot be of type float"},
      {replaced(to_ply(kBox), "list uchar int vertex_indices", "list uchar int strips"), "needs a list vertex_indices"},
      {replaced(to_ply(kBox), "\n3 0 2 3\n", "\n3 0 2\n"), "promises '3' corners and has 2"},
      {replaced(to_ply(kBox), "\n3 0 2 3\n", "\n3 0 2 3 1\n"), "has 5 values and the header says 4"},
      {to_binary_ply(kBox).substr(0, 300), "byte"},
      {replaced(to_binary_ply(kBox), "element face 12", "element face 300"), "are left for them"},
      {replaced(to_binary_ply(kBox), "element vertex 8", "element vertex 7"), "byte"},
  };
  for (const auto& [text, words] : cases)
    EXPECT_NE(refusal(text, "ply").find(words), std::string::npos) << words << ": " << refusal(text, "ply");
}

TEST(readers, stl_detection) {
  std::string named = to_binary_stl(kBox);
  named.replace(0, 5, "solid");
  EXPECT_NEAR(volume_of(named, "stl"), kVolume, 1e-9);  // a header that begins as text does
  EXPECT_NEAR(volume_of(to_binary_stl(kBox) + std::string(7, '\0'), "stl"), kVolume, 1e-9);
  EXPECT_NEAR(volume_of(to_stl(kBox) + to_stl(kBox), "stl"), 2 * kVolume, 1e-9);  // two solids
  std::string shouted = to_stl(kBox);
  for (char& c : shouted) c = static_cast<char>(std::toupper(c));
  EXPECT_NEAR(volume_of(shouted, "stl"), kVolume, 1e-9);
  EXPECT_NE(refusal(to_stl(kBox).substr(0, to_stl(kBox).find("endloop")), "stl").find("ends before its endsolid"), std::string::npos);
  EXPECT_NE(refusal(replaced(to_stl(kBox), "endfacet\n", ""), "stl").find("a facet within a facet"), std::string::npos);
  EXPECT_NE(refusal(replaced(to_stl(kBox), "vertex 0 0 0\n", ""), "stl").find("with 2 corners"), std::string::npos);
  EXPECT_NE(refusal("solid a\nfoo\n", "stl").find("body.stl:2: found 'foo'"), std::string::npos);
  std::string infinite = to_binary_stl(kBox);
  const float value = HUGE_VALF;
  infinite.replace(84 + 12 + 8, 4, reinterpret_cast<const char*>(&value), 4);
  EXPECT_NE(refusal(infinite, "stl").find("byte 104: the coordinate inf of triangle 1"), std::string::npos) << refusal(infinite, "stl");
}

TEST(readers, truncated_files) {
  const std::pair<const char*, std::string> files[] = {{"obj", to_obj(kBox)},
                                                       {"off", to_off(kBox)},
                                                       {"ply", to_ply(kBox)},
                                                       {"stl", to_stl(kBox)},
                                                       {"stl", to_binary_stl(kBox)},
                                                       {"ply", to_binary_ply(kBox)},
                                                       {"ply", to_rich_ply(kBox, true, "uint")}};
  for (const auto& [format, text] : files)
    for (std::size_t size = 0; size < text.size(); ++size) {
      try {
        parse_surface(text.substr(0, size), "cut", format);
      } catch (const InputError& error) {
        EXPECT_EQ(std::string(error.what()).find("cut"), 0u) << error.what();
      }
    }
}

TEST(readers, points_equal_to_rounding) {
  // Regression: a corner 1.8e-42 off in one triangle became a slit, a duplicate sharp edge, and a crash of the mesher.
  Polygons box = make_box(0.1, 0.05, 0.03);
  box.points.push_back({0, 0, 1.793662034335766e-42});
  for (int& v : box.faces[4])
    if (v == 0) v = 8;
  SurfaceReport report;
  mesh_surface({.surface = write_text("slit.off", to_off(box)), .nodes = 300}, report);
  EXPECT_EQ(report.input_vertices, 8);
  EXPECT_EQ(report.holes_closed, 0);
  EXPECT_EQ(report.sharp_curves, 12);
  EXPECT_NEAR(report.volume_m3, 0.1 * 0.05 * 0.03, 1e-9);
}

TEST(readers, nested_parts) {
  const auto make = [](const Polygons& s, double shift) {
    TriangleSurface out;
    for (const auto& p : s.points) out.points.push_back({p[0] + shift, p[1] + shift, p[2] + shift});
    for (const auto& f : s.faces) out.triangles.push_back({f[0], f[1], f[2]});
    return out;
  };
  const auto join = [](TriangleSurface a, const TriangleSurface& b, bool flip) {
    const auto first = static_cast<std::int32_t>(a.points.size());
    a.points.insert(a.points.end(), b.points.begin(), b.points.end());
    for (Triangle t : b.triangles) {
      for (std::int32_t& v : t) v += first;
      if (flip) std::swap(t[0], t[1]);
      a.triangles.push_back(t);
    }
    return a;
  };
  const auto cube = make(make_box(4, 4, 4), 0), inner = make(make_box(2, 2, 2), 1), core = make(make_box(1, 1, 1), 1.5),
             far = make(make_box(1, 1, 1), 9);
  EXPECT_TRUE(is_nested(cube));
  EXPECT_TRUE(is_nested(join(cube, inner, true)));
  EXPECT_TRUE(is_nested(join(join(core, inner, true), cube, false)));
  EXPECT_TRUE(is_nested(join(cube, far, false)));
  EXPECT_FALSE(is_nested(join(cube, inner, false)));
  EXPECT_FALSE(is_nested(join(cube, far, true)));
  EXPECT_FALSE(is_nested(join(join(cube, inner, true), core, true)));
}

}  // namespace
}  // namespace carillon::mesher
