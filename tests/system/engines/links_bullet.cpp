// links_bullet: carillon/bullet.h with links of a btMultiBody, a btCompoundShape and a btHeightfieldTerrainShape. Velocities are the change
// of positions, impulses the change of momentum, points lie on the terrain. This program takes the place of the tracker.
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <carillon/bullet.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "tests/system/engines/tracker.hpp"

namespace {

constexpr double kStep = 1.0 / 1000.0;
constexpr int kBodies = 4, kSteps = 1500;
enum Body { kBall, kPair, kBar, kHand };  // a base without links, a compound, a base with a link, that link

carillon::testing::OnTerrain seen[kBodies];

double calc_height(double x, double y) { return 0.02 * std::cos(x) * std::cos(y); }

const btScalar kRadius = btScalar(0.03);

struct World {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btMultiBodyConstraintSolver solver;
  btMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
};

/// A collider of a link (-1: the base).
void add_collider(btMultiBodyDynamicsWorld& world, btMultiBodyLinkCollider& collider, btMultiBody& body, int link,
                  btCollisionShape& shape) {
  collider.setCollisionShape(&shape);
  collider.setWorldTransform(link < 0 ? body.getBaseWorldTransform() : btTransform(btQuaternion::getIdentity(), body.getBasePos()));
  collider.setFriction(btScalar(0.5));
  world.addCollisionObject(&collider, btBroadphaseProxy::DefaultFilter, btBroadphaseProxy::AllFilter);
  (link < 0 ? body.setBaseCollider(&collider) : void(body.getLink(link).m_collider = &collider));
}

}  // namespace

void carillon::testing::take(const carillon_point& p) { seen[p.a].add(p, calc_height(p.point_m[0], p.point_m[1])); }

int main() {
  World all;
  btMultiBodyDynamicsWorld& world = all.world;
  world.setGravity(btVector3(0, 0, btScalar(-9.81)));
  constexpr int kSide = 41;
  std::vector<float> heights;
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) heights.push_back(static_cast<float>(calc_height(0.1 * (i - kSide / 2), 0.1 * (j - kSide / 2))));
  btHeightfieldTerrainShape terrain(kSide, kSide, heights.data(), 1, -1, 1, 2, PHY_FLOAT, false);
  terrain.setLocalScaling(btVector3(btScalar(0.1), btScalar(0.1), 1));
  terrain.setMargin(0);
  btRigidBody ground(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &terrain));
  world.addRigidBody(&ground);

  btSphereShape sphere(kRadius);
  btBoxShape half(btVector3(btScalar(0.02), btScalar(0.02), btScalar(0.02)));
  btCompoundShape pair;
  for (const int side : {-1, 1})
    pair.addChildShape(btTransform(btQuaternion::getIdentity(), btVector3(btScalar(0.03 * side), 0, 0)), &half);
  btVector3 inertia;
  pair.calculateLocalInertia(btScalar(0.4), inertia);
  btRigidBody rigid(btRigidBody::btRigidBodyConstructionInfo(btScalar(0.4), nullptr, &pair, inertia));
  rigid.setWorldTransform(btTransform(btQuaternion(btVector3(1, 1, 0).normalized(), btScalar(0.4)), btVector3(1, 0, btScalar(0.2))));
  world.addRigidBody(&rigid);

  const btVector3 of_ball = btScalar(0.4 * 0.5) * kRadius * kRadius * btVector3(1, 1, 1);
  btMultiBody ball(0, btScalar(0.5), of_ball, false, true);
  ball.setBasePos(btVector3(0, 0, btScalar(0.2)));
  ball.finalizeMultiDof();
  ball.setBaseVel(btVector3(btScalar(0.3), 0, 0));
  world.addMultiBody(&ball);
  btMultiBodyLinkCollider of_base(&ball, -1);
  add_collider(world, of_base, ball, -1, sphere);

  // A fixed base, and a link that swings about it and does not reach the terrain.
  btMultiBody arm(1, btScalar(1), of_ball, true, true);
  arm.setBasePos(btVector3(-1, 0, btScalar(0.5)));
  arm.setupRevolute(0, btScalar(0.3), of_ball, -1, btQuaternion::getIdentity(), btVector3(0, 1, 0), btVector3(0, 0, 0),
                    btVector3(btScalar(0.2), 0, 0));
  arm.finalizeMultiDof();
  world.addMultiBody(&arm);
  btMultiBodyLinkCollider of_bar(&arm, -1), of_hand(&arm, 0);
  add_collider(world, of_bar, arm, -1, sphere);
  add_collider(world, of_hand, arm, 0, sphere);
  btAlignedObjectArray<btQuaternion> turns;
  btAlignedObjectArray<btVector3> origins;
  arm.forwardKinematics(turns, origins);
  arm.updateCollisionObjectWorldTransforms(turns, origins);

  carillon::BulletTouches reader(world, nullptr);
  reader.add(of_base, kBall);
  reader.add(rigid, kPair);
  reader.add(of_bar, kBar);
  reader.add(of_hand, kHand);
  reader.start(0.0, nullptr, 0);
  const std::vector<carillon_pose>& poses = carillon::testing::now;
  const std::vector<carillon_pose> begin = poses;
  double slip_m_s = 0.0, fastest_m_s = 0.0;  // velocity of the hand against the change of its position
  for (int n = 1; n <= kSteps; ++n) {
    const carillon_pose before = poses[kHand];
    world.stepSimulation(btScalar(kStep), 0);
    reader.step(n * kStep, nullptr, 0);
    const carillon_pose& now = poses[kHand];
    double error2 = 0.0, speed2 = 0.0;
    for (int k = 0; k < 3; ++k) {
      const double mean = 0.5 * (before.velocity_m_s[k] + now.velocity_m_s[k]);
      error2 += std::pow((now.position_m[k] - before.position_m[k]) / kStep - mean, 2);
      speed2 += mean * mean;
    }
    slip_m_s = std::max(slip_m_s, std::sqrt(error2));
    fastest_m_s = std::max(fastest_m_s, std::sqrt(speed2));
  }
  bool is_right = slip_m_s < 0.02 * fastest_m_s && fastest_m_s > 1.9 && std::abs(poses[kHand].spin_rad_s[1]) <= fastest_m_s / 0.19;
  std::printf("hand: at most %.3f m/s, off by %.4f m/s\n", fastest_m_s, slip_m_s);
  is_right = is_right && (poses[kHand].flags & CARILLON_JOINTED) != 0u && (poses[kBall].flags & CARILLON_JOINTED) == 0u;
  is_right = seen[kBall].is_right("ball", 0.5, kSteps * kStep, begin[kBall], poses[kBall], 0.01) && is_right;
  is_right = seen[kPair].is_right("pair", 0.4, kSteps * kStep, begin[kPair], poses[kPair], 0.01) && is_right;
  for (btMultiBodyLinkCollider* collider : {&of_base, &of_bar, &of_hand}) world.removeCollisionObject(collider);
  world.removeMultiBody(&ball);
  world.removeMultiBody(&arm);
  world.removeRigidBody(&rigid);
  world.removeRigidBody(&ground);
  return is_right ? 0 : 1;
}
