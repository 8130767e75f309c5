// Source: K. L. Johnson, "Contact mechanics" (1985), eq. 3.36 (flat round punch).
#include "runtime/physics/impact/face.hpp"

#include <algorithm>
#include <cmath>

namespace carillon::impact {
namespace {

constexpr double kFaceCosine = 0.99;  // minimum cosine between normals of one face

/// Area of the convex polygon of given points [m^2].
double calc_area(std::vector<Vec3> corners, const Vec3& normal) {
  Vec3 middle{};
  for (const Vec3& x : corners) middle = middle + (1.0 / static_cast<double>(corners.size())) * x;
  const Vec3 s = find_across(normal), t = cross(normal, s);
  const auto calc_angle = [&](const Vec3& x) { return std::atan2(dot(t, x - middle), dot(s, x - middle)); };
  std::sort(corners.begin(), corners.end(), [&](const Vec3& x, const Vec3& y) { return calc_angle(x) < calc_angle(y); });
  double area = 0.0;
  for (std::size_t k = 0; k < corners.size(); ++k)
    area += 0.5 * dot(normal, cross(corners[k] - middle, corners[(k + 1) % corners.size()] - middle));
  return area;
}

}  // namespace

std::vector<Spring> find_springs(const Impact& impact, std::span<const FaceCorner> corners, double flat_m, double ahead_s) {
  const auto is_between = [&](int contact, int first) {
    const Contact &x = impact.get_contact(contact), &y = impact.get_contact(first);
    return (x.a == y.a && x.b == y.b) || (x.a == y.b && x.b == y.a);
  };
  const int count = static_cast<int>(corners.size());
  std::vector<Spring> springs;
  for (int k = 0; k < count; ++k) springs.push_back(impact.get_compression(k) > 0.0 ? impact.get_contact(k).spring : corners[k].alone);
  std::vector<char> is_taken(count, 0);
  for (int first = 0; first < count; ++first) {
    const FaceCorner& one = corners[first];
    if (is_taken[first] != 0 || !one.is_sharp) continue;
    std::vector<int> face;
    std::vector<Vec3> points;
    for (int k = first; k < count; ++k) {
      const FaceCorner& corner = corners[k];
      const double least_m = springs[k].exponent == 1.0 ? 0.0 : flat_m,
                   pressed_m = impact.get_compression(k) + std::max(impact.calc_approach(k), 0.0) * ahead_s;
      if (is_taken[k] != 0 || !corner.is_sharp || !is_between(k, first) || dot(corner.normal, one.normal) < kFaceCosine ||
          !(pressed_m > least_m) || std::abs(dot(one.normal, corner.where_m - one.where_m)) > kFlatnessRatio * one.size_m)
        continue;
      face.push_back(k);
      points.push_back(corner.where_m);
    }
    if (face.size() < 3 || face.front() != first) continue;
    const double stiffness = calc_face_stiffness(one.compliance_per_pa, calc_area(points, one.normal));
    for (const int k : face) {
      is_taken[k] = 1;
      if (stiffness > 0.0) springs[k] = {.stiffness = stiffness / static_cast<double>(face.size()), .exponent = 1.0};
    }
  }
  return springs;
}

}  // namespace carillon::impact
