#include <carillon/bullet.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "tests/system/engines/engine.hpp"

namespace carillon::testing {
namespace {

btVector3 to_bullet(const double (&x)[3]) { return {btScalar(x[0]), btScalar(x[1]), btScalar(x[2])}; }

/// Collision shapes of a body; the last one is the whole. A tube is a disc at each end: a cylinder on a plane gets one point per step, at
/// one of its ends.
std::vector<std::unique_ptr<btCollisionShape>> make_shapes(const Solid& solid) {
  const btVector3 half = to_bullet(solid.half_m);
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  const auto add = [&](std::unique_ptr<btCollisionShape> shape) {
    shape->setMargin(btScalar(0.0005));
    shapes.push_back(std::move(shape));
  };
  if (solid.kind == "ball") {
    shapes.push_back(std::make_unique<btSphereShape>(half[0]));
  } else if (solid.kind == "box") {
    add(std::make_unique<btBoxShape>(half));
  } else {
    const btScalar thin = btScalar(0.01) * half[0];
    auto both = std::make_unique<btCompoundShape>();
    add(std::make_unique<btCylinderShapeX>(btVector3(thin, half[1], half[2])));
    for (const int side : {-1, 1})
      both->addChildShape(btTransform(btQuaternion::getIdentity(), btVector3(btScalar(side) * (half[0] - thin), 0, 0)),
                          shapes.front().get());
    shapes.push_back(std::move(both));
  }
  return shapes;
}

class Bullet : public Engine {
 public:
  Bullet(const std::vector<Solid>& solids, double step_s, carillon_touches* touches) : step_s_(step_s), reader_(world_, touches) {
    world_.setGravity(btVector3(0, 0, btScalar(-9.81)));
    configuration_.setPlaneConvexMultipointIterations();  // else a box on the ground gets one point per step
    world_.getSolverInfo().m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
    // Depth is corrected apart from velocities, or hits bounce too high; in longer steps a pile would not come to rest.
    if (step_s < 1e-3) world_.getSolverInfo().m_splitImpulsePenetrationThreshold = 1;
    // Overlap below the fall of a step is not corrected, so that piles come to rest; above 0.1 mm hits would be slowed down.
    world_.getSolverInfo().m_linearSlop = btScalar(std::min(1e-4, 9.81 * step_s * step_s));
    add(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &plane_), kRestitution);
    for (const Solid& solid : solids) {
      for (auto& shape : make_shapes(solid)) shapes_.push_back(std::move(shape));
      btRigidBody::btRigidBodyConstructionInfo info(btScalar(solid.mass_kg), nullptr, shapes_.back().get(), to_bullet(solid.inertia_kg_m2));
      const auto& q = solid.rotation;
      info.m_startWorldTransform =
          btTransform(btQuaternion(btScalar(q[1]), btScalar(q[2]), btScalar(q[3]), btScalar(q[0])), to_bullet(solid.position_m));
      btRigidBody& body = add(info, solid.restitution);
      body.setLinearVelocity(to_bullet(solid.velocity_m_s));
      body.setAngularVelocity(to_bullet(solid.spin_rad_s));
      reader_.add(body, static_cast<std::int32_t>(bodies_.size()) - 2);
    }
  }
  ~Bullet() override {
    for (const auto& body : bodies_) world_.removeRigidBody(body.get());
  }

  carillon_status start(char* message, std::size_t size) override { return reader_.start(0.0, message, size); }
  carillon_status step(double time_s, char* message, std::size_t size) override {
    world_.stepSimulation(btScalar(step_s_), 0);
    return reader_.step(time_s, message, size);
  }

 private:
  btRigidBody& add(btRigidBody::btRigidBodyConstructionInfo info, double restitution) {
    info.m_restitution = btScalar(restitution / std::sqrt(kRestitution));  // Bullet takes products
    info.m_friction = btScalar(std::sqrt(kFriction));
    bodies_.push_back(std::make_unique<btRigidBody>(info));
    bodies_.back()->setContactProcessingThreshold(0);
    world_.addRigidBody(bodies_.back().get());
    return *bodies_.back();
  }

  double step_s_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver solver_;
  btDiscreteDynamicsWorld world_{&dispatcher_, &broadphase_, &solver_, &configuration_};
  btStaticPlaneShape plane_{btVector3(0, 0, 1), 0};
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  BulletTouches reader_;
};

}  // namespace

void set_options(carillon_touches_options&) {}
std::unique_ptr<Engine> make_engine(const std::vector<Solid>& solids, double step_s, carillon_touches* touches) {
  return std::make_unique<Bullet>(solids, step_s, touches);
}

}  // namespace carillon::testing
