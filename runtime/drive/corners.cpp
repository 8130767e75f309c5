#include "runtime/drive/corners.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "runtime/base/quaternion.hpp"
#include "runtime/physics/geometry/shape.hpp"
#include "runtime/physics/impact/face.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::drive {
namespace {

constexpr double kOnSurfaceRatio = 1e-3;  // of the size: distance from the other surface

/// Pose of a body at a hit; of the ground the world's.
geometry::Frame calc_frame(const StepView& step, const FinishedHit& hit, std::size_t side) {
  const int body = side == 0 ? hit.a : hit.b;
  if (body < 0) return {};
  const Motion& before = hit.before[side];
  const double moved_s = hit.touch_s - hit.opened_s;
  const Mat3 rotation = make_rotation(make_turn(moved_s * before.spin_rad_s)) * before.rotation;
  return {rotation, before.centre_m + moved_s * before.velocity_m_s - rotation * step.scene.bodies[body].centre_m};
}

/// True if a body has a surface at this point, or is a plane.
bool is_on_surface(const StepView& step, int body, const Vec3& station, const Vec3& outward, double size_m) {
  const TouchBody* b = body < 0 ? nullptr : &step.bodies[body];
  if (b == nullptr || (b->shape == nullptr && b->given.fixed)) return true;
  if (b->shape == nullptr) return false;
  const geometry::Place place = b->shape->find_place(station, outward);
  return norm(bank::calc_point(*b->given.bank, place.triangle, place.barycentric) - station) < kOnSurfaceRatio * size_m;
}

/// True if another corner lies under this one, as on the lower side of a sheet.
bool is_covered(std::span<const Vec3> corners, const Vec3& corner, const Vec3& up) {
  return std::any_of(corners.begin(), corners.end(), [&](const Vec3& other) {
    const Vec3 way = corner - other;
    const double rise = dot(up, way);
    return rise > norm(way - rise * up);
  });
}

}  // namespace

double calc_approach_before(const StepView& step, const FinishedHit& hit, const std::array<Vec3, 2>& stations) {
  std::array<Vec3, 2> velocities{};
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? hit.a : hit.b;
    if (body < 0) continue;
    velocities[side] = step.calc_velocity(body, hit.before[side], hit.before[side], stations[side]);
  }
  return dot(hit.normal, velocities[1] - velocities[0]);
}

std::vector<Corner> find_corners(const StepView& step, const FinishedHit& hit, double within_s) {
  const double size_m = step.scene.calc_size(hit.a, hit.b);
  const std::array<geometry::Frame, 2> frames{calc_frame(step, hit, 0), calc_frame(step, hit, 1)};
  std::vector<Corner> corners;
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? hit.a : hit.b, other = side == 0 ? hit.b : hit.a;
    if (body < 0 || !step.bodies[body].edges) continue;
    const Vec3 up = side == 0 ? hit.normal : -1.0 * hit.normal;  // from the surface of the other body
    const std::span<const Vec3> all = step.bodies[body].edges->get_corners();
    const Vec3 own = to_world(frames[side], hit.stations_m[side]);
    const Vec3 level = other < 0 ? own : to_world(frames[1 - side], hit.stations_m[1 - side]);
    for (const Vec3& station : all) {
      const Vec3 where = to_world(frames[side], station);
      Corner corner{.gap_m = dot(up, where - own)};  // not from the other surface: engines find bodies only when they overlap
      if (!(std::abs(corner.gap_m) <= impact::kFlatnessRatio * size_m)) continue;
      corner.stations_m[side] = station;
      corner.stations_m[1 - side] = to_body(frames[1 - side], where - dot(up, where - level) * up);
      corner.approach_m_s = calc_approach_before(step, hit, corner.stations_m);
      if (corner.approach_m_s > rigid::kMinImpactSpeedMS && !is_covered(all, station, turn_back(frames[side].rotation, up)) &&
          is_on_surface(step, other, corner.stations_m[1 - side], turn_back(frames[1 - side].rotation, up), size_m))
        corners.push_back(corner);
    }
  }
  const auto first = std::min_element(corners.begin(), corners.end(), [](const Corner& x, const Corner& y) { return x.gap_m < y.gap_m; });
  if (first == corners.end()) return corners;
  const double lowest_m = first->gap_m;
  for (Corner& corner : corners) corner.gap_m -= lowest_m;
  std::erase_if(corners, [&](const Corner& corner) { return !(corner.gap_m <= within_s * corner.approach_m_s); });
  return corners;
}

}  // namespace carillon::drive
