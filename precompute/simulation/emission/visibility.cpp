// Method: boxes are split at the median of the centres along their longest side; slab test for boxes, Moeller-Trumbore for triangles.
// Source: OCE01 eq. 10 (delta); Moeller and Trumbore 1997; Kay and Kajiya 1986.
#include "precompute/simulation/emission/visibility.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace carillon::emission {
namespace {

constexpr std::size_t kLeaf = 4;

struct Cut {
  double enter = 0.0, leave = 1.0;  // ray parameters
};
Cut cut_box(const Vec3& low, const Vec3& high, const Vec3& from, const Vec3& inverse) {
  auto [enter, leave] = Cut{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double a = (low[axis] - from[axis]) * inverse[axis], b = (high[axis] - from[axis]) * inverse[axis];
    if (a > b) std::swap(a, b);
    if (a > enter) enter = a;  // false for NaN: a ray in a side's plane counts as inside
    if (b < leave) leave = b;
  }
  return {enter, leave};
}

bool meets_box(const Vec3& low, const Vec3& high, const Vec3& from, const Vec3& inverse) {
  const auto [enter, leave] = cut_box(low, high, from, inverse);
  return enter <= leave * (1.0 + 1e-12);
}

bool meets_triangle(const Corners& corner, const Vec3& from, const Vec3& way) {
  const Vec3 e1 = corner[1] - corner[0], e2 = corner[2] - corner[0], p = cross(way, e2);
  const double det = dot(e1, p);
  if (std::abs(det) < 1e-300) return false;
  const Vec3 s = from - corner[0];
  const double u = dot(s, p) / det;
  if (!(u >= 0.0 && u <= 1.0)) return false;
  const Vec3 q = cross(s, e1);
  const double v = dot(way, q) / det;
  if (!(v >= 0.0 && u + v <= 1.0)) return false;
  const double t = dot(e2, q) / det;
  return t > 1e-9 && t < 1.0 - 1e-9;
}

}  // namespace

bool is_between(const job::RigidObstacle& obstacle, const Vec3& from, const Vec3& to) {
  const Vec3 way = to - from;
  if (const auto* plane = std::get_if<job::PlaneObstacle>(&obstacle))
    return dot(plane->normal, from - plane->point_m) < 0.0 || dot(plane->normal, to - plane->point_m) < 0.0;
  if (const auto* ball = std::get_if<job::BallObstacle>(&obstacle)) {
    const Vec3 reach = ball->centre_m - from;
    const double nearest = std::clamp(dot(reach, way) / std::max(dot(way, way), 1e-300), 0.0, 1.0);
    return norm(reach - nearest * way) < ball->radius_m;
  }
  const auto& box = std::get<job::BoxObstacle>(obstacle);
  for (std::size_t axis = 0; axis < 3; ++axis)  // a ray parallel to a side does not cross it; its quotient is NaN
    if (way[axis] == 0.0 && !(box.min_m[axis] < from[axis] && from[axis] < box.max_m[axis])) return false;
  const auto [enter, leave] = cut_box(box.min_m, box.max_m, from, {1.0 / way[0], 1.0 / way[1], 1.0 / way[2]});
  return enter < leave;
}

Visibility::Visibility(std::span<const Corners> triangles) : triangles_(triangles.begin(), triangles.end()), order_(triangles.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (!triangles_.empty()) split(0, triangles_.size());
}

void Visibility::split(std::size_t begin, std::size_t end) {
  const std::size_t place = boxes_.size();
  Box box{triangles_[order_[begin]][0], triangles_[order_[begin]][0]};
  for (std::size_t i = begin; i < end; ++i)
    for (const Vec3& corner : triangles_[order_[i]])
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box.low[axis] = std::min(box.low[axis], corner[axis]);
        box.high[axis] = std::max(box.high[axis], corner[axis]);
      }
  boxes_.push_back(box);
  if (end - begin <= kLeaf) {
    boxes_[place].first = static_cast<std::int32_t>(begin);
    boxes_[place].count = static_cast<std::int32_t>(end - begin);
    return;
  }
  const Vec3 size = box.high - box.low;
  const std::size_t axis = std::max_element(size.begin(), size.end()) - size.begin();
  const auto get_centre = [&](std::int32_t i) {
    const Corners& corner = triangles_[i];
    return corner[0][axis] + corner[1][axis] + corner[2][axis];
  };
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [&](std::int32_t a, std::int32_t b) {
    const double x = get_centre(a), y = get_centre(b);
    return x < y || (x == y && a < b);
  });
  split(begin, middle);
  boxes_[place].second = static_cast<std::int32_t>(boxes_.size());
  split(middle, end);
}

bool Visibility::is_free(const Vec3& from, const Vec3& to, std::int64_t own) const {
  if (boxes_.empty()) return true;
  const Vec3 way = to - from, inverse{1.0 / way[0], 1.0 / way[1], 1.0 / way[2]};
  std::array<std::int32_t, 64> waiting;  // nodes: depth is at most the bits of a number
  std::size_t count = 1;
  waiting[0] = 0;
  while (count > 0) {
    const std::int32_t place = waiting[--count];
    const Box& box = boxes_[place];
    if (!meets_box(box.low, box.high, from, inverse)) continue;
    if (box.count == 0) {
      waiting[count++] = box.second;
      waiting[count++] = place + 1;
      continue;
    }
    for (std::int32_t i = box.first; i < box.first + box.count; ++i) {
      const std::int32_t triangle = order_[i];
      if (triangle != own && meets_triangle(triangles_[triangle], from, way)) return false;
    }
  }
  return true;
}

}  // namespace carillon::emission
