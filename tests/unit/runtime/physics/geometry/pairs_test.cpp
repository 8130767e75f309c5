// Bodies that are not both convex polyhedra, against closed forms and against all triangles.
#include <gtest/gtest.h>

#include <set>
#include <tuple>

#include "tests/unit/runtime/physics/geometry/solids.hpp"

namespace carillon::geometry::tests {
namespace {

double find_min(const std::vector<Touch>& touches) {
  double min = 1e9;
  for (const Touch& t : touches) min = std::min(min, t.gap_m);
  return min;
}

void expect_consistent(const std::vector<Touch>& touches, const Frame& fa, const Frame& fb, double margin) {
  std::set<std::uint64_t> ids;
  for (const Touch& t : touches) {
    const Vec3 p = to_world(fa, t.station_a), q = to_world(fb, t.station_b);
    EXPECT_NEAR(norm(t.normal), 1.0, 1e-12);
    EXPECT_LE(t.gap_m, margin);
    EXPECT_NEAR(dot(t.normal, p - q), t.gap_m, 1e-9);
    EXPECT_NEAR(norm(t.where_m - 0.5 * (p + q)), 0.0, 1e-6);
    ids.insert(t.id);
  }
  EXPECT_EQ(ids.size(), touches.size());
}

TEST(pairs, ball_on_ball_any_way_round) {
  const double r = 0.01, R = 0.03;
  const auto small = make_ball(r, 6).make(), large = make_ball(R, 16).make();
  Dice dice(5);
  for (int i = 0; i < 200; ++i) {
    const double gap = dice.roll(-2e-4, 9e-4);
    Frame fa, fb;
    fa.rotation = dice.roll_turn();
    fb.rotation = dice.roll_turn();
    fb.position_m = dice.roll_way();
    const Vec3 way = dice.roll_way();
    fa.position_m = fb.position_m + (r + R + gap) * way;
    const auto touches = find(*small, fa, *large, fb, 1e-3);
    ASSERT_EQ(touches.size(), 1U) << i;
    const Touch& t = touches[0];
    EXPECT_NEAR(t.gap_m, gap, 5e-4 * r) << i;
    EXPECT_NEAR(norm(t.normal - way), 0.0, 0.015);
    EXPECT_NEAR(t.curvature_a_per_m * r, 1.0, 0.03);
    EXPECT_NEAR(t.curvature_b_per_m * R, 1.0, 0.03);
    expect_consistent(touches, fa, fb, 1e-3);
    const auto swapped = find(*large, fb, *small, fa, 1e-3);
    ASSERT_EQ(swapped.size(), 1U);
    EXPECT_NEAR(swapped[0].gap_m, t.gap_m, 5e-5 * r);
    EXPECT_NEAR(norm(swapped[0].normal + t.normal), 0.0, 0.01);
  }
}

/// Signed distance to a box about the origin.
double calc_box_distance(const Vec3& x, const Vec3& half) {
  double out = 0.0, max = -1e9;
  for (int k = 0; k < 3; ++k) {
    const double d = std::abs(x[k]) - half[k];
    if (d > 0.0) out += d * d;
    max = std::max(max, d);
  }
  return out > 0.0 ? std::sqrt(out) : max;
}

TEST(pairs, ball_on_face_edge_and_corner_of_a_box) {
  const double r = 0.03;
  const auto ball = make_ball(r, 16).make();
  for (const int n : {1, 6}) {
    const auto box = make_box({0.1, 0.2, 0.08}, n).make();
    Dice dice(17);
    for (int i = 0; i < 300; ++i) {
      Frame fa, fb;
      fa.rotation = dice.roll_turn();
      const Vec3 way = dice.roll_way();
      double along = 0.0;
      for (double step = 0.1; step > 1e-8; step *= 0.5)
        if (calc_box_distance((along + step) * way + Vec3{0.01, 0.02, -0.01}, {0.05, 0.1, 0.04}) < r + 2e-4) along += step;
      fa.position_m = along * way + Vec3{0.01, 0.02, -0.01};
      const double gap = calc_box_distance(fa.position_m, {0.05, 0.1, 0.04}) - r;
      ASSERT_NEAR(gap, 2e-4, 1e-6);
      const auto touches = find(*ball, fa, *box, fb, 1e-3);
      ASSERT_GE(touches.size(), 1U) << i;
      EXPECT_LE(touches.size(), 2U) << i;
      EXPECT_NEAR(find_min(touches), gap, 2e-4 * r) << i;
      expect_consistent(touches, fa, fb, 1e-3);
    }
  }
}

/// A bowl: half of a shell.
Solid make_bowl(double inner, double outer, int around, int steps) {
  std::vector<std::array<double, 2>> outline{{0.0, -outer}};
  for (int i = 1; i <= steps; ++i) {
    const double angle = 0.5 * std::numbers::pi * i / steps;
    outline.push_back({outer * std::sin(angle), -outer * std::cos(angle)});
  }
  for (int i = steps; i >= 1; --i) {
    const double angle = 0.5 * std::numbers::pi * i / steps;
    outline.push_back({inner * std::sin(angle), -inner * std::cos(angle)});
  }
  outline.push_back({0.0, -inner});
  return make_lathe(outline, around, false);
}

TEST(pairs, ball_in_a_bowl) {
  const double r = 0.02, inner = 0.06;
  const auto ball = make_ball(r, 16).make(), bowl = make_bowl(inner, 0.063, 96, 24).make();
  Dice dice(23);
  for (int i = 0; i < 60; ++i) {
    const double angle = dice.roll(0.05, 1.0), about = dice.roll(0, 6.28), gap = dice.roll(-1e-5, 1e-4);
    const Vec3 way{std::sin(angle) * std::cos(about), std::sin(angle) * std::sin(about), -std::cos(angle)};
    Frame fa, fb;
    fa.rotation = dice.roll_turn();
    fa.position_m = (inner - r - gap) * way;
    const auto touches = find(*ball, fa, *bowl, fb, 5e-4);
    ASSERT_EQ(touches.size(), 1U) << i;
    EXPECT_NEAR(touches[0].gap_m, gap, 3e-5) << i;
    EXPECT_GT(dot(touches[0].normal, -1.0 * way), 0.999) << i;
    EXPECT_LT(touches[0].curvature_b_per_m, 0.0);
    expect_consistent(touches, fa, fb, 5e-4);
  }
}

TEST(pairs, interlocked_rings) {
  const double R = 0.03, w = 0.004;
  const auto ring = make_ring(R, w, 96, 24).make();
  for (const double gap : {1e-4, 1e-5, -1e-5}) {
    Frame fa, fb;
    fb.rotation = make_turn({1, 0, 0}, std::numbers::pi / 2);
    fb.position_m = {2.0 * R - 2.0 * w - gap, 0, 0};
    const auto touches = find(*ring, fa, *ring, fb, 2e-4);
    ASSERT_EQ(touches.size(), 1U);
    EXPECT_NEAR(touches[0].gap_m, gap, 1e-5);
    EXPECT_NEAR(touches[0].normal[0], 1.0, 1e-3);
    EXPECT_NEAR(norm(touches[0].where_m - Vec3{R - w, 0, 0}), 0.0, 2e-4);
  }
  Frame fa, fb;  // free of each other
  fb.rotation = make_turn({1, 0, 0}, std::numbers::pi / 2);
  fb.position_m = {R, 0, 0};
  EXPECT_TRUE(find(*ring, fa, *ring, fb, 2e-4).empty());
}

TEST(pairs, ball_inside_a_hollow_ball) {
  Solid hollow = make_ball(0.05, 10), wall = make_ball(0.048, 10);
  wall.turn_inside_out();
  hollow.add(wall, {});
  const auto shell = hollow.make(), ball = make_ball(0.01, 6).make();
  Frame fa, fb;
  EXPECT_TRUE(find(*ball, fa, *shell, fb, 1e-3).empty());
  fa.position_m = (0.048 - 0.01 - 1e-4) * normalise({1, 2, -3});
  const auto touches = find(*ball, fa, *shell, fb, 1e-3);
  ASSERT_EQ(touches.size(), 1U);
  EXPECT_NEAR(touches[0].gap_m, 1e-4, 3e-5);
  EXPECT_GT(dot(touches[0].normal, -1.0 * normalise({1, 2, -3})), 0.999);
}

TEST(pairs, flush_hollow_boxes) {
  Solid hollow = make_box({0.06, 0.06, 0.04}, 3), inner = make_box({0.056, 0.056, 0.036}, 3);
  inner.turn_inside_out();
  hollow.add(inner, {});
  const auto box = hollow.make();
  ASSERT_FALSE(box->is_polyhedron());
  for (const double shift_m : {0.0, 1e-9, 0.01}) {
    Frame fa, fb;
    fa.position_m = {shift_m, 0, 0.04 - 1e-6};
    const auto touches = find(*box, fa, *box, fb, 1e-4);
    ASSERT_GE(touches.size(), 4U) << shift_m;
    double low = 1.0, high = -1.0;
    for (const Touch& t : touches) {
      EXPECT_NEAR(t.normal[2], 1.0, 1e-9);
      EXPECT_NEAR(t.gap_m, -1e-6, 1e-9);
      low = std::min(low, t.where_m[0]);
      high = std::max(high, t.where_m[0]);
    }
    EXPECT_NEAR(high - low, 0.06 - shift_m, 2e-4);
    expect_consistent(touches, fa, fb, 1e-4);
  }
}

TEST(pairs, crossed_rods_and_a_rod_on_a_board) {
  const double r = 0.01;
  const auto rod = make_cylinder(r, 0.1, 48).make(), board = make_box({0.3, 0.3, 0.02}, 3).make();
  Frame fa, fb;
  fb.rotation = make_turn({1, 0, 0}, std::numbers::pi / 2);
  for (const double angle : {0.3, 1.0, 1.5}) {
    fa.rotation = multiply(make_turn({0, 0, 1}, angle), fb.rotation);
    fa.position_m = {0.003, 0.004, 2.0 * r + 1e-5};
    const auto touches = find(*rod, fa, *rod, fb, 1e-4);
    ASSERT_EQ(touches.size(), 1U) << angle;
    EXPECT_NEAR(touches[0].gap_m, 1e-5, 2e-6);
    EXPECT_NEAR(touches[0].normal[2], 1.0, 1e-4);
  }
  fb.position_m = {0, 0, r + 0.01 - 1e-6};
  Frame flat;
  const auto touches = find(*rod, fb, *board, flat, 1e-4);
  ASSERT_GE(touches.size(), 2U);
  EXPECT_LE(touches.size(), 4U);
  double low = 1.0, high = -1.0;
  for (const Touch& t : touches) {
    low = std::min(low, t.where_m[1]);
    high = std::max(high, t.where_m[1]);
  }
  EXPECT_NEAR(high - low, 0.1, 0.004);
}

TEST(pairs, grain_on_a_body_a_thousand_times_its_size) {
  const double R = 0.1, r = 1e-4, gap = 1e-5;
  const auto large = make_lumpy(R, 20, 0.03).make(), grain = make_ball(r, 4).make(), crumb = make_box({r, r, r}).make();
  const auto surface = [&](const Vec3& way) {  // of the body that make_lumpy takes its vertices from
    const Vec3 u = normalise(way);
    return (R * (1.0 + 0.03 * std::sin(5.0 * u[0] + 1.0) * std::sin(6.0 * u[1]) * std::cos(4.0 * u[2] + 0.5))) * u;
  };
  Dice dice(31);
  Frame fb;
  for (int i = 0; i < 40; ++i) {
    const Vec3 way = dice.roll_way(), s = normalise(cross(way, Vec3{0.3, 0.5, 0.8})), t = cross(way, s);
    const Vec3 n = normalise(cross(surface(way + 1e-5 * s) - surface(way - 1e-5 * s), surface(way + 1e-5 * t) - surface(way - 1e-5 * t)));
    Frame fa;
    fa.rotation = dice.roll_turn();
    fa.position_m = surface(way) + (r + gap) * n;
    const auto touches = find(*grain, fa, *large, fb, 4e-5);
    ASSERT_EQ(touches.size(), 1U) << i;
    EXPECT_NEAR(touches[0].gap_m, gap, 1e-5) << i;  // 1e-4 of the large body; the sag of its facets is 4e-5 and more
    EXPECT_GT(dot(touches[0].normal, n), 0.999);
    const auto corners = find(*crumb, fa, *large, fb, 8e-5);
    ASSERT_FALSE(corners.empty()) << i;
    double low = 1.0;
    for (int c = 0; c < 8; ++c) {
      const Vec3 x = to_world(fa, {c & 1 ? r / 2 : -r / 2, c & 2 ? r / 2 : -r / 2, c & 4 ? r / 2 : -r / 2});
      low = std::min(low, dot(n, x - surface(way)));
    }
    EXPECT_NEAR(find_min(corners), low, 1e-5) << i;
    fa.position_m = surface(way) + 1.6e-4 * n;
    EXPECT_TRUE(find(*grain, fa, *large, fb, 4e-5).empty());
  }
}

/// The least distance between two meshes by all vertices and all triangles near them; no tree, no grid.
double calc_distance(const Solid& a, const Frame& fa, const Solid& b, const Frame& fb, double reach) {
  double min = 1e9;
  const auto from = [&](const Solid& mine, const Frame& fm, const Solid& theirs, const Frame& ft) {
    std::vector<Vec3> points;
    for (const Vec3& x : mine.vertices) points.push_back(to_body(ft, to_world(fm, x)));
    for (const auto& t : theirs.triangles) {
      const Vec3 &p = theirs.vertices[t[0]], u = theirs.vertices[t[1]] - p, v = theirs.vertices[t[2]] - p;
      const double size = std::max(norm(u), norm(v));
      for (const Vec3& x : points) {
        if (norm2(x - p) > (reach + size) * (reach + size)) continue;
        // Of the least squares over the triangle, by trying its inside, its edges and its corners.
        const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), ux = dot(u, x - p), vx = dot(v, x - p), det = uu * vv - uv * uv;
        const double s = (ux * vv - vx * uv) / det, w = (vx * uu - ux * uv) / det;
        const auto take = [&](double i, double j) { min = std::min(min, norm(x - p - i * u - j * v)); };
        if (s >= 0.0 && w >= 0.0 && s + w <= 1.0) take(s, w);
        take(std::clamp(ux / uu, 0.0, 1.0), 0.0);
        take(0.0, std::clamp(vx / vv, 0.0, 1.0));
        const double e = std::clamp(dot(v - u, x - p - u) / dot(v - u, v - u), 0.0, 1.0);
        take(1.0 - e, e);
      }
    }
  };
  from(a, fa, b, fb);
  from(b, fb, a, fa);
  return min;
}

/// The part of a solid that lies furthest along a way (of the world).
Solid cut_cap(const Solid& s, const Frame& f, const Vec3& way, double depth) {
  double max = -1e9;
  for (const Vec3& x : s.vertices) max = std::max(max, dot(way, to_world(f, x)));
  Solid cap;
  std::vector<std::int32_t> kept(s.vertices.size(), -1);
  for (const auto& t : s.triangles) {
    bool near = true;
    for (const std::int32_t v : t) near = near && dot(way, to_world(f, s.vertices[v])) > max - depth;
    if (!near) continue;
    auto corners = t;
    for (std::int32_t& v : corners) {
      if (kept[v] < 0) {
        kept[v] = static_cast<std::int32_t>(cap.vertices.size());
        cap.vertices.push_back(s.vertices[v]);
      }
      v = kept[v];
    }
    cap.triangles.push_back(corners);
  }
  return cap;
}

TEST(pairs, smooth_body_behind_the_facets_against_all_triangles_of_a_finer_mesh) {
  const double R = 0.05, reach = 0.004;
  const auto a = make_lumpy(R, 16).make(), b = make_lumpy(0.8 * R, 14, 0.1).make();
  const Solid fine_a = make_lumpy(R, 40), fine_b = make_lumpy(0.8 * R, 40, 0.1);
  Dice dice(41);
  int compared = 0;
  for (int i = 0; i < 10; ++i) {
    Frame fa, fb;
    fa.rotation = dice.roll_turn();
    fb.rotation = dice.roll_turn();
    const Vec3 way = dice.roll_way();
    double apart = 2.1 * R;
    fa.position_m = apart * way;
    const Solid cap_a = cut_cap(fine_a, fa, -1.0 * way, 0.012), cap_b = cut_cap(fine_b, fb, way, 0.012);
    double gap = 0.0;
    for (int k = 0; k < 12; ++k) {  // nearer by no more than the distance
      fa.position_m = apart * way;
      gap = calc_distance(cap_a, fa, cap_b, fb, reach);
      if (gap < 5e-4) break;
      apart -= gap > 1.0 ? 0.8 * reach : 0.9 * gap;
    }
    ASSERT_LT(gap, 5e-4);
    const auto touches = find(*a, fa, *b, fb, 2e-3);
    ASSERT_FALSE(touches.empty()) << i;
    EXPECT_NEAR(find_min(touches), gap, 4e-4 * R) << i;  // facets of a: 1.1e-3 R
    expect_consistent(touches, fa, fb, 2e-3);
    ++compared;
  }
  EXPECT_EQ(compared, 10);
}

/// Moves b along `way` to where the meshes begin to overlap, and `deeper_m` further. False where they pass each other.
bool bring_together(const Shape& a, const Frame& fa, const Shape& b, Frame& fb, const Vec3& way, double deeper_m) {
  const Vec3 aside = fb.position_m;
  const auto overlap_at = [&](double distance) {
    Vec3 where{};
    fb.position_m = aside + distance * way;
    return calc_overlap(a, fa, b, fb, where) > 0.0;
  };
  const double step = 2e-3, far = a.get_radius_m() + b.get_radius_m();
  double apart = far;
  while (apart > -far && !overlap_at(apart)) apart -= step;
  if (apart <= -far) return false;
  double together = apart;
  for (apart += step; apart - together > 1e-7;) {
    const double between = 0.5 * (apart + together);
    (overlap_at(between) ? together : apart) = between;
  }
  fb.position_m = aside + (together - deeper_m) * way;
  return true;
}

std::unique_ptr<Shape> make_cup() {
  return make_lathe({{0, 0}, {0.025, 0}, {0.0325, 0.02}, {0.04, 0.09}, {0.037, 0.09}, {0.0295, 0.021}, {0.023, 0.004}, {0, 0.004}}, 40,
                    false)
      .make();
}

TEST(pairs, rims_on_curved_parts) {
  const auto coin = make_cylinder(0.012, 0.002, 48).make(), ring = make_ring(0.02, 0.003, 48, 16).make();
  const auto cup = make_cup();
  Dice dice(7);
  int compared = 0, missed = 0;
  using Two = std::pair<const Shape*, const Shape*>;
  for (const auto& [a, b] : {Two{ring.get(), coin.get()}, {cup.get(), coin.get()}, {cup.get(), ring.get()}, {cup.get(), cup.get()}}) {
    for (int i = 0; i < 25; ++i) {
      Frame fa, fb;
      fa.rotation = dice.roll_turn();
      fb.rotation = dice.roll_turn();
      const Vec3 way = dice.roll_way(), aside = dice.roll_way();
      fb.position_m = (0.3 * a->get_radius_m()) * (aside - dot(aside, way) * way);
      if (!bring_together(*a, fa, *b, fb, way, 3e-4)) continue;
      ++compared;
      const auto touches = find(*a, fa, *b, fb, 2e-4);
      if (touches.empty() || find_min(touches) > 0.0) ++missed;
    }
  }
  EXPECT_GE(compared, 80);
  EXPECT_LE(missed, 4);  // where curved parts meet with a kink
}

TEST(pairs, bound_of_gap_change) {
  const auto cup = make_cup();
  const auto bowl = [] {
    std::vector<std::array<double, 2>> outline;
    for (int i = 0; i <= 12; ++i) outline.push_back({0.08 * std::sin(0.1 * i), 0.08 * (1 - std::cos(0.1 * i))});
    for (int i = 12; i >= 0; --i) outline.push_back({0.076 * std::sin(0.1 * i), 0.08 - 0.076 * std::cos(0.1 * i)});
    return make_lathe(outline, 48, false).make();
  }();
  Dice dice(11);
  int followed = 0;
  for (int i = 0; i < 30; ++i) {
    Frame fa, fb;
    fa.rotation = dice.roll_turn();
    fb.rotation = dice.roll_turn();
    if (!bring_together(*bowl, fa, *cup, fb, dice.roll_way(), 0.0)) continue;
    auto touches = find(*bowl, fa, *cup, fb, 3e-3);
    PairMemory memory;
    const Vec3 way = dice.roll_way(), axis = dice.roll_way();
    constexpr double kWay = 3e-4;
    for (int n = 0; n < 15; ++n) {
      fb.position_m = fb.position_m + kWay * way;
      fb.rotation = multiply(make_turn(axis, 5e-3), fb.rotation);
      for (Touch& t : touches) {
        const double before = t.gap_m;
        refresh(t, *bowl, fa, cup.get(), fb);
        EXPECT_GT(t.gap_m, before - 2e-3) << i;
        ++followed;
      }
    }
  }
  EXPECT_GE(followed, 300);
}

TEST(pairs, memory_equals_new_search) {
  const double R = 0.05;
  const auto a = make_lumpy(R, 16).make(), b = make_lumpy(R, 16, 0.1).make();
  Frame fa, fb;
  fa.rotation = make_turn({1, 2, 3}, 1.0);
  PairMemory memory;
  std::vector<Touch> out;
  Touch kept;
  for (int i = 0; i < 300; ++i) {
    fa.position_m = {0.01 + 2e-5 * i, 0.02, 0.0963};
    fa.rotation = multiply(make_turn({0, 0, 1}, 2e-4), fa.rotation);
    find_touches(*a, fa, *b, fb, 2e-3, memory, out);
    const auto fresh = find(*a, fa, *b, fb, 2e-3);
    ASSERT_FALSE(out.empty());
    EXPECT_NEAR(find_min(out), find_min(fresh), 1e-5 * R) << i;
    if (i > 0) {
      refresh(kept, *a, fa, b.get(), fb);
      EXPECT_NEAR(kept.gap_m, find_min(out), 2e-5 * R) << i;
    }
    for (const Touch& t : out)
      if (t.gap_m == find_min(out)) kept = t;
  }
}

TEST(pairs, deepest_sample_from_memory) {
  const auto lumpy = make_lumpy(0.05, 12, 0.1).make(), ring = make_ring(0.05, 0.008, 48, 16).make(),
             box = make_box({0.1, 0.1, 0.03}, 6).make();
  const auto cup = make_lathe({{0, 0}, {0.03, 0}, {0.035, 0.08}, {0.033, 0.08}, {0.028, 0.002}, {0, 0.002}}, 40, false).make();
  Dice dice(11);
  int deep = 0;
  for (const auto& [first, second, height] : {std::tuple(lumpy.get(), lumpy.get(), 0.1), std::tuple(ring.get(), lumpy.get(), 0.056),
                                              std::tuple(cup.get(), ring.get(), 0.0075), std::tuple(lumpy.get(), box.get(), 0.063)}) {
    PairMemory memory;
    Frame fa, fb;
    fb.rotation = dice.roll_turn();
    if (second == box.get() || first == cup.get()) fb.rotation = Frame{}.rotation;
    fa.position_m = {0, 0, height};
    for (int i = 0; i < 400; ++i) {
      fa.position_m = fa.position_m + (i % 50 == 0 ? 1e-3 : 1e-4) * dice.roll_way();
      fa.rotation = multiply(make_turn(dice.roll_way(), 2e-3), fa.rotation);
      PairMemory none;
      const Deepest kept = find_deepest(*first, fa, *second, fb, -5e-6, memory), fresh = find_deepest(*first, fa, *second, fb, -5e-6, none);
      EXPECT_EQ(kept.gap_m, fresh.gap_m) << i;
      EXPECT_EQ(kept.place, fresh.place) << i;
      if (fresh.place >= 0) ++deep;
    }
  }
  EXPECT_GT(deep, 300);
}

// The deepest point is below the face, not deep inside the rim next to it, whose facets are off its skin by the sag.
TEST(pairs, deepest_sample_next_to_a_rim) {
  constexpr double kDepth = 1e-5;
  const auto coin = make_cylinder(0.012, 0.002, 48).make();
  Dice dice(13);
  for (int i = 0; i < 500; ++i) {
    Frame frame;
    frame.rotation = make_turn({0, 0, 1}, dice.roll());
    const Vec3 way = dice.roll_way();
    frame.position_m = {0.01 * way[0], 0.01 * way[1], 0.002 - kDepth};
    PairMemory memory;
    const Deepest found = find_deepest(*coin, frame, *coin, {}, -5e-6, memory);
    ASSERT_GE(found.place, 0) << i;
    EXPECT_LE(found.gap_m, -kDepth + 1e-12) << i;
    EXPECT_GE(found.gap_m, -kDepth - coin->get_sag_m()) << i;
  }
}

TEST(pairs, deepest_vertex_on_a_slab) {
  const auto slab = make_box({1.0, 1.0, 0.05}, 4).make();
  const Solid pen = make_lathe({{0, -0.07}, {0.0045, -0.055}, {0.0045, 0.065}, {0, 0.07}}, 20, false),
              coin = make_cylinder(0.012, 0.002, 48);
  Dice dice(12);
  for (const Solid& solid : {pen, coin}) {
    const auto body = solid.make();
    PairMemory memory;
    int deep = 0;
    for (int i = 0; i < 2000; ++i) {
      Frame frame;
      frame.rotation = dice.roll_turn();
      double lowest = 1.0;
      for (const Vec3& x : solid.vertices) lowest = std::min(lowest, to_world(frame, x)[2]);
      const double depth = 1e-4 * (dice.roll_way()[0] + 0.5);
      frame.position_m = {0.1, -0.2, 0.025 - lowest - depth};
      if (i % 10 != 0) memory = {};
      const Deepest found = find_deepest(*body, frame, *slab, {}, -5e-6, memory);
      if (depth < 5e-6) continue;
      ++deep;
      ASSERT_GE(found.place, 0) << i;
      EXPECT_LE(found.gap_m, -depth + 1e-12) << i;
      EXPECT_NEAR(make_touch(*body, frame, *slab, {}, found).gap_m, found.gap_m, 1e-12) << i;
    }
    EXPECT_GT(deep, 1000);
  }
}

TEST(pairs, independence_of_mesh_fineness) {
  const auto ball = make_ball(0.02, 8).make();
  const auto l_block = [](int n) {
    Solid s = make_lathe({{0, -0.02}, {0.05, -0.02}, {0.05, 0.02}, {0, 0.02}}, n, false);
    return s.make();
  };
  const auto coarse = l_block(64), fine = l_block(512);
  Frame fa, fb;
  fa.position_m = {0.03, 0.01, 0.04 + 1e-5};
  const auto p = find(*ball, fa, *coarse, fb, 1e-4), q = find(*ball, fa, *fine, fb, 1e-4);
  ASSERT_EQ(p.size(), 1U);
  ASSERT_EQ(q.size(), 1U);
  EXPECT_NEAR(p[0].gap_m, q[0].gap_m, 1e-12);
  fa.position_m = {0.07 + 1e-5, 0.0, 0.005};
  const auto u = find(*ball, fa, *coarse, fb, 1e-4), v = find(*ball, fa, *fine, fb, 1e-4);
  ASSERT_EQ(u.size(), 1U);
  ASSERT_EQ(v.size(), 1U);
  EXPECT_NEAR(u[0].gap_m, v[0].gap_m, 3e-6);
}

TEST(overlap, penetration_depth) {
  const auto box = make_box({0.06, 0.05, 0.04}, 4).make(), plate = make_box({0.2, 0.2, 0.002}).make(), ball = make_ball(0.03, 10).make();
  Frame fa, fb;
  Vec3 where{};
  fa.position_m = {0, 0, 0.0401};
  EXPECT_EQ(calc_overlap(*box, fa, *box, fb, where), 0.0);
  fa.position_m = {0.01, 0.01, 0.037};
  EXPECT_NEAR(calc_overlap(*box, fa, *box, fb, where), 0.003, 1e-9);
  EXPECT_NEAR(where[2], 0.0185, 0.0016);
  EXPECT_NEAR(calc_overlap(*box, fb, *box, fb, where), 0.02, 1e-4);  // the same place: as deep as the middle
  fa.position_m = {};
  fa.rotation = make_turn({1, 0, 0}, std::numbers::pi / 2);
  EXPECT_NEAR(calc_overlap(*plate, fa, *plate, fb, where), 0.001, 2e-4);  // crossed: no corner is in the other
  fa.position_m = {0, 0, 0.049};
  EXPECT_NEAR(calc_overlap(*ball, fa, *box, fb, where), 0.001, 1e-4);
}

}  // namespace
}  // namespace carillon::geometry::tests
