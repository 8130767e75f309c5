// Round trip of surfaces; damaged bytes are rejected or give a usable surface.
#include <gtest/gtest.h>

#include <algorithm>
#include <ctime>
#include <limits>
#include <set>

#include "runtime/bank/packed/inflate.hpp"
#include "runtime/bank/packed/neighbours.hpp"
#include "runtime/bank/packed/writer.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/runtime/bank/packed/surfaces.hpp"

namespace carillon::packed {
namespace {

using example::Mesh;

Triangle rotate_least_first(Triangle triangle) {
  std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()), triangle.end());
  return triangle;
}

/// Writes and reads a surface, and compares everything.
void expect_round_trip(const Mesh& mesh, unsigned levels) {
  constexpr Vec3 kOriginM{0.25, -3.0, 1e-3};
  constexpr double kStepM = 1.0 / 4096.0;
  const std::vector<Place> places = example::find_places(mesh, kStepM);
  std::vector<std::uint8_t> level(places.size());
  for (std::size_t v = 0; v < level.size(); ++v) level[v] = static_cast<std::uint8_t>(v * 7 % levels);
  const WrittenSurface written = write_surface(kOriginM, kStepM, places, mesh.triangles, level);
  const Surface surface = read_surface(example::as_bytes(written.bytes), "a surface");
  EXPECT_EQ(surface.origin_m, kOriginM);
  EXPECT_EQ(surface.step_m, kStepM);
  ASSERT_EQ(surface.places.size(), places.size());
  ASSERT_EQ(surface.triangles.size(), mesh.triangles.size());
  ASSERT_EQ(written.vertices.size(), places.size());
  ASSERT_EQ(written.triangles.size(), mesh.triangles.size());
  ASSERT_EQ(surface.level_count(), levels);
  EXPECT_EQ(surface.level_begin.front(), 0u);
  EXPECT_EQ(surface.level_begin.back(), places.size());
  EXPECT_EQ(std::set(written.vertices.begin(), written.vertices.end()).size(), places.size());
  EXPECT_EQ(std::set(written.triangles.begin(), written.triangles.end()).size(), mesh.triangles.size());
  std::size_t l = 0;
  for (std::size_t v = 0; v < places.size(); ++v) {
    const std::size_t from = written.vertices[v];
    while (v >= surface.level_begin[l + 1]) ++l;
    ASSERT_EQ(surface.places[v], places[from]) << v;
    ASSERT_EQ(level[from], l) << v;
    for (std::size_t k = 0; k < 3; ++k) ASSERT_DOUBLE_EQ(surface.find_vertex(v)[k], kOriginM[k] + kStepM * places[from][k]);
  }
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    Triangle back;
    for (std::size_t k = 0; k < 3; ++k) back[k] = written.vertices[surface.triangles[t][k]];
    ASSERT_EQ(rotate_least_first(back), rotate_least_first(mesh.triangles[written.triangles[t]])) << t;
  }
}

TEST(CodecSurface, reads_back_exactly_in_the_stated_order) {
  const std::vector<std::pair<const char*, Mesh>> meshes{{"tetrahedron", example::make_tetrahedron()},
                                                         {"ball", example::make_ball(3)},
                                                         {"torus", example::make_torus(24, 11)},
                                                         {"hollow ball", example::make_hollow_ball(2)},
                                                         {"touching balls", example::make_touching_balls(2)},
                                                         {"touching icosahedra", example::make_touching_balls(0)},
                                                         {"plate", example::make_plate(13)}};
  for (const auto& [name, mesh] : meshes) {
    SCOPED_TRACE(name);
    for (const unsigned seed : {1u, 2u, 3u, 4u}) expect_round_trip(example::shuffle(mesh, seed), 1 + seed % 4);
  }
}

TEST(CodecSurface, may_have_several_vertices_at_one_place) {
  Mesh mesh = example::make_ball(2);
  for (std::size_t v = 0; v < mesh.vertices_m.size(); v += 2) mesh.vertices_m[v] = {0.5, 0.5, 0.5};
  expect_round_trip(example::shuffle(mesh, 5), 2);
}

TEST(CodecSurface, uses_the_whole_lattice) {
  const Mesh mesh = example::make_tetrahedron();
  const std::vector<Place> places{
      {-kMaxPlace, -kMaxPlace, kMaxPlace}, {kMaxPlace, kMaxPlace, -kMaxPlace}, {0, kMaxPlace, kMaxPlace}, {kMaxPlace, -kMaxPlace, 1}};
  const WrittenSurface written = write_surface({}, 1.0, places, mesh.triangles, {0, 0, 0, 0});
  const Surface surface = read_surface(example::as_bytes(written.bytes), "a surface");
  for (std::size_t v = 0; v < places.size(); ++v) EXPECT_EQ(surface.places[v], places[written.vertices[v]]);
}

// Raw, a vertex of a closed surface takes 12 bytes and its two triangles 24.
TEST(CodecSurface, of_a_fine_ball_takes_six_bytes_per_vertex) {
  const Mesh mesh = example::shuffle(example::make_ball(5), 9);
  EXPECT_LT(static_cast<double>(example::write_mesh(mesh).size()), 6.0 * static_cast<double>(mesh.vertices_m.size()));
}

TEST(CodecSurface, vertices_are_ordered_by_level_and_curve) {
  const Surface surface = example::make_surface(example::shuffle(example::make_ball(4), 2), 1.0 / 8192.0);
  double sum = 0.0;
  const std::size_t first = surface.level_begin[surface.level_count() - 1];
  for (std::size_t v = first + 1; v < surface.places.size(); ++v) sum += norm(surface.find_vertex(v) - surface.find_vertex(v - 1));
  EXPECT_LT(sum / static_cast<double>(surface.places.size() - first), 0.15);  // 4/3 between random places of a unit sphere
}

TEST(CodecSurface, restores_triangle_numbers) {
  const Mesh mesh = example::shuffle(example::make_ball(2), 6);
  std::vector<Triangle> packed;
  TriangleOrder order;
  std::mt19937 random(6);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) order.before.push_back(static_cast<std::int32_t>(t));
  std::shuffle(order.before.begin(), order.before.end(), random);
  for (const std::int32_t t : order.before) {
    packed.push_back(mesh.triangles[t]);
    order.first.push_back(static_cast<std::uint8_t>(random() % 3));
    std::rotate(packed.back().begin(), packed.back().begin() + (3 - order.first.back()) % 3, packed.back().end());
  }
  const std::vector<std::uint8_t> bytes = write_order(order);
  std::vector<Triangle> back = packed;
  restore_order(example::as_bytes(bytes), back, "order");
  EXPECT_EQ(back, mesh.triangles);

  const auto expect_refused = [&](const char* why, auto&& change) {
    TriangleOrder bad = order;
    change(bad);
    std::vector<Triangle> triangles = packed;
    EXPECT_THROW(restore_order(example::as_bytes(write_order(bad)), triangles, "order"), InputError) << why;
  };
  expect_refused("twice", [](TriangleOrder& o) { o.before[3] = o.before[4]; });
  expect_refused("below 0", [](TriangleOrder& o) { o.before[3] = -1; });
  expect_refused("too many", [](TriangleOrder& o) { o.before[3] = static_cast<std::int32_t>(o.before.size()); });
  expect_refused("huge", [](TriangleOrder& o) { o.before[3] = std::numeric_limits<std::int32_t>::max(); });
  expect_refused("corner", [](TriangleOrder& o) { o.first[3] = 3; });
  expect_refused("one less", [](TriangleOrder& o) { o.before.pop_back(), o.first.pop_back(); });
  expect_refused("one more", [](TriangleOrder& o) { o.before.push_back(0), o.first.push_back(0); });
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    std::vector<Triangle> triangles = packed;
    EXPECT_THROW(restore_order(example::as_bytes(bytes).first(length), triangles, "order"), InputError) << length;
  }
}

TEST(CodecLevels, keep_a_maximal_distance_that_halves) {
  for (const Mesh& mesh : {example::shuffle(example::make_ball(4), 3), example::shuffle(example::make_plate(40), 4)}) {
    const std::vector<std::uint8_t> level = find_levels(mesh.vertices_m, example::calc_area_m2(mesh));
    ASSERT_EQ(level.size(), mesh.vertices_m.size());
    const int levels = *std::max_element(level.begin(), level.end()) + 1;
    ASSERT_GE(levels, 3);
    double before_m = 0.0;
    for (int l = 0; l < levels; ++l) {
      const auto count = std::count(level.begin(), level.end(), l);
      EXPECT_GT(count, l == 0 ? static_cast<std::ptrdiff_t>(kNeighbours) - 1 : 0) << l;
      if (l + 1 == levels) break;
      std::vector<Vec3> taken;
      for (std::size_t v = 0; v < level.size(); ++v)
        if (level[v] <= l) taken.push_back(mesh.vertices_m[v]);
      double least_m = std::numeric_limits<double>::infinity(), cover_m = 0.0;
      for (std::size_t i = 0; i < taken.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) least_m = std::min(least_m, norm(taken[i] - taken[j]));
      for (std::size_t v = 0; v < level.size(); ++v) {
        double near_m = std::numeric_limits<double>::infinity();
        for (const Vec3& x : taken) near_m = std::min(near_m, norm(x - mesh.vertices_m[v]));
        cover_m = std::max(cover_m, near_m);
      }
      EXPECT_LE(cover_m, least_m) << l;
      if (l > 0) {
        EXPECT_LT(least_m, 0.8 * before_m) << l;
        EXPECT_GT(least_m, 0.3 * before_m) << l;
      }
      before_m = least_m;
    }
  }
}

TEST(CodecLevels, are_one_for_few_vertices) {
  for (const Mesh& mesh : {example::make_tetrahedron(), example::make_ball(0), example::make_ball(1), example::make_ball(2)}) {
    const std::vector<std::uint8_t> level = find_levels(mesh.vertices_m, example::calc_area_m2(mesh));
    EXPECT_EQ(level, std::vector<std::uint8_t>(mesh.vertices_m.size(), 0));
  }
}

TEST(CodecLevels, none_is_empty_for_dense_vertices) {
  std::vector<Vec3> vertices_m(4000, Vec3{0.3, 0.2, 0.1});
  for (std::size_t v = 0; v < 40; ++v)
    vertices_m[100 * v] = {std::cos(static_cast<double>(v)), std::sin(static_cast<double>(v)), 0.01 * static_cast<double>(v)};
  const std::vector<std::uint8_t> level = find_levels(vertices_m, 1.0);
  const int levels = *std::max_element(level.begin(), level.end()) + 1;
  EXPECT_GE(levels, 2);
  for (int l = 0; l < levels; ++l)
    EXPECT_GE(std::count(level.begin(), level.end(), l), l == 0 ? static_cast<std::ptrdiff_t>(kNeighbours) : 1);
}

// ---- damaged bytes ----

/// False if rejected; accepted surfaces must be usable without further checks.
bool try_read(std::span<const std::byte> bytes) {
  try {
    const Surface surface = read_surface(bytes, "damaged");
    EXPECT_GT(surface.step_m, 0.0);
    EXPECT_EQ(surface.level_begin.front(), 0u);
    EXPECT_EQ(surface.level_begin.back(), surface.places.size());
    for (std::size_t l = 0; l < surface.level_count(); ++l) EXPECT_LT(surface.level_begin[l], surface.level_begin[l + 1]);
    for (const Triangle& triangle : surface.triangles)
      for (const std::int32_t v : triangle) {
        EXPECT_GE(v, 0);
        EXPECT_LT(static_cast<std::size_t>(v), surface.places.size());
      }
    for (const Place& place : surface.places)
      for (const std::int32_t x : place) EXPECT_LE(std::abs(x), kMaxPlace);
    return true;
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("damaged: packed surface: "), std::string::npos) << error.what();
    return false;
  }
}

TEST(CodecSurface, of_wrong_length_is_rejected) {
  std::vector<std::uint8_t> bytes = example::write_mesh(example::make_ball(2));
  ASSERT_TRUE(try_read(example::as_bytes(bytes)));
  for (std::size_t length = 0; length < bytes.size(); ++length) EXPECT_FALSE(try_read(example::as_bytes(bytes).first(length))) << length;
  bytes.push_back(0);
  EXPECT_FALSE(try_read(example::as_bytes(bytes)));
}

TEST(CodecSurface, with_a_flipped_bit_is_rejected_or_usable) {
  for (const Mesh& mesh : {example::make_tetrahedron(), example::make_touching_balls(1)}) {
    const std::vector<std::uint8_t> bytes = example::write_mesh(mesh);
    std::size_t read = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i)
      for (int bit = 0; bit < 8; ++bit) {
        std::vector<std::uint8_t> changed = bytes;
        changed[i] = static_cast<std::uint8_t>(changed[i] ^ (1 << bit));
        read += try_read(example::as_bytes(changed)) ? 1 : 0;
      }
    EXPECT_GT(read, 100u);  // the origin may differ
    EXPECT_LT(read, 4 * bytes.size());
  }
}

/// Input of read_surface() from independent streams.
struct Streams {
  std::uint8_t form = 1, levels = 1;
  std::uint32_t vertices = 0, triangles = 0, seeds = 1;
  std::array<double, 3> origin_m{};
  double step_m = 1.0;
  std::vector<std::uint8_t> corners;  // 0 to 3
  std::uint32_t other_count = 0;
  std::vector<std::uint32_t> others, places;
  std::vector<std::uint8_t> level;

  std::vector<std::uint8_t> write() const {
    Writer writer;
    writer.put(form);
    writer.put(levels);
    writer.put(vertices);
    writer.put(triangles);
    writer.put(seeds);
    for (const double x : origin_m) writer.put(x);
    writer.put(step_m);
    std::vector<std::uint8_t> fours((corners.size() + 3) / 4, 0);
    for (std::size_t i = 0; i < corners.size(); ++i) fours[i / 4] = static_cast<std::uint8_t>(fours[i / 4] | (corners[i] << (2 * (i % 4))));
    writer.put_block(fours);
    writer.put(other_count);
    writer.put_numbers(others);
    writer.put_numbers(places);
    writer.put_block(level);
    return writer.get_bytes();
  }
};

TEST(CodecSurface, of_random_symbols_is_rejected_or_usable) {
  std::mt19937 random(11);
  std::size_t read = 0;
  for (int round = 0; round < 3000; ++round) {
    Streams streams;
    streams.triangles = 1 + random() % 12;
    streams.corners.resize(streams.triangles + 2);
    std::size_t added = 0, named = 0;
    for (std::size_t i = 0; i < streams.corners.size(); ++i) {
      std::uint8_t& corner = streams.corners[i];
      corner = static_cast<std::uint8_t>(random() % 4);
      if (i < 3) corner = 0;
      added += corner == 0 ? 1 : 0;
      named += corner == 3 ? 1 : 0;
    }
    streams.vertices = static_cast<std::uint32_t>(added);
    streams.other_count = static_cast<std::uint32_t>(named);
    for (std::size_t i = 0; i < named; ++i) streams.others.push_back(static_cast<std::uint32_t>(random() % (random() % 8 == 0 ? 100 : 4)));
    for (std::size_t i = 0; i < 3 * added; ++i)
      streams.places.push_back(static_cast<std::uint32_t>(random() % (random() % 64 == 0 ? 1 << 26 : 50)));
    streams.level.assign(added, 0);
    read += try_read(example::as_bytes(streams.write())) ? 1 : 0;
  }
  EXPECT_GT(read, 100u);
  EXPECT_LT(read, 2900u);
}

TEST(CodecSurface, with_a_wrong_header_is_rejected) {
  Streams good;
  good.vertices = 3;
  good.triangles = 2;
  good.corners = {0, 0, 0, 1};
  good.places = {0, 2, 2, 0, 0, 2, 0, 0, 0};
  good.level = {0, 0, 0};
  ASSERT_TRUE(try_read(example::as_bytes(good.write())));
  const auto expect_refused = [&](const char* why, auto&& change) {
    Streams bad = good;
    change(bad);
    EXPECT_FALSE(try_read(example::as_bytes(bad.write()))) << why;
  };
  expect_refused("form", [](Streams& s) { s.form = 2; });
  expect_refused("no level", [](Streams& s) { s.levels = 0; });
  expect_refused("an empty level", [](Streams& s) { s.levels = 2; });
  expect_refused("33 levels", [](Streams& s) { s.levels = 33; });
  expect_refused("a level that is not there", [](Streams& s) { s.level[1] = 1; });
  expect_refused("step 0", [](Streams& s) { s.step_m = 0.0; });
  expect_refused("step NaN", [](Streams& s) { s.step_m = std::nan(""); });
  expect_refused("step infinite", [](Streams& s) { s.step_m = std::numeric_limits<double>::infinity(); });
  expect_refused("origin", [](Streams& s) { s.origin_m[2] = std::nan(""); });
  expect_refused("no triangles", [](Streams& s) { s.triangles = 0; });
  expect_refused("more triangles", [](Streams& s) { s.triangles = 3; });
  expect_refused("more vertices", [](Streams& s) { s.vertices = 4, s.places.resize(12), s.level.push_back(0); });
  expect_refused("fewer vertices", [](Streams& s) { s.vertices = 2, s.places.resize(6), s.level.pop_back(); });
  expect_refused("nothing at all", [](Streams& s) { s = Streams{}; });
  expect_refused("outside of the lattice", [](Streams& s) { s.places[1] = 2U << 24 | 2U; });
  expect_refused("a vertex twice", [](Streams& s) { s.corners[3] = 3, s.other_count = 1, s.others = {0xffffffffU}; });
  expect_refused("the corner of the gate", [](Streams& s) { s.corners[3] = 3, s.other_count = 1, s.others = {2}; });
  expect_refused("a seed that is not there", [](Streams& s) { s.seeds = 2, s.corners.resize(6); });
  for (std::uint32_t Streams::*count : {&Streams::vertices, &Streams::triangles, &Streams::seeds, &Streams::other_count})
    for (const std::uint32_t many : {0xffffffffU, 0x80000000U, 0x10000000U, 0x01000000U})
      expect_refused("a huge count", [&](Streams& s) { s.*count = many; });
}

/// Closes every second gate that does not touch the first vertex by a triangle with it, so that the number of open edges there grows.
Streams make_knot(std::uint32_t triangles) {
  Streams knot;
  knot.corners = {0, 0, 0};
  knot.triangles = triangles;
  knot.vertices = 3;
  std::set<std::pair<std::int32_t, std::int32_t>> open;
  std::vector<std::pair<std::int32_t, std::int32_t>> gates;  // in opening order
  const auto add = [&](std::int32_t from, std::int32_t to) {
    if (open.erase({to, from}) > 0) return;
    open.emplace(from, to);
    gates.emplace_back(from, to);
  };
  const auto add_triangle = [&](std::int32_t a, std::int32_t b, std::int32_t c) { add(a, b), add(b, c), add(c, a); };
  add_triangle(0, 1, 2);
  for (std::size_t t = 1, g = 0; t < triangles; ++t, ++g) {
    while (!open.contains(gates[g])) ++g;
    const auto [from, to] = gates[g];
    std::int32_t third = 0;
    if (from == 0 || to == 0 || g % 2 == 0) {
      third = static_cast<std::int32_t>(knot.vertices++);
      knot.corners.push_back(0);
    } else {
      knot.corners.push_back(3);
      knot.others.push_back(knot.vertices - 1);
    }
    add_triangle(to, from, third);
  }
  knot.other_count = static_cast<std::uint32_t>(knot.others.size());
  knot.places.assign(3 * std::size_t{knot.vertices}, 0);
  knot.level.assign(knot.vertices, 0);
  return knot;
}

TEST(CodecSurface, time_is_bounded_for_many_open_edges) {
  const std::vector<std::uint8_t> bytes = make_knot(200000).write();
  const std::clock_t begin = std::clock();  // CPU time, independent of load
  try_read(example::as_bytes(bytes));
  EXPECT_LT(std::clock() - begin, 5 * CLOCKS_PER_SEC) << bytes.size() << " bytes";
}

}  // namespace
}  // namespace carillon::packed
