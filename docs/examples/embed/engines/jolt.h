// The steps of a Jolt Physics system for carillon_touches. A sample: compiled with Jolt after 5.5.0 (3b47ec39, 2026-06-30), and run with
// two boxes that fall on each other. C++17; build it with the definitions of your Jolt library.
//
//   carillon::JoltTouches jolt(system, touches);        // options of the carillon_touches: points_after 0, compliant 0
//   system.SetContactListener(&jolt);                   // or call read() in your own listener
//   jolt.add(body_id, index);
//   jolt.start(0.0, message, sizeof message);
//   system.Update(dt, 1, allocator, jobs), jolt.step(n * dt, message, sizeof message);
#ifndef CARILLON_JOLT_H
#define CARILLON_JOLT_H

#include <Jolt/Jolt.h>
// Jolt.h comes first.
#include <Jolt/Physics/Body/Body.h>
#include <Jolt/Physics/Body/BodyInterface.h>
#include <Jolt/Physics/Collision/ContactListener.h>
#include <Jolt/Physics/PhysicsSystem.h>

#include <map>
#include <mutex>

#include "step.h"

namespace carillon {

/// Use one collision step per Update: poses are read after the last one only. The listener may run on several threads, everything else on
/// that of the physics.
class JoltTouches : public JPH::ContactListener {
 public:
  /// Both must outlive this object.
  JoltTouches(const JPH::PhysicsSystem& system, carillon_touches* touches) : system_(system), step_(touches) {}

  /// `index` of carillon_touches_add. The frame of the body is that of the bank's mesh. Bodies that are not added are the ground.
  void add(JPH::BodyID body, std::int32_t index) {
    indices_[body] = index;
    step_.make_room(index);
  }
  void remove(JPH::BodyID body) { indices_.erase(body); }

  carillon_status start(double time_s, char* message, std::size_t size) {
    read_poses();
    return step_.start(time_s, message, size);
  }
  carillon_status step(double time_s, char* message, std::size_t size) {
    read_poses();
    return step_.finish(time_s, message, size);
  }

  /// Jolt gives no impulses: they are found from the velocities. The normal points from the first body into the second.
  void read(const JPH::Body& first, const JPH::Body& second, const JPH::ContactManifold& manifold, const JPH::ContactSettings& settings) {
    if (settings.mIsSensor) return;
    const std::lock_guard<std::mutex> guard(mutex_);
    for (JPH::uint i = 0; i < manifold.mRelativeContactPointsOn1.size(); ++i) {
      const JPH::RVec3 on1 = manifold.GetWorldSpaceContactPointOn1(i), on2 = manifold.GetWorldSpaceContactPointOn2(i);
      const JPH::Vec3 normal = manifold.mWorldSpaceNormal;
      step_.add(find(second), find(first), copy(on1), copy(normal), static_cast<double>(normal.Dot(JPH::Vec3(on2 - on1))), NAN);
    }
  }
  void OnContactAdded(const JPH::Body& first, const JPH::Body& second, const JPH::ContactManifold& manifold,
                      JPH::ContactSettings& settings) override {
    read(first, second, manifold, settings);
  }
  void OnContactPersisted(const JPH::Body& first, const JPH::Body& second, const JPH::ContactManifold& manifold,
                          JPH::ContactSettings& settings) override {
    read(first, second, manifold, settings);
  }

 private:
  template <class From>
  static Step::Vector copy(const From& from) {
    return {static_cast<double>(from.GetX()), static_cast<double>(from.GetY()), static_cast<double>(from.GetZ())};
  }
  std::int32_t find(const JPH::Body& body) const {
    const auto found = indices_.find(body.GetID());
    return found == indices_.end() ? -1 : found->second;
  }
  void read_poses() {
    const JPH::BodyInterface& bodies = system_.GetBodyInterface();
    for (const auto& [id, index] : indices_) {
      const JPH::Quat turn = bodies.GetRotation(id);
      const bool is_asleep = bodies.GetMotionType(id) != JPH::EMotionType::Static && !bodies.IsActive(id);
      step_.set_pose(index, copy(bodies.GetCenterOfMassPosition(id)),
                     {static_cast<double>(turn.GetW()), static_cast<double>(turn.GetX()), static_cast<double>(turn.GetY()),
                      static_cast<double>(turn.GetZ())},
                     copy(bodies.GetLinearVelocity(id)), copy(bodies.GetAngularVelocity(id)), is_asleep ? CARILLON_ASLEEP : 0u);
    }
  }

  const JPH::PhysicsSystem& system_;
  Step step_;
  std::map<JPH::BodyID, std::int32_t> indices_;
  std::mutex mutex_;
};

}  // namespace carillon

#endif  // CARILLON_JOLT_H
