// A body falls, slides and rolls by Bullet, and sounds while it does: carillon/bullet.h reads its contacts.
//
//   bullet_drop BANK OUT.f32    OUT: pressure at two ears [Pa], pairs of floats at 48 kHz
#include <carillon/bullet.h>

#include <memory>

#include "sound.hpp"

namespace {

constexpr double kStep = 1.0 / 240.0;  // s
constexpr double kSeconds = 2.0;
constexpr double kRestitution = 0.5, kFriction = 0.6;

/// A floor at z = 0 and a body above it, turned and thrown. Its shape is the hull of the bank's surface about its centre of mass, and its
/// inertia must be along the axes of the mesh.
class World {
 public:
  explicit World(const carillon_bank* bank) {
    world.setGravity(btVector3(0, 0, btScalar(-9.81)));
    floor_ = add(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &plane_), 1, 1);  // Bullet takes the products of both
    double centre[3];
    carillon_bank_centre_m(bank, centre);
    const double* x = carillon_bank_vertices_m(bank);
    for (std::int32_t i = 0; i < carillon_bank_vertex_count(bank); ++i, x += 3)
      hull_.addPoint(btVector3(btScalar(x[0] - centre[0]), btScalar(x[1] - centre[1]), btScalar(x[2] - centre[2])), false);
    hull_.recalcLocalAabb();
    hull_.setMargin(0);  // margins round corners
    carillon_body_facts facts;
    carillon_body_facts_init(&facts);
    carillon_bank_get_facts(bank, &facts);
    const double* inertia = facts.inertia_kg_m2;
    btRigidBody::btRigidBodyConstructionInfo info(btScalar(facts.mass_kg), nullptr, &hull_,
                                                  btVector3(btScalar(inertia[0]), btScalar(inertia[4]), btScalar(inertia[8])));
    info.m_startWorldTransform = btTransform(btQuaternion(btVector3(3, 4, 0).normalized(), btScalar(0.5)), btVector3(0, 0, btScalar(0.4)));
    body = add(info, kRestitution, kFriction);
    body->setLinearVelocity(btVector3(btScalar(0.5), 0, 0));
  }
  ~World() {
    world.removeRigidBody(body.get());
    world.removeRigidBody(floor_.get());
  }

 private:
  std::unique_ptr<btRigidBody> add(btRigidBody::btRigidBodyConstructionInfo info, double restitution, double friction) {
    info.m_restitution = btScalar(restitution);
    info.m_friction = btScalar(friction);
    auto added = std::make_unique<btRigidBody>(info);
    added->setContactProcessingThreshold(0);  // else it is braked just before it touches, and does not bounce
    world.addRigidBody(added.get());
    return added;
  }

  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver solver_;
  btStaticPlaneShape plane_{btVector3(0, 0, 1), 0};
  btConvexHullShape hull_;
  std::unique_ptr<btRigidBody> floor_;

 public:
  btDiscreteDynamicsWorld world{&dispatcher_, &broadphase_, &solver_, &configuration_};
  std::unique_ptr<btRigidBody> body;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return std::fputs("usage: bullet_drop BANK OUT.f32\n", stderr), 2;
  carillon_touches_options options;
  carillon_touches_options_init(&options);
  Sound sound(options);
  const std::int32_t index = sound.add(argv[1], "body", kRestitution, kFriction);
  World own(sound.get_bank(index));
  carillon::BulletTouches bullet(own.world, sound.get_touches());
  bullet.add(*own.body, index);
  Message message;
  message.check(bullet.start(0.0, message.text(), message.size()));
  for (int step = 1; step * kStep < kSeconds; ++step) {
    own.world.stepSimulation(btScalar(kStep), 0);
    message.check(bullet.step(step * kStep, message.text(), message.size()));
    sound.play();
  }
  sound.finish(argv[2]);
  return 0;
}
