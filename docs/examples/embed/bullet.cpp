// Another physics engine: Bullet lets a body fall on a floor; its contacts sound while they happen, and go into a contacts file as well.
//
//   bullet_drop BANK OUT.jsonl OUT.f32    the contacts, for carillon-render --contacts; what two ears hear, as pairs of floats at 48 kHz,
//   in Pa
#include <btBulletDynamicsCommon.h>
#include <carillon.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace {

using carillon::Vec3;
using carillon::bank::Bank;

constexpr double kStep = 1.0 / 2000.0;  // s
constexpr double kSeconds = 1.5;
constexpr double kAhead = 0.03;  // s; so far physics runs ahead of the sound
constexpr double kRestitution = 0.5;
constexpr double kFriction = 0.6;
constexpr double kContact = 1e-4;  // s; that a hit lasts: Bullet does not say
constexpr int kBlock = 128;

/// The nearest place on the surface of a bank, as a triangle and weights of its corners.
struct Place {
  int triangle = 0;
  Vec3 weights{};
};

btVector3 to_bullet(const Vec3& x) { return {btScalar(x[0]), btScalar(x[1]), btScalar(x[2])}; }

/// Weights of the point of a triangle that is nearest to x (C. Ericson, Real-Time Collision Detection, 5.1.5).
Vec3 find_weights(const btVector3& x, const btVector3& a, const btVector3& b, const btVector3& c) {
  const btVector3 ab = b - a, ac = c - a, ax = x - a, bx = x - b, cx = x - c;
  const double d1 = ab.dot(ax), d2 = ac.dot(ax), d3 = ab.dot(bx), d4 = ac.dot(bx), d5 = ab.dot(cx), d6 = ac.dot(cx);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return {1 - d1 / (d1 - d3), d1 / (d1 - d3), 0};
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return {1 - d2 / (d2 - d6), 0, d2 / (d2 - d6)};
  const double w = (d4 - d3) / (d4 - d3 + d5 - d6);
  if (va <= 0 && d4 >= d3 && d5 >= d6) return {0, 1 - w, w};
  const double sum = va + vb + vc;
  return {va / sum, vb / sum, vc / sum};
}

Place find_place(const Bank& bank, const btVector3& x) {
  Place best;
  double least = 1e300;
  for (std::size_t t = 0; t < bank.triangles.size(); ++t) {
    btVector3 corner[3];
    for (int k = 0; k < 3; ++k) corner[k] = to_bullet(bank.vertices_m[bank.triangles[t][k]]);
    const Vec3 w = find_weights(x, corner[0], corner[1], corner[2]);
    const btVector3 there = btScalar(w[0]) * corner[0] + btScalar(w[1]) * corner[1] + btScalar(w[2]) * corner[2];
    const double distance = (there - x).length2();
    if (distance < least) {
      least = distance;
      best = {static_cast<int>(t), w};
    }
  }
  return best;
}

/// A floor at z = 0 and the body of a bank above it, turned. Bullet's body sits in its centre of mass; its inertia must be along the axes
/// of the mesh.
class World {
 public:
  explicit World(const Bank& bank)
      : bank_(bank),
        dispatcher_(&configuration_),
        world_(&dispatcher_, &broadphase_, &solver_, &configuration_),
        floor_(btVector3(0, 0, 1), 0),
        centre_(to_bullet(bank.rigid.centre_m)) {
    for (const Vec3& x : bank.vertices_m) hull_.addPoint(to_bullet(x) - centre_, false);
    hull_.recalcLocalAabb();
    hull_.setMargin(0);
    world_.setGravity(btVector3(0, 0, btScalar(-9.81)));
    world_.getSolverInfo().m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
    world_.getSolverInfo().m_splitImpulsePenetrationThreshold = 1;  // depth is corrected apart from velocities, or hits bounce too high
    world_.getSolverInfo().m_restitutionVelocityThreshold = btScalar(0.02);
    btRigidBody::btRigidBodyConstructionInfo ground(0, nullptr, &floor_);
    ground.m_restitution = ground.m_friction = 1;  // Bullet takes the product of both
    ground_ = std::make_unique<btRigidBody>(ground);
    world_.addRigidBody(ground_.get());
    const auto& inertia = bank.rigid.inertia_kg_m2;
    btRigidBody::btRigidBodyConstructionInfo info(btScalar(bank.rigid.mass_kg), nullptr, &hull_,
                                                  btVector3(btScalar(inertia[0]), btScalar(inertia[4]), btScalar(inertia[8])));
    info.m_restitution = btScalar(kRestitution);
    info.m_friction = btScalar(kFriction);
    info.m_startWorldTransform = btTransform(btQuaternion(btVector3(3, 4, 0).normalized(), btScalar(0.5)), btVector3(0, 0, btScalar(0.4)));
    body_ = std::make_unique<btRigidBody>(info);
    body_->setContactProcessingThreshold(0);  // else what is about to touch is braked before, and does not bounce
    ground_->setContactProcessingThreshold(0);
    world_.addRigidBody(body_.get());
  }
  ~World() {
    world_.removeRigidBody(body_.get());
    world_.removeRigidBody(ground_.get());
  }

  /// One step; then the hits in it. What Bullet pushes in a step at rest, the weight times the step, is none.
  std::vector<carillon_impulse> step() {
    world_.stepSimulation(btScalar(kStep), 0);
    ++steps_;
    std::vector<carillon_impulse> hits;
    const btTransform& pose = body_->getWorldTransform();
    const double weight = 9.81 * bank_.rigid.mass_kg * kStep;
    for (int m = 0; m < dispatcher_.getNumManifolds(); ++m) {
      btPersistentManifold& manifold = *dispatcher_.getManifoldByIndexInternal(m);
      const bool is_first = manifold.getBody0() == body_.get();
      for (int p = 0; p < manifold.getNumContacts(); ++p) {
        btManifoldPoint& point = manifold.getContactPoint(p);
        const btScalar push = point.getAppliedImpulse();
        point.m_appliedImpulse = 0;  // it stays there until the point is solved again
        if (push < 3 * weight) continue;
        btVector3 impulse = point.m_normalWorldOnB * push + point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 +
                            point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2;
        if (!is_first) impulse = -impulse;
        const btVector3 here = pose.inverse() * (is_first ? point.getPositionWorldOnA() : point.getPositionWorldOnB()) + centre_;
        const btVector3 own = pose.getBasis().transpose() * impulse;
        const Place place = find_place(bank_, here);
        carillon_impulse hit;
        carillon_impulse_init(&hit);
        hit.triangle = place.triangle;
        std::copy(place.weights.begin(), place.weights.end(), hit.barycentric);
        for (int k = 0; k < 3; ++k) hit.impulse_n_s[k] = own[k];
        hit.duration_s = kContact;
        hit.time_s = get_time_s() - kStep + 0.5 * kContact;  // a step sees what touched when it began
        hits.push_back(hit);
      }
    }
    return hits;
  }

  carillon_motion get_motion() const {
    carillon_motion motion;
    carillon_motion_init(&motion);
    const btTransform& pose = body_->getWorldTransform();
    const btQuaternion turn = pose.getRotation();
    const double q[4] = {turn.w(), turn.x(), turn.y(), turn.z()};
    std::copy(q, q + 4, motion.rotation);
    for (int k = 0; k < 3; ++k) motion.position_m[k] = pose.getOrigin()[k], motion.velocity_m_s[k] = body_->getLinearVelocity()[k];
    motion.time_s = get_time_s();
    return motion;
  }
  double get_time_s() const { return steps_ * kStep; }

 private:
  const Bank& bank_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver solver_;
  btDiscreteDynamicsWorld world_;
  btStaticPlaneShape floor_;
  btConvexHullShape hull_;
  btVector3 centre_;
  std::unique_ptr<btRigidBody> ground_, body_;
  int steps_ = 0;
};

/// The contacts file: docs/howto/contacts-file.md. 17 digits bring every double back.
class Recorder {
 public:
  Recorder(const char* file, std::size_t triangles) : out_(std::fopen(file, "w")) {
    if (out_ == nullptr) throw std::runtime_error(std::string(file) + ": cannot be written");
    std::fprintf(out_, "{\"carillon_contacts\": 1, \"bodies\": [{\"name\": \"body\", \"triangles\": %zu}]}\n", triangles);
  }
  ~Recorder() { std::fclose(out_); }
  void write(const carillon_impulse& i) {
    std::fprintf(out_, "{\"impulse\": {\"time_s\": %.17g, \"body\": 0, \"triangle\": %d, \"barycentric\": [%.17g, %.17g, %.17g], ",
                 i.time_s, i.triangle, i.barycentric[0], i.barycentric[1], i.barycentric[2]);
    std::fprintf(out_, "\"impulse_n_s\": [%.17g, %.17g, %.17g], \"duration_s\": %.17g}}\n", i.impulse_n_s[0], i.impulse_n_s[1],
                 i.impulse_n_s[2], i.duration_s);
  }
  void write(const carillon_motion& m) {
    std::fprintf(out_, "{\"motion\": {\"time_s\": %.17g, \"body\": 0, \"position_m\": [%.17g, %.17g, %.17g], ", m.time_s, m.position_m[0],
                 m.position_m[1], m.position_m[2]);
    std::fprintf(out_, "\"velocity_m_s\": [%.17g, %.17g, %.17g], \"rotation\": [%.17g, %.17g, %.17g, %.17g]}}\n", m.velocity_m_s[0],
                 m.velocity_m_s[1], m.velocity_m_s[2], m.rotation[0], m.rotation[1], m.rotation[2], m.rotation[3]);
  }

 private:
  std::FILE* out_;
};

void check(carillon_status status, const char* message) {
  if (status != CARILLON_OK) throw std::runtime_error(message);
}

/// A synthesiser with one body, in the middle between the ears a metre ahead.
class Sound {
 public:
  explicit Sound(const char* bank_file, const carillon_motion& at) {
    char message[512] = "";
    check(carillon_bank_open(bank_file, &bank_, message, sizeof message), message);
    carillon_model_options model_options;
    carillon_model_options_init(&model_options);
    check(carillon_model_make(bank_, &model_options, &model_, message, sizeof message), message);
    carillon_options options;
    carillon_options_init(&options);
    options.listener_m[1] = -1.0;
    options.listener_m[2] = 0.2;
    check(carillon_create(&options, &synth_, message, sizeof message), message);
    carillon_body_options body;
    carillon_body_options_init(&body);
    std::copy(at.position_m, at.position_m + 3, body.position_m);
    std::copy(at.rotation, at.rotation + 4, body.rotation);
    std::int32_t number = 0;
    check(carillon_add_body_with(synth_, model_, &body, &number, message, sizeof message), message);
  }
  ~Sound() {
    carillon_destroy(synth_);
    carillon_model_release(model_);
    carillon_bank_close(bank_);
  }
  void push(const carillon_impulse& impulse) { check(carillon_push_impulse(synth_, &impulse), "a hit cannot be played"); }
  void push(const carillon_motion& motion) { check(carillon_push_motion(synth_, &motion), "a motion cannot be played"); }
  double get_time_s() const { return carillon_time_s(synth_); }
  /// What an audio callback would do.
  void play(std::vector<float>& out) {
    std::array<float, kBlock> left, right;
    float* const channels[2] = {left.data(), right.data()};
    carillon_process(synth_, channels, 2, kBlock);
    for (int n = 0; n < kBlock; ++n) out.insert(out.end(), {left[n], right[n]});
  }
  std::int64_t count_lost() const {
    carillon_counters counters;
    carillon_counters_init(&counters);
    carillon_get_counters(synth_, &counters);
    return counters.refused + counters.late + counters.faults + counters.overflows + counters.resets;
  }

 private:
  carillon_bank* bank_ = nullptr;
  carillon_model* model_ = nullptr;
  carillon_synth* synth_ = nullptr;
};

void run(const char* bank_file, const char* contacts_file, const char* sound_file) {
  const Bank bank = carillon::bank::read_bank(bank_file);
  World world(bank);
  Recorder recorder(contacts_file, bank.triangles.size());
  Sound sound(bank_file, world.get_motion());
  sound.push(world.get_motion());
  recorder.write(world.get_motion());
  std::vector<float> heard;
  int hits = 0, steps = 0;
  while (sound.get_time_s() < kSeconds) {
    while (world.get_time_s() < sound.get_time_s() + kAhead) {
      for (const carillon_impulse& hit : world.step()) {
        sound.push(hit);
        recorder.write(hit);
        ++hits;
      }
      if (++steps % 4 != 0) continue;
      sound.push(world.get_motion());
      recorder.write(world.get_motion());
    }
    sound.play(heard);
  }
  std::ofstream out(sound_file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(heard.data()), static_cast<std::streamsize>(heard.size() * sizeof(float)));
  if (!out.flush()) throw std::runtime_error(std::string(sound_file) + ": cannot be written");
  std::printf("%d hits, %zu frames, %lld events lost\n", hits, heard.size() / 2, static_cast<long long>(sound.count_lost()));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fputs("usage: bullet_drop BANK OUT.jsonl OUT.f32\n", stderr);
    return 2;
  }
  try {
    run(argv[1], argv[2], argv[3]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bullet_drop: %s\n", error.what());
    return 1;
  }
  return 0;
}
