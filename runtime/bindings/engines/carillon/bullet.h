// The steps of a Bullet 3 world for carillon_touches: header of the program that uses Bullet, C++14. docs/howto/my-engine.md
#ifndef CARILLON_BULLET_H
#define CARILLON_BULLET_H

#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <btBulletDynamicsCommon.h>
#include <carillon.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace carillon {

/// Poses and contact points of a Bullet world after each of its internal steps. Options of the carillon_touches: points_after 0, compliant
/// 0. One thread: that of the physics.
class BulletTouches {
 public:
  /// Both must outlive this object.
  BulletTouches(btDynamicsWorld& world, carillon_touches* touches) : world_(world), touches_(touches) {}

  /// A btRigidBody or btMultiBodyLinkCollider. `index` of carillon_touches_add, one after another from 0. Objects that are not added are
  /// the ground. `mesh`: rotation of the frame of the bank's mesh in the frame of the object, whose origin must be the centre of mass.
  void add(const btCollisionObject& object, std::int32_t index, const btQuaternion& mesh = btQuaternion::getIdentity()) {
    if (bodies_.size() <= static_cast<std::size_t>(index)) bodies_.resize(static_cast<std::size_t>(index) + 1);
    bodies_[static_cast<std::size_t>(index)] = {&object, mesh, 0u};
    indices_[&object] = index;
  }
  /// After carillon_touches_remove.
  void remove(const btCollisionObject& object) {
    const auto found = indices_.find(&object);
    if (found == indices_.end()) return;
    bodies_[static_cast<std::size_t>(found->second)].object = nullptr;
    indices_.erase(found);
  }
  /// The next step has moved the object by the program's will: its contacts end.
  void mark_teleported(const btCollisionObject& object) {
    const auto found = indices_.find(&object);
    if (found != indices_.end()) bodies_[static_cast<std::size_t>(found->second)].flags |= CARILLON_TELEPORTED;
  }

  /// Before the first step. Status and message as of carillon_touches_start.
  carillon_status start(double time_s, char* message, std::size_t size) {
    read_poses();
    return carillon_touches_start(touches_, time_s, poses_.data(), count(), message, size);
  }
  /// After world.stepSimulation(dt, 0), or in the tick callback (setInternalTickCallback): Bullet keeps the impulses of one internal step
  /// only. Status and message as of carillon_touches_step.
  carillon_status step(double time_s, char* message, std::size_t size) {
    read_poses();
    read_points();
    return carillon_touches_step(touches_, time_s, poses_.data(), count(), points_.data(), static_cast<std::int32_t>(points_.size()),
                                 message, size);
  }

 private:
  struct Body {
    const btCollisionObject* object;
    btQuaternion mesh;
    std::uint32_t flags;
  };
  std::int32_t count() const { return static_cast<std::int32_t>(poses_.size()); }
  static void copy(const btVector3& from, double to[3]) {
    for (int k = 0; k < 3; ++k) to[k] = static_cast<double>(from[k]);
  }
  std::int32_t find(const btCollisionObject* object) const {
    const auto found = indices_.find(object);
    return found == indices_.end() ? -1 : found->second;
  }

  void read_poses() {
    poses_.assign(bodies_.size(), carillon_pose());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      carillon_pose& pose = poses_[i];
      pose.rotation[0] = 1.0;
      const btCollisionObject* object = bodies_[i].object;
      if (object == nullptr) continue;
      const btTransform& at = object->getWorldTransform();
      const btQuaternion turn = (at.getRotation() * bodies_[i].mesh).normalized();
      const btScalar turned[4] = {turn.w(), turn.x(), turn.y(), turn.z()};
      for (int k = 0; k < 4; ++k) pose.rotation[k] = static_cast<double>(turned[k]);
      copy(at.getOrigin(), pose.position_m);
      pose.flags = std::exchange(bodies_[i].flags, 0u);
      if (!object->isActive() && !object->isStaticObject()) pose.flags |= CARILLON_ASLEEP;
      if (const btMultiBodyLinkCollider* link = btMultiBodyLinkCollider::upcast(object)) read_link(*link, pose);
      const btRigidBody* body = btRigidBody::upcast(object);
      if (body == nullptr) continue;
      copy(body->getLinearVelocity(), pose.velocity_m_s);
      copy(body->getAngularVelocity(), pose.spin_rad_s);
      if (body->getNumConstraintRefs() > 0) pose.flags |= CARILLON_JOINTED;
    }
  }
  /// Velocities of a link, or of the base, of a btMultiBody.
  void read_link(const btMultiBodyLinkCollider& link, carillon_pose& pose) {
    const btMultiBody& whole = *link.m_multiBody;
    const std::size_t count = static_cast<std::size_t>(whole.getNumLinks()) + 1, at = static_cast<std::size_t>(link.m_link + 1);
    spins_.resize(count);
    velocities_.resize(count);
    whole.compTreeLinkVelocities(spins_.data(), velocities_.data());  // each in the frame of its link; the base first
    const btQuaternion turn = link.getWorldTransform().getRotation();
    copy(quatRotate(turn, velocities_[at]), pose.velocity_m_s);
    copy(quatRotate(turn, spins_[at]), pose.spin_rad_s);
    if (count > 1) pose.flags |= CARILLON_JOINTED;
  }
  void read_points() {
    points_.clear();
    btDispatcher& dispatcher = *world_.getDispatcher();
    for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
      const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
      const std::int32_t first = find(manifold.getBody0()), second = find(manifold.getBody1());
      // Points of sleeping bodies keep the impulse of their last step.
      if ((first < 0 && second < 0) || (!manifold.getBody0()->isActive() && !manifold.getBody1()->isActive())) continue;
      for (int k = 0; k < manifold.getNumContacts(); ++k) {
        const btManifoldPoint& from = manifold.getContactPoint(k);
        // Points that are too far apart are not solved, and keep it as well.
        if (!(from.getAppliedImpulse() > 0) || from.getDistance() > manifold.getContactProcessingThreshold()) continue;
        const bool is_turned = first < 0;
        const btScalar sign = btScalar(is_turned ? -1 : 1);
        carillon_point point = carillon_point();
        point.a = is_turned ? second : first;
        point.b = is_turned ? -1 : second;
        copy(is_turned ? from.getPositionWorldOnA() : from.getPositionWorldOnB(), point.point_m);
        copy(sign * from.m_normalWorldOnB, point.normal);
        copy(sign *
                 (from.m_appliedImpulseLateral1 * from.m_lateralFrictionDir1 + from.m_appliedImpulseLateral2 * from.m_lateralFrictionDir2),
             point.friction_n_s);
        point.gap_m = static_cast<double>(from.getDistance());
        point.impulse_n_s = static_cast<double>(from.getAppliedImpulse());
        point.curvature_per_m = NAN;  // of the surfaces of the banks
        points_.push_back(point);
      }
    }
  }

  btDynamicsWorld& world_;
  carillon_touches* touches_;
  std::vector<Body> bodies_;
  std::map<const btCollisionObject*, std::int32_t> indices_;
  std::vector<carillon_pose> poses_;
  std::vector<carillon_point> points_;
  std::vector<btVector3> spins_, velocities_;  // of the links of a btMultiBody
};

}  // namespace carillon

#endif  // CARILLON_BULLET_H
