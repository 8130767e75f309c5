// Method: ridge pairs by two trees; a pair crosses if the closest points of its lines lie within both and its arcs on the Gauss map
// intersect.
// Source: D. Gregorius, "The separating axis test between convex polyhedra" (GDC 2013).
#include <array>
#include <cmath>

#include "runtime/physics/geometry/facing.hpp"
#include "runtime/physics/geometry/search.hpp"

namespace carillon::geometry {
namespace {

constexpr double kEdgeOverlapRatio = 1e-6;  // fraction of an edge: overlap of consecutive edges
constexpr double kArcToleranceRad = 1e-3;   // rad; includes edges of faces that lie on each other

}  // namespace

void cross_ridges(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double reach, std::vector<Touch>& out) {
  const Samples &sa = a.samples(), &sb = b.samples();
  if (sa.ridges.empty() || sb.ridges.empty()) return;
  const double deepest = 0.3 * std::min(a.get_thickness_m(), b.get_thickness_m());
  const auto to_b = [&](const Vec3& x) { return to_body(fb, to_world(fa, x)); };
  const auto meet = [&](int i, int j) {
    const Ridge &ra = sa.ridges[i], &rb = sb.ridges[j];
    const Vec3 p = to_b(ra.begin), d = to_b(ra.end) - p, q = rb.begin, e = rb.end - rb.begin, r = p - q;
    const double dd = norm2(d), ee = norm2(e), de = dot(d, e), det = dd * ee - de * de;
    if (det < 1e-6 * dd * ee) return;
    const double s = (de * dot(e, r) - ee * dot(d, r)) / det, t = (dd * dot(e, r) - de * dot(d, r)) / det;
    if (s < -kEdgeOverlapRatio || s > 1.0 + kEdgeOverlapRatio || t < -kEdgeOverlapRatio || t > 1.0 + kEdgeOverlapRatio) return;
    Vec3 n = normalise(cross(d, e));
    if (dot(n, rb.into[0] + rb.into[1]) > 0.0) n = -1.0 * n;  // outward of b
    const Vec3 on_a = ra.begin + s * (ra.end - ra.begin), on_b = q + t * e, m = turn_back(fa.rotation, fb.rotation * n);
    for (const int k : {0, 1})
      if (dot(n, find_into(b, rb, k, on_b)) > kArcToleranceRad || dot(m, find_into(a, ra, k, on_a)) < -kArcToleranceRad) return;
    const double gap = dot(n, r + s * d - t * e);
    if (gap > reach || -gap > std::min(deepest, 0.5 * std::sqrt(std::min(dd, ee)))) return;
    Touch touch;
    touch.side_a = touch.side_b = Side::line;
    touch.normal = fb.rotation * n;
    touch.station_a = on_a;
    touch.station_b = on_b;
    touch.axis_a = ra.along;
    touch.axis_b = rb.along;
    touch.id = make_id(Feature::edges, i, j);
    touch.curvature_a_per_m = get_sharp_curvature(a, VertexKind::ridge);
    touch.curvature_b_per_m = get_sharp_curvature(b, VertexKind::ridge);
    const auto bends = [](const Shape& shape, const Ridge& ridge) {
      return shape.skin().kind(ridge.vertices[0]) == VertexKind::ridge || shape.skin().kind(ridge.vertices[1]) == VertexKind::ridge;
    };
    touch.smooth = bends(a, ra) || bends(b, rb);
    settle(touch, a, fa, &b, fb, reach);
    out.push_back(touch);
  };
  std::vector<std::array<int, 2>> open{{0, 0}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    const Ball &ba = sa.ridge_tree[i], &bb = sb.ridge_tree[j];
    const double far = ba.radius_m + bb.radius_m + reach;
    if (norm2(to_b(ba.middle) - bb.middle) > far * far) continue;
    if (ba.child < 0 && bb.child < 0) {
      for (int k = ba.first; k < ba.first + ba.count; ++k)
        for (int l = bb.first; l < bb.first + bb.count; ++l) meet(k, l);
    } else if (bb.child < 0 || (ba.child >= 0 && ba.radius_m >= bb.radius_m)) {
      open.push_back({ba.child + 1, j});
      open.push_back({ba.child, j});
    } else {
      open.push_back({i, bb.child + 1});
      open.push_back({i, bb.child});
    }
  }
}

}  // namespace carillon::geometry
