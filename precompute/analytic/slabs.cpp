#include "precompute/analytic/slabs.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

namespace carillon::analytic {

Net make_rectangle_net(double length_m, double width_m, int columns, int rows) {
  Net net;
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i <= columns; ++i) net.points_m.push_back({length_m * i / columns, width_m * j / rows});
  const auto at = [&](int i, int j) { return static_cast<std::int32_t>(j * (columns + 1) + i); };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      // Alternating diagonals avoid a preferred direction.
      if ((i + j) % 2 == 0) {
        net.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        net.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      } else {
        net.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        net.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  return net;
}

Net make_disc_net(double radius_m, int rings) {
  Net net;
  net.points_m.push_back({0.0, 0.0});
  for (int k = 1; k <= rings; ++k)
    for (int i = 0; i < 6 * k; ++i) {
      const double r = radius_m * k / rings, angle = std::numbers::pi * i / (3.0 * k);
      net.points_m.push_back({r * std::cos(angle), r * std::sin(angle)});
    }
  const auto at = [](int ring, int i) { return ring == 0 ? 0 : static_cast<std::int32_t>(1 + 3 * ring * (ring - 1) + i % (6 * ring)); };
  for (int k = 1; k <= rings; ++k)
    for (int sector = 0; sector < 6; ++sector)
      for (int i = 0; i < k; ++i) {
        const int outer = sector * k + i, inner = sector * (k - 1) + i;
        net.triangles.push_back({at(k, outer), at(k, outer + 1), at(k - 1, inner)});
        if (i + 1 < k) net.triangles.push_back({at(k, outer + 1), at(k - 1, inner + 1), at(k - 1, inner)});
      }
  return net;
}

ClosedSurface make_slab(const Net& net, double thickness_m) {
  ClosedSurface surface;
  const auto count = static_cast<std::int32_t>(net.points_m.size());
  for (const double z : {0.5 * thickness_m, -0.5 * thickness_m})
    for (const Point2& p : net.points_m) surface.vertices_m.push_back({p[0], p[1], z});
  std::map<std::pair<std::int32_t, std::int32_t>, bool> edges;  // directed
  for (const Triangle& t : net.triangles) {
    surface.triangles.push_back(t);
    surface.triangles.push_back({t[2] + count, t[1] + count, t[0] + count});
    for (int k = 0; k < 3; ++k) edges[{t[k], t[(k + 1) % 3]}] = true;
  }
  for (const auto& [edge, is_there] : edges) {
    const auto [a, b] = edge;
    if (edges.count({b, a}) > 0) continue;
    surface.triangles.push_back({b, a, a + count});
    surface.triangles.push_back({b, a + count, b + count});
  }
  return surface;
}

ClosedSurface make_prism(double length_m, const std::vector<Point2>& section, int intervals) {
  ClosedSurface surface;
  const auto sides = static_cast<int>(section.size());
  for (int i = 0; i <= intervals; ++i)
    for (const Point2& p : section) surface.vertices_m.push_back({length_m * i / intervals, p[0], p[1]});
  const auto at = [&](int i, int k) { return static_cast<std::int32_t>(i * sides + k % sides); };
  for (int i = 0; i < intervals; ++i)
    for (int k = 0; k < sides; ++k) {
      surface.triangles.push_back({at(i, k), at(i, k + 1), at(i + 1, k + 1)});
      surface.triangles.push_back({at(i, k), at(i + 1, k + 1), at(i + 1, k)});
    }
  for (int k = 1; k + 1 < sides; ++k) {
    surface.triangles.push_back({at(0, 0), at(0, k + 1), at(0, k)});
    surface.triangles.push_back({at(intervals, 0), at(intervals, k), at(intervals, k + 1)});
  }
  return surface;
}

bank::RigidBody calc_slab_rigid(const Net& net, double thickness_m, double mass_kg) {
  double area = 0.0, x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
  for (const Triangle& t : net.triangles) {
    const Point2 &a = net.points_m[t[0]], &b = net.points_m[t[1]], &c = net.points_m[t[2]];
    const double part = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    const double sx = a[0] + b[0] + c[0], sy = a[1] + b[1] + c[1];
    area += part;
    x += part * sx / 3.0;
    y += part * sy / 3.0;
    xx += part * (a[0] * a[0] + b[0] * b[0] + c[0] * c[0] + sx * sx) / 12.0;
    yy += part * (a[1] * a[1] + b[1] * b[1] + c[1] * c[1] + sy * sy) / 12.0;
    xy += part * (a[0] * a[1] + b[0] * b[1] + c[0] * c[1] + sx * sy) / 12.0;
  }
  bank::RigidBody rigid;
  rigid.mass_kg = mass_kg;
  rigid.volume_m3 = area * thickness_m;
  rigid.centre_m = {x / area, y / area, 0.0};
  const double density = mass_kg / area, flat = mass_kg * thickness_m * thickness_m / 12.0;
  const double sxx = density * xx - mass_kg * rigid.centre_m[0] * rigid.centre_m[0];
  const double syy = density * yy - mass_kg * rigid.centre_m[1] * rigid.centre_m[1];
  const double sxy = density * xy - mass_kg * rigid.centre_m[0] * rigid.centre_m[1];
  rigid.inertia_kg_m2 = {syy + flat, -sxy, 0.0, -sxy, sxx + flat, 0.0, 0.0, 0.0, sxx + syy};
  return rigid;
}

}  // namespace carillon::analytic
