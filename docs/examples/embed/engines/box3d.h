// The steps of a Box3D world for carillon_touches. A sample: compiled with Box3D after 0.1.0 (30c67b5, 2026-08-12), and run with two boxes
// that fall on each other; in 0.1.0 b3Body_GetWorldCenter is b3Body_GetWorldCenterOfMass. C++17.
//
//   carillon::Box3dTouches box3d(touches);              // options of the carillon_touches: points_after 0, compliant 0
//   box3d.add(body, index);
//   box3d.start(0.0, message, sizeof message);
//   b3World_Step(world, dt, 4), box3d.step(n * dt, message, sizeof message);
#ifndef CARILLON_BOX3D_H
#define CARILLON_BOX3D_H

#include <box3d/box3d.h>

#include <map>

#include "step.h"

namespace carillon {

/// One thread: that of the physics.
class Box3dTouches {
 public:
  /// `touches` must outlive this object.
  explicit Box3dTouches(carillon_touches* touches) : step_(touches) {}

  /// `index` of carillon_touches_add. The frame of the body is that of the bank's mesh. Bodies that are not added are the ground.
  void add(b3BodyId body, std::int32_t index) {
    bodies_[b3StoreBodyId(body)] = index;
    step_.make_room(index);
  }
  void remove(b3BodyId body) { bodies_.erase(b3StoreBodyId(body)); }

  carillon_status start(double time_s, char* message, std::size_t size) {
    read_poses();
    return step_.start(time_s, message, size);
  }
  carillon_status step(double time_s, char* message, std::size_t size) {
    for (const auto& body : bodies_) read_points(b3LoadBodyId(body.first), body.second);  // of the poses before the step
    read_poses();
    return step_.finish(time_s, message, size);
  }

 private:
  template <class From>
  static Step::Vector copy(const From& from) {
    return {static_cast<double>(from.x), static_cast<double>(from.y), static_cast<double>(from.z)};
  }
  std::int32_t find(b3BodyId body) const {
    const auto found = bodies_.find(b3StoreBodyId(body));
    return found == bodies_.end() ? -1 : found->second;
  }

  /// The normal points from A into B. Anchors are from the centres of mass to the middle between the shapes. Contacts of two bodies are
  /// listed at both.
  void read_points(b3BodyId body, std::int32_t index) {
    if (!b3Body_IsAwake(body)) return;
    contacts_.resize(static_cast<std::size_t>(b3Body_GetContactCapacity(body)));
    const int count = b3Body_GetContactData(body, contacts_.data(), static_cast<int>(contacts_.size()));
    for (int k = 0; k < count; ++k) {
      const b3ContactData& contact = contacts_[static_cast<std::size_t>(k)];
      const b3BodyId of_a = b3Shape_GetBody(contact.shapeIdA), of_b = b3Shape_GetBody(contact.shapeIdB);
      const std::int32_t a = find(of_a), b = find(of_b), other = a == index ? b : a;
      if (other >= 0 && other < index && b3Body_IsAwake(a == index ? of_b : of_a)) continue;  // listed at the other
      const Step::Vector centre = a >= 0 ? step_.get_centre(a) : copy(b3Body_GetWorldCenter(of_a));
      for (int m = 0; m < contact.manifoldCount; ++m) {
        const b3Manifold& manifold = contact.manifolds[m];
        const Step::Vector normal = copy(manifold.normal);
        for (int i = 0; i < manifold.pointCount; ++i) {
          const b3ManifoldPoint& p = manifold.points[i];
          const Step::Vector anchor = copy(p.anchorA);
          const double gap = static_cast<double>(p.separation);
          Step::Vector on_a;
          for (std::size_t d = 0; d < 3; ++d) on_a[d] = centre[d] + anchor[d] - gap / 2 * normal[d];
          step_.add(b, a, on_a, normal, gap, static_cast<double>(p.totalNormalImpulse));
        }
      }
    }
  }
  void read_poses() {
    for (const auto& [key, index] : bodies_) {
      const b3BodyId body = b3LoadBodyId(key);
      const b3Quat turn = b3Body_GetRotation(body);
      step_.set_pose(
          index, copy(b3Body_GetWorldCenter(body)),
          {static_cast<double>(turn.s), static_cast<double>(turn.v.x), static_cast<double>(turn.v.y), static_cast<double>(turn.v.z)},
          copy(b3Body_GetLinearVelocity(body)), copy(b3Body_GetAngularVelocity(body)), b3Body_IsAwake(body) ? 0u : CARILLON_ASLEEP);
    }
  }

  Step step_;
  std::map<std::uint64_t, std::int32_t> bodies_;  // ids as numbers
  std::vector<b3ContactData> contacts_;
};

}  // namespace carillon

#endif  // CARILLON_BOX3D_H
