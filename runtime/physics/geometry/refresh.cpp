// Method: point on plane by distance; lowest point of a skin over a plane by walking its patches; two curved sides by minimising their gap
// over the common tangent plane, Newton's method with slopes from the patches and curvatures from the smooth bodies. The normal is that of
// the patches, consistent with the height.
#include "runtime/physics/geometry/mesh.hpp"
#include "runtime/physics/geometry/search.hpp"
#include "runtime/physics/geometry/skin.hpp"

namespace carillon::geometry {
namespace {

constexpr int kMaxGrowingSteps = 2;  // permitted steps between two curved sides that are longer than the preceding ones

/// One side of a touch, in the world frame.
struct Half {
  const Shape* shape = nullptr;
  const Frame* frame = nullptr;
  Side side = Side::point;
  Vec3 station{}, axis{};
  int face = -1;
  double curvature = 0.0;

  Vec3 point{}, outward{}, along{};  // world; outward normal of a skin, direction of a line
  Vec3 flat{};                       // skin: mesh point below the point
  Tensor tensor{};                   // skin; body frame

  void place(const Spot& spot) {
    face = spot.face;
    station = spot.point;
    point = to_world(*frame, station);
    flat = to_world(*frame, shape->mesh().place(face, spot.weights));
    outward = frame->rotation * shape->skin().calc_normal(face, spot.weights);
    tensor = shape->skin().calc_tensor(face, spot.weights);
    curvature = calc_mean(tensor);
  }
  void begin() {
    point = to_world(*frame, station);
    if (side == Side::line) along = frame->rotation * axis;
    if (side == Side::skin) place(shape->skin().locate(station, face));
  }
  double bend(const Vec3& s, const Vec3& t) const {  // directions in the world frame
    return side == Side::skin ? calc_along(tensor, turn_back(frame->rotation, s), turn_back(frame->rotation, t)) : 0.0;
  }
};

/// Common tangent plane of two sides; n: unit, from b to a.
struct TangentPlane {
  Vec3 n{};
  std::array<Vec3, 2> axes{};
};

using Planar = std::array<double, 2>;

/// A side over the tangent plane to second order.
struct LocalSurface {
  Planar foot{};                 // relative to the point of b
  Planar slope{};                // 0: no skin
  std::array<Planar, 2> bend{};  // curvatures, convex positive
};

/// `sign`: 1 for a, -1 for b.
LocalSurface make_surface(const Half& half, const TangentPlane& plane, double sign) {
  LocalSurface out;
  const double facing = std::max(0.1, -sign * dot(half.outward, plane.n));
  for (int i = 0; i < 2; ++i) {
    out.slope[i] = half.side == Side::skin ? sign * dot(plane.axes[i], half.outward) / facing : 0.0;
    for (int j = 0; j < 2; ++j) out.bend[i][j] = half.bend(plane.axes[i], plane.axes[j]);
  }
  return out;
}

/// Target on a point or line: the point, or the minimum of the gap to the skin along the line. `sign`: -1 for a skin b, which curves away
/// from n, 1 for a skin a.
Planar find_target_on_line(const Half& half, const Planar& foot, const Half& skin, const LocalSurface& surface, double sign,
                           const TangentPlane& plane, double reach) {
  Planar x = foot;
  if (half.side == Side::point) return x;
  const double e[2] = {dot(plane.axes[0], half.along), dot(plane.axes[1], half.along)};
  double first = -dot(plane.n, half.along), second = 0.0;
  for (int i = 0; i < 2; ++i) {
    first += e[i] * surface.slope[i];
    for (int j = 0; j < 2; ++j) {
      first += sign * e[i] * surface.bend[i][j] * (x[j] - surface.foot[j]);
      second += sign * e[i] * surface.bend[i][j] * e[j];
    }
  }
  first *= sign, second *= sign;
  const double floor = 0.05 * std::max(std::abs(skin.curvature), 1.0 / reach);
  const double go = std::clamp(-first / std::max(second, floor), -reach, reach);
  x[0] += go * e[0];
  x[1] += go * e[1];
  return x;
}

/// Minimum of the gap of two skins by a Newton step from midway between their feet.
Planar find_target_of_skins(const LocalSurface& a, const LocalSurface& b, double reach) {
  double k[2][2], g[2];
  const double x0[2] = {0.5 * a.foot[0], 0.5 * a.foot[1]};
  for (int i = 0; i < 2; ++i) {
    g[i] = a.slope[i] - b.slope[i];
    for (int j = 0; j < 2; ++j) {
      k[i][j] = a.bend[i][j] + b.bend[i][j];
      g[i] += a.bend[i][j] * (x0[j] - a.foot[j]) + b.bend[i][j] * (x0[j] - b.foot[j]);
    }
  }
  const double mean = 0.5 * (k[0][0] + k[1][1]), half = std::hypot(0.5 * (k[0][0] - k[1][1]), k[0][1]);
  const double floor = 0.02 * (std::abs(mean) + half) + 0.01 / reach;
  const double lift = std::max(0.0, floor - (mean - half));
  k[0][0] += lift, k[1][1] += lift;
  const double det = k[0][0] * k[1][1] - k[0][1] * k[1][0];
  double d[2] = {(-g[0] * k[1][1] + g[1] * k[0][1]) / det, (-g[1] * k[0][0] + g[0] * k[1][0]) / det};
  const double far = std::hypot(d[0], d[1]);
  if (far > reach) d[0] *= reach / far, d[1] *= reach / far;
  return {x0[0] + d[0], x0[1] + d[1]};
}

/// Moves a side towards the target. Returns the distance moved.
double move_towards(Half& half, const Vec3& target, const LocalSurface& surface, double sign, const TangentPlane& plane) {
  const Vec3& n = plane.n;
  Vec3 way = target - half.point;
  way = way - dot(way, n) * n;
  const double d[2] = {dot(way, plane.axes[0]), dot(way, plane.axes[1])};
  double rise = 0.0;
  if (half.side == Side::skin) {
    for (int i = 0; i < 2; ++i) {
      rise += surface.slope[i] * d[i];
      for (int j = 0; j < 2; ++j) rise += 0.5 * sign * surface.bend[i][j] * d[i] * d[j];
    }
    const Vec3 before = half.point;
    half.place(half.shape->skin().locate(to_body(*half.frame, half.flat + way + rise * n), half.face));
    return norm(half.point - before);
  }
  if (half.side != Side::line) return 0.0;
  const Vec3 flat = half.along - dot(half.along, n) * n;
  const double go = norm2(flat) > 0.01 ? dot(way, flat) / norm2(flat) : 0.0;
  half.point = half.point + go * half.along;
  return std::abs(go);
}

/// One step towards the minimum gap of a and b along n (from b to a). Returns the step length.
double step(Half& a, Half& b, Vec3& n, double reach) {
  const Vec3 s = find_across(n);
  const TangentPlane plane{n, {s, cross(n, s)}};
  LocalSurface surface_a = make_surface(a, plane, 1.0);
  const LocalSurface surface_b = make_surface(b, plane, -1.0);
  surface_a.foot = {dot(plane.axes[0], a.point - b.point), dot(plane.axes[1], a.point - b.point)};
  Planar x;
  if (b.side != Side::skin) {
    x = find_target_on_line(b, surface_b.foot, a, surface_a, 1.0, plane, reach);
  } else if (a.side != Side::skin) {
    x = find_target_on_line(a, surface_a.foot, b, surface_b, -1.0, plane, reach);
  } else {
    x = find_target_of_skins(surface_a, surface_b, reach);
  }
  const Vec3 target = b.point + x[0] * plane.axes[0] + x[1] * plane.axes[1];
  const double moved_a = move_towards(a, target, surface_a, 1.0, plane), moved_b = move_towards(b, target, surface_b, -1.0, plane);
  if (a.side == Side::skin && b.side == Side::skin) {
    n = normalise(b.outward - a.outward);
  } else {
    n = a.side == Side::skin ? -1.0 * a.outward : b.outward;
  }
  return std::max({0.0, moved_a, moved_b});
}

bool settle_curved(Touch& touch, Half& a, Half& b, double reach, int max) {
  a.begin();
  b.begin();
  Vec3 n = touch.normal;
  const Vec3 start_a = a.point, start_b = b.point;
  const double close = 1e-5 * reach;
  bool settled = false;
  // On bumpy surfaces the steps do not shrink.
  double before = Box::kFar;
  for (int i = 0, grown = 0; i < max && !settled && grown < kMaxGrowingSteps; ++i) {
    const double moved = step(a, b, n, reach);
    settled = moved < close;
    grown += moved > before ? 1 : 0;
    before = moved;
  }
  touch.normal = n;
  touch.gap_m = dot(n, a.point - b.point);
  touch.where_m = 0.5 * (a.point + b.point);
  const Vec3 s = find_across(n), t = cross(n, s);
  const double ss = a.bend(s, s) + b.bend(s, s), st = a.bend(s, t) + b.bend(s, t), tt = a.bend(t, t) + b.bend(t, t);
  touch.steepest_per_m = 0.5 * (ss + tt) + std::hypot(0.5 * (ss - tt), st);
  const Vec3 across = (a.point - b.point) - touch.gap_m * n;
  // The nearest mesh point deviates from that of the smooth body by the tilt of its facets.
  const bool left = std::min(norm(a.point - start_a), norm(b.point - start_b)) > 4.0 * reach;
  return !left && norm(across) < 5e-2 * reach;  // alternates where patches meet with a kink
}

}  // namespace

bool settle(Touch& t, const Shape& a, const Frame& fa, const Shape* b, const Frame& fb, double reach, int iterations) {
  static const Frame kWorld;
  const Frame& frame_b = b != nullptr ? fb : kWorld;
  bool settled = true;
  if (t.side_b == Side::plane || t.side_a == Side::plane) {
    const bool on_b = t.side_b == Side::plane;
    const Frame &plane = on_b ? frame_b : fa, &other = on_b ? fa : frame_b;
    const Shape* shape = on_b ? &a : b;
    Vec3 &origin = on_b ? t.station_b : t.station_a, &station = on_b ? t.station_a : t.station_b;
    const Vec3 n = plane.rotation * (on_b ? t.axis_b : t.axis_a);  // outward of the plane
    if ((on_b ? t.side_a : t.side_b) == Side::skin) {
      int& face = on_b ? t.face_a : t.face_b;
      const Vec3 up = turn_back(other.rotation, n);
      Spot spot = shape->skin().walk_lowest(up, face, station, reach, t.stays);
      settled = spot.settled;
      if (t.stays && settled) spot = shape->skin().walk_lowest(up, spot.face, spot.point, reach, true);  // less lag across a rod
      station = spot.point;
      face = spot.face;
      const Tensor bend = shape->skin().calc_tensor(face, spot.weights);
      (on_b ? t.curvature_a_per_m : t.curvature_b_per_m) = calc_mean(bend);
      t.steepest_per_m = calc_steepest(bend);
    }
    const Vec3 x = to_world(other, station);
    t.gap_m = dot(n, x - to_world(plane, origin));
    origin = to_body(plane, x - t.gap_m * n);
    t.where_m = x - (0.5 * t.gap_m) * n;
    t.normal = on_b ? n : -1.0 * n;
    return settled;
  }
  if (t.side_a != Side::skin && t.side_b != Side::skin) {
    Vec3 p = to_world(fa, t.station_a), q = to_world(frame_b, t.station_b);
    if (t.side_a == Side::line && t.side_b == Side::line) {
      const Vec3 d = fa.rotation * t.axis_a, e = frame_b.rotation * t.axis_b, r = p - q;
      const double mixed = dot(d, e), det = 1.0 - mixed * mixed;
      if (det > 1e-6) {
        const double s = (mixed * dot(e, r) - dot(d, r)) / det, u = (dot(e, r) - mixed * dot(d, r)) / det;
        p = p + s * d;
        q = q + u * e;
        t.station_a = t.station_a + s * t.axis_a;
        t.station_b = t.station_b + u * t.axis_b;
        Vec3 n = normalise(cross(d, e));
        if (dot(n, t.normal) < 0.0) n = -1.0 * n;
        t.normal = n;
      }
    } else if (const Vec3 d = p - q; dot(d, t.normal) > 0.0) {
      t.normal = normalise(d);  // two adjacent corners: distance in any direction
    }
    t.gap_m = dot(t.normal, p - q);
    t.where_m = 0.5 * (p + q);
    return true;
  }
  Half ha, hb;
  ha.shape = &a, ha.frame = &fa, ha.side = t.side_a, ha.station = t.station_a, ha.axis = t.axis_a, ha.face = t.face_a;
  hb.shape = b, hb.frame = &frame_b, hb.side = t.side_b, hb.station = t.station_b, hb.axis = t.axis_b, hb.face = t.face_b;
  settled = settle_curved(t, ha, hb, reach, iterations);
  t.station_a = to_body(fa, ha.point);
  t.station_b = to_body(frame_b, hb.point);
  t.face_a = ha.face;
  t.face_b = hb.face;
  if (t.side_a == Side::skin) t.curvature_a_per_m = ha.curvature;
  if (t.side_b == Side::skin) t.curvature_b_per_m = hb.curvature;
  return settled;
}

bool is_level(const Touch& t, const Shape& a, const Frame& fa, const Shape* b, const Frame& fb) {
  constexpr double kTilt = 2e-3, kTiltOnGround = 2e-4, kFar = 0.05;  // the smaller one lets a coin wobble down to 0.2 degrees
  const double most = b == nullptr ? kTiltOnGround : kTilt;
  const bool on_b = t.side_b == Side::plane;
  const Shape& shape = on_b || b == nullptr ? a : *b;
  const Vec3 n = on_b ? (b != nullptr ? fb.rotation * t.axis_b : t.axis_b) : fa.rotation * t.axis_a;
  const Vec3 up = turn_back((on_b ? fa : fb).rotation, n), s = find_across(up), along[2] = {s, cross(up, s)};
  for (const Vec3& way : along)
    for (const double tilt : {-most, most})
      if (!shape.skin()
               .walk_lowest(normalise(up + tilt * way), on_b ? t.face_a : t.face_b, on_b ? t.station_a : t.station_b,
                            kFar * shape.get_size_m(), false)
               .settled)
        return true;
  return false;
}

bool follow(Touch& touch, const Shape& a, const Frame& fa, const Shape* b, const Frame& fb, double reach) {
  constexpr double kGapShrinkRatio = 0.02;  // fraction of a point's movement on its surface: additional shrinkage of a gap,
  constexpr double kGapSlackM = 2e-5;       // m; plus this
  const Touch before = touch;
  const bool settled = settle(touch, a, fa, b, fb, reach);
  const Vec3 p = to_world(fa, before.station_a), q = b == nullptr ? Vec3{p[0], p[1], before.station_b[2]} : to_world(fb, before.station_b);
  if (b == nullptr) {  // the lowest point of a level body may move from one end to the other
    if (norm(touch.station_a - before.station_a) <= reach) return true;
  } else {
    // A gap shrinks at most by the approach of its points; other touches have left their features.
    const double moved = norm((p - q) - before.gap_m * before.normal);
    const double way = std::max(norm(touch.station_a - before.station_a), norm(touch.station_b - before.station_b));
    const bool is_on_plane = touch.side_a == Side::plane || touch.side_b == Side::plane;
    if ((settled || is_on_plane) && touch.gap_m >= before.gap_m - moved - kGapShrinkRatio * way - kGapSlackM) return true;
  }
  touch = before;
  touch.gap_m = dot(touch.normal, p - q);
  touch.where_m = 0.5 * (p + q);
  return false;
}

bool refresh(Touch& touch, const Shape& a, const Frame& fa, const Shape* b, const Frame& fb) {
  const double size = b != nullptr ? std::min(a.get_size_m(), b->get_size_m()) : a.get_size_m();
  return follow(touch, a, fa, b, fb, 0.1 * size);
}

}  // namespace carillon::geometry
