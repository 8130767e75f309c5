// The steps of a PhysX scene for carillon_touches. A sample: compiled with the headers of PhysX 5.6.1 (a3d8a641, 2026-06-24), not run.
// C++17.
//
//   carillon::PhysxTouches physx(touches);              // options of the carillon_touches: points_after 0, compliant 0
//   scene_description.simulationEventCallback = &physx; // or call onContact() of it in your own
//   physx.add(*actor, index);
//   physx.start(0.0, message, sizeof message);
//   scene->simulate(dt), scene->fetchResults(true), physx.step(n * dt, message, sizeof message);
//
// The filter shader must set, for pairs that are to sound, eNOTIFY_TOUCH_FOUND | eNOTIFY_TOUCH_PERSISTS | eNOTIFY_CONTACT_POINTS.
#ifndef CARILLON_PHYSX_H
#define CARILLON_PHYSX_H

#include <PxPhysicsAPI.h>

#include <map>

#include "step.h"

namespace carillon {

/// One thread: that of fetchResults(), which calls onContact().
class PhysxTouches : public physx::PxSimulationEventCallback {
 public:
  /// `touches` must outlive this object.
  explicit PhysxTouches(carillon_touches* touches) : step_(touches) {}

  /// `index` of carillon_touches_add. The frame of the actor is that of the bank's mesh. Actors that are not added are the ground.
  void add(const physx::PxRigidDynamic& actor, std::int32_t index) {
    indices_[&actor] = index;
    step_.make_room(index);
  }
  void remove(const physx::PxRigidDynamic& actor) { indices_.erase(&actor); }

  carillon_status start(double time_s, char* message, std::size_t size) {
    read_poses();
    return step_.start(time_s, message, size);
  }
  carillon_status step(double time_s, char* message, std::size_t size) {
    read_poses();
    return step_.finish(time_s, message, size);
  }

  /// The normal points from the second body into the first; the position is between the shapes.
  void onContact(const physx::PxContactPairHeader& header, const physx::PxContactPair* pairs, physx::PxU32 count) override {
    physx::PxContactPairPoint points[64];
    for (physx::PxU32 p = 0; p < count; ++p)
      for (physx::PxU32 i = 0, n = pairs[p].extractContacts(points, 64); i < n; ++i) {
        const physx::PxContactPairPoint& c = points[i];
        step_.add(find(header.actors[0]), find(header.actors[1]), copy(c.position - 0.5f * c.separation * c.normal), copy(c.normal),
                  static_cast<double>(c.separation), static_cast<double>(c.impulse.dot(c.normal)));
      }
  }
  void onConstraintBreak(physx::PxConstraintInfo*, physx::PxU32) override {}
  void onWake(physx::PxActor**, physx::PxU32) override {}
  void onSleep(physx::PxActor**, physx::PxU32) override {}
  void onTrigger(physx::PxTriggerPair*, physx::PxU32) override {}
  void onAdvance(const physx::PxRigidBody* const*, const physx::PxTransform*, const physx::PxU32) override {}

 private:
  static Step::Vector copy(const physx::PxVec3& from) {
    return {static_cast<double>(from.x), static_cast<double>(from.y), static_cast<double>(from.z)};
  }
  std::int32_t find(const physx::PxActor* actor) const {
    const auto found = indices_.find(actor);
    return found == indices_.end() ? -1 : found->second;
  }
  void read_poses() {
    for (const auto& [key, index] : indices_) {
      const auto& actor = static_cast<const physx::PxRigidDynamic&>(*key);
      const physx::PxTransform at = actor.getGlobalPose();
      step_.set_pose(index, copy(at.transform(actor.getCMassLocalPose()).p),
                     {static_cast<double>(at.q.w), static_cast<double>(at.q.x), static_cast<double>(at.q.y), static_cast<double>(at.q.z)},
                     copy(actor.getLinearVelocity()), copy(actor.getAngularVelocity()), actor.isSleeping() ? CARILLON_ASLEEP : 0u);
    }
  }

  Step step_;
  std::map<const physx::PxActor*, std::int32_t> indices_;
};

}  // namespace carillon

#endif  // CARILLON_PHYSX_H
