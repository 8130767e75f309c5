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

const base::Keys<physics::JointSpec> kJoint{
    {"kind", &physics::JointSpec::kind, kJointNames,
     "`hinge` turns about `axis`; `ball` turns every way; `slider` moves along `axis`; `universal` turns about `axis`, fixed in `to`, and "
     "`second_axis`, fixed in `body`; `weld` makes one body of two",
     base::required},
    {"body", "required", "name of a moving body"},
    {"to", "required", "name of another body, or `\"world\"`; a `fixed` body counts as the world"},
    {"at_m", &physics::JointSpec::at_m, base::within(kFarthestM), "position of the joint", base::required},
    {"axis", "required for hinge, slider, universal", "direction, of any length"},
    {"second_axis", "required for universal", "at right angles to `axis`"},
    {"damping", &physics::JointSpec::damping, base::Limits{0, 1e6},
     "moment per angular speed [N m s], of a slider force per speed [N s/m]"},
    {"limits_deg", "none", "of a hinge: `[lowest, highest]` rotation of `body` against `to` from the start, within 175 degrees"},
    {"limits_m", "none", "of a slider: `[lowest, highest]` displacement along `axis` from the start"},
    {"stop_restitution", &physics::JointSpec::stop_restitution, base::Limits{0, 1}, "rebound at a limit"}};
const base::Keys<physics::CordSpec> kCord{
    {"from", "required", "end on a body: `{\"body\": name, \"at_m\": [x, y, z]}`"},
    {"to", "required", "the same, or only `at_m`: a point of the world"},
    {"length_m", &physics::CordSpec::length_m, base::kAboveZero, "at least the initial distance of the ends; by default taut at the start"},
    {"restitution", &physics::CordSpec::restitution, base::Limits{0, 1}, "rebound when it becomes taut"}};

/// Index of a body, or -1 for "world".
int find_end(base::Object& object, const Names& bodies, std::string_view key) {
  if (object.string(key) == "world") return -1;
  return static_cast<int>(find_body(object, bodies, key));
}

physics::JointSpec read_joint(base::Object& object, const Names& names) {
  physics::JointSpec joint;
  joint.place = object.find_place("");
  kJoint.read(object, joint);
  const std::string& kind = kJointNames[static_cast<std::size_t>(joint.kind)];
  joint.body = static_cast<int>(find_body(object, names));
  joint.to = find_end(object, names, "to");
  const bool has_axis = joint.kind == joints::Kind::kHinge || joint.kind == joints::Kind::kSlider || joint.kind == joints::Kind::kUniversal;
  if (has_axis) joint.axis = read_direction(object, "axis");
  if (!has_axis && object.has("axis")) object.fail("axis", fmt::format("a {} has none; remove it", kind));
  if (joint.kind == joints::Kind::kUniversal) {
    joint.second_axis = read_direction(object, "second_axis");
    const double cosine = dot(joint.axis, joint.second_axis);
    if (!(std::abs(cosine) < 1e-3)) object.fail("second_axis", "must be at right angles to \"axis\"");
    joint.second_axis = normalise(joint.second_axis - cosine * joint.axis);
  } else if (object.has("second_axis")) {
    object.fail("second_axis", "is for universal joints only; remove it");
  }
  if (joint.kind == joints::Kind::kWeld && object.has("damping")) object.fail("damping", "a weld does not move; remove it");
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
  if (!joint.limits && object.has("stop_restitution"))
    object.fail("stop_restitution", "needs \"limits_deg\" or \"limits_m\"; give them, too");
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
  kCord.read(object, cord);
  const double distance_m = norm(cord.from_m - cord.to_m);
  if (cord.length_m && !(*cord.length_m >= distance_m - 1e-9 && *cord.length_m <= kFarthestM))
    object.fail("length_m", fmt::format("{:g} m is less than the initial distance of its ends, {:.6g} m (or more than {:g} m); give at "
                                        "least that, or leave it out",
                                        *cord.length_m, distance_m, kFarthestM));
  object.finish();
  return cord;
}

}  // namespace

void parse_joints(base::Object& root, const Names& names, Scene& scene) {
  for (base::Object& object : root.objects("joints")) scene.joints.push_back(read_joint(object, names));
  for (base::Object& object : root.objects("cords")) scene.cords.push_back(read_cord(object, names));
}

void describe_joint_keys(std::vector<base::KeyTable>& tables) {
  kJoint.describe(tables.emplace_back(base::KeyTable{"joint", {}}));
  kCord.describe(tables.emplace_back(base::KeyTable{"cord", {}}));
}

}  // namespace carillon::scene
