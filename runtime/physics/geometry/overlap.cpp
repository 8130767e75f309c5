// Method: vertices of each body in the other; midpoints of edge pieces inside the other body (two crossing plates); points halfway from a
// face to the opposite wall (two bodies with coinciding faces). Only faces near the other body are tested.
// Source: T. Moeller, B. Trumbore, "Fast, minimum storage ray-triangle intersection" (1997).
#include "runtime/physics/geometry/facing.hpp"

namespace carillon::geometry {
namespace {

constexpr double kFeatureToleranceRatio = 1e-3;  // fraction of the size: maximum distance of a touch from its edge or facet
constexpr double kVerifiedDepthM = 2e-4;         // m; the depth of deeper touches is verified
constexpr double kMinDepthRatio = 0.25;          // fraction of a touch's depth: minimum depth of its deeper point in the other body
constexpr int kMaxProbes = 200;                  // faces per body with an inward probe

/// Depth of x inside the mesh; 0 outside.
double calc_depth(const Mesh& mesh, const Vec3& x) {
  if (mesh.box.calc_distance2(x) > 0.0) return 0.0;
  const Nearest at = mesh.find_nearest(x, Box::kFar, -1);
  return mesh.is_inside(x, at) ? std::sqrt(at.distance2) : 0.0;
}

/// Depth of x below the curved skin.
double calc_skin_depth(const Shape& shape, const Vec3& x) {
  const Mesh& mesh = shape.mesh();
  const double sag = shape.get_sag_m();
  if (mesh.box.calc_distance2(x) > sag * sag) return 0.0;
  const Nearest at = mesh.find_nearest(x, Box::kFar, -1);
  const bool is_inside = mesh.is_inside(x, at);
  return !is_inside && at.distance2 > sag * sag ? 0.0 : -calc_skin_gap(shape, x, at, is_inside);
}

/// First intersection of a ray with the surface; false if none within `length`.
bool find_crossing(const Mesh& mesh, const Vec3& origin, const Vec3& way, double length, double& distance, bool& leaves) {
  constexpr double kBarycentricTolerance = 1e-12;  // fraction of a triangle: tolerance, so that a ray through an edge hits a face
  double min = length;
  bool found = false;
  mesh.for_ray(origin, way, length, [&](int f) {
    const Vec3& a = mesh.corner(f, 0);
    const Vec3 ab = mesh.corner(f, 1) - a, ac = mesh.corner(f, 2) - a, h = cross(way, ac);
    const double det = dot(ab, h);
    if (std::abs(det) <= 1e-15 * norm(ab) * norm(ac)) return;
    const Vec3 s = origin - a;
    const double u = dot(s, h) / det;
    if (u < -kBarycentricTolerance || u > 1.0 + kBarycentricTolerance) return;
    const Vec3 q = cross(s, ab);
    const double v = dot(way, q) / det, t = dot(ac, q) / det;
    if (v < -kBarycentricTolerance || u + v > 1.0 + kBarycentricTolerance || t < 0.0 || t > min) return;
    min = t;
    leaves = dot(mesh.normals[f], way) > 0.0;
    found = true;
  });
  distance = min;
  return found;
}

}  // namespace

bool is_overlap(const Touch& touch, const Shape& a, const Frame& fa, const Shape& b, const Frame& fb) {
  const auto is_off = [](Side side, const Shape& shape, const Vec3& station) {
    const double brim = kFeatureToleranceRatio * shape.get_size_m();
    return (side == Side::line || side == Side::plane) && shape.mesh().find_nearest(station, Box::kFar, -1).distance2 > brim * brim;
  };
  if (is_off(touch.side_a, a, touch.station_a) || is_off(touch.side_b, b, touch.station_b)) return false;
  if (touch.gap_m > -kVerifiedDepthM) return true;
  const double depth = std::max(calc_skin_depth(b, to_body(fb, to_world(fa, touch.station_a))),
                                calc_skin_depth(a, to_body(fa, to_world(fb, touch.station_b))));
  return depth > -kMinDepthRatio * touch.gap_m;
}

double calc_overlap(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, Vec3& where) {
  const double far = a.get_radius_m() + b.get_radius_m();
  if (norm2(to_world(fa, a.get_middle_m()) - to_world(fb, b.get_middle_m())) > far * far) return 0.0;
  double deepest = 0.0;
  const auto search = [&](const Shape& mine, const Frame& fm, const Shape& theirs, const Frame& ft) {
    const Mesh &m = mine.mesh(), &t = theirs.mesh();
    std::vector<Vec3> places;
    places.reserve(m.vertices.size());
    for (const Vec3& x : m.vertices) places.push_back(to_body(ft, to_world(fm, x)));
    const auto take = [&](const Vec3& x, double depth) {
      if (depth <= deepest) return;
      deepest = depth;
      where = to_world(ft, x);
    };
    for (const Vec3& x : places) take(x, calc_depth(t, x));
    std::vector<int> near;
    for (int f = 0; f < m.count_faces(); ++f) {
      Box box;
      for (int k = 0; k < 3; ++k) box.add(places[m.vertex_of(3 * f + k)]);
      if (box.overlaps(t.box)) near.push_back(f);
    }
    for (const int f : near) {
      for (int e = 3 * f; e < 3 * f + 3; ++e) {
        if (m.opposite[e] < e) continue;
        const Vec3 &p = places[m.vertex_of(e)], d = places[m.vertex_of(Mesh::next(e))] - p;
        const double length = norm(d);
        const Vec3 way = (1.0 / length) * d;
        double enter = 0.0, leave = 0.0;
        bool leaves = false;
        if (!find_crossing(t, p, way, length, enter, leaves)) continue;
        if (leaves) {  // the ray starts inside
          leave = enter;
          enter = 0.0;
        } else {
          const double past = enter + 1e-9 * length;
          leave = find_crossing(t, p + past * way, way, length - past, leave, leaves) ? leave + past : length;
        }
        const Vec3 x = p + (0.5 * (enter + leave)) * way;
        take(x, calc_depth(t, x));
      }
    }
    const std::size_t stride = 1 + near.size() / kMaxProbes;
    for (std::size_t i = 0; i < near.size(); i += stride) {
      const Vec3 inwards = -1.0 * m.normals[near[i]];
      const Vec3 start = m.place(near[i], {1.0 / 3, 1.0 / 3, 1.0 / 3}) + (1e-6 * mine.get_size_m()) * inwards;
      double across = 0.0;
      bool leaves = false;
      if (!find_crossing(m, start, inwards, mine.get_size_m(), across, leaves)) continue;
      const Vec3 x = to_body(ft, to_world(fm, start + (0.5 * across) * inwards));
      take(x, std::min(calc_depth(t, x), 0.5 * across));
    }
  };
  search(a, fa, b, fb);
  search(b, fb, a, fa);
  return deepest;
}

}  // namespace carillon::geometry
