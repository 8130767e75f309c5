#include "runtime/scene/scene_joints.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/base/vector.hpp"
#include "runtime/scene/scene_values.hpp"

namespace carillon::scene {
namespace {

/// "world", or a body's name.
int find_end(base::Object& object, const Names& bodies, std::string_view key) {
  if (object.string(key) == "world") return -1;
  return static_cast<int>(find_body(object, bodies, key));
}

physics::JointSpec read_joint(base::Object& object, const Names& names) {
  physics::JointSpec joint;
  joint.place = object.find_place("");
  const std::string kind = object.choice("kind", kJointNames);
  joint.kind = static_cast<joints::Kind>(std::find(kJointNames.begin(), kJointNames.end(), kind) - kJointNames.begin());
  joint.body = static_cast<int>(find_body(object, names));
  joint.to = find_end(object, names, "to");
  joint.at_m = read_required_vector(object, "at_m");
  const bool has_axis = joint.kind == joints::Kind::kHinge || joint.kind == joints::Kind::kSlider || joint.kind == joints::Kind::kUniversal;
  if (has_axis) joint.axis = read_direction(object, "axis");
  if (!has_axis && object.has("axis")) object.fail("axis", fmt::format("a {} has none; take it away", kind));
  if (joint.kind == joints::Kind::kUniversal) {
    joint.second_axis = read_direction(object, "second_axis");
    const double cosine = dot(joint.axis, joint.second_axis);
    if (!(std::abs(cosine) < 1e-3)) object.fail("second_axis", "must be at right angles to \"axis\"");
    joint.second_axis = normalise(joint.second_axis - cosine * joint.axis);
  } else if (object.has("second_axis")) {
    object.fail("second_axis", "belongs to a universal joint alone; take it away");
  }
  if (joint.kind == joints::Kind::kWeld) {
    if (object.has("damping")) object.fail("damping", "a weld does not move; take it away");
  } else {
    joint.damping = read_within(object, "damping", 0.0, 0.0, 1e6);
  }
  const bool turns = joint.kind == joints::Kind::kHinge, slides = joint.kind == joints::Kind::kSlider;
  for (const auto& [key, is_meant] : {std::pair{"limits_deg", turns}, {"limits_m", slides}}) {
    if (!object.has(key)) continue;
    if (!is_meant) object.fail(key, fmt::format("a {} has none; a hinge has \"limits_deg\", a slider \"limits_m\"", kind));
    std::array<double, 2> limits = object.numbers<2>(key);
    const double max = turns ? physics::kWidestHingeDeg : kFarthestM;
    if (!(limits[0] <= 0.0 && limits[1] >= 0.0 && limits[0] >= -max && limits[1] <= max && limits[1] - limits[0] > 1e-3))
      object.fail(key, fmt::format("must be [lowest, highest] with the start, 0, between them, within {:g}", max));
    for (double& limit : limits) limit *= turns ? std::numbers::pi / 180.0 : 1.0;
    joint.limits = limits;
  }
  if (joint.limits)
    joint.stop_restitution = read_within(object, "stop_restitution", 0.0, 0.0, 1.0);
  else if (object.has("stop_restitution"))
    object.fail("stop_restitution", "belongs to \"limits_deg\" or \"limits_m\"; give them, too");
  object.finish();
  return joint;
}

physics::CordSpec read_cord(base::Object& object, const Names& names) {
  physics::CordSpec cord;
  cord.place = object.find_place("");
  base::Object from = object.object("from"), to = object.object("to");
  cord.body = static_cast<int>(find_body(from, names));
  cord.from_m = read_required_vector(from, "at_m");
  from.finish();
  cord.to = to.has("body") ? find_end(to, names, "body") : -1;
  cord.to_m = read_required_vector(to, "at_m");
  to.finish();
  if (object.has("length_m")) {
    cord.length_m = object.number("length_m", base::kPositive);
    const Vec3 apart{cord.from_m[0] - cord.to_m[0], cord.from_m[1] - cord.to_m[1], cord.from_m[2] - cord.to_m[2]};
    if (!(*cord.length_m >= norm(apart) - 1e-9 && *cord.length_m <= kFarthestM))
      object.fail(
          "length_m",
          fmt::format("{:g} m is less than the {:.6g} m between its ends at the start (or more than {:g} m); give at least that, or "
                      "leave it out",
                      *cord.length_m, norm(apart), kFarthestM));
  }
  cord.restitution = read_within(object, "restitution", 0.0, 0.0, 1.0);
  object.finish();
  return cord;
}

}  // namespace

void parse_joints(base::Object& root, const Names& names, Scene& scene) {
  for (base::Object& object : root.objects("joints")) scene.joints.push_back(read_joint(object, names));
  for (base::Object& object : root.objects("cords")) scene.cords.push_back(read_cord(object, names));
}

}  // namespace carillon::scene
