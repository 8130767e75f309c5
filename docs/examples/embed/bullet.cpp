// A body falls, slides and rolls by Bullet, and sounds while it does: carillon/bullet.h reads its contacts.
//
//   bullet_drop BANK OUT.f32    what two ears hear, as pairs of floats at 48 kHz [Pa]
#include <carillon/bullet.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

namespace {

constexpr double kStep = 1.0 / 240.0;  // s
constexpr double kSeconds = 2.0;
char message[512];

void check(carillon_status status) {
  if (status == CARILLON_OK) return;
  std::fprintf(stderr, "bullet_drop: %s: %s\n", carillon_status_text(status), message);
  std::exit(1);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return std::fputs("usage: bullet_drop BANK OUT.f32\n", stderr), 2;
  carillon_bank* bank = nullptr;
  carillon_model* model = nullptr;
  carillon_synth* synth = nullptr;
  carillon_touches* touches = nullptr;
  check(carillon_bank_open(argv[1], &bank, message, sizeof message));
  carillon_model_options model_options;
  carillon_model_options_init(&model_options);
  check(carillon_model_make(bank, &model_options, &model, message, sizeof message));
  carillon_options options;
  carillon_options_init(&options);
  options.listener_m[1] = -1.0;
  options.listener_m[2] = 0.2;
  check(carillon_create(&options, &synth, message, sizeof message));

  // Bullet: a floor at z = 0, and the hull of the bank's surface about its centre of mass; its inertia is along the axes of the mesh.
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
  world.setGravity(btVector3(0, 0, btScalar(-9.81)));
  btStaticPlaneShape plane(btVector3(0, 0, 1), 0);
  btRigidBody floor(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &plane));
  floor.setRestitution(1);  // Bullet takes the products of both
  floor.setFriction(1);
  carillon_body_facts facts;
  carillon_body_facts_init(&facts);
  check(carillon_bank_get_facts(bank, &facts));
  double centre[3];
  carillon_bank_centre_m(bank, centre);
  btConvexHullShape hull;
  const double* vertex = carillon_bank_vertices_m(bank);
  for (std::int32_t i = 0; i < carillon_bank_vertex_count(bank); ++i, vertex += 3)
    hull.addPoint(btVector3(btScalar(vertex[0] - centre[0]), btScalar(vertex[1] - centre[1]), btScalar(vertex[2] - centre[2])), false);
  hull.recalcLocalAabb();
  hull.setMargin(0);
  const double* inertia = facts.inertia_kg_m2;
  btRigidBody::btRigidBodyConstructionInfo info(btScalar(facts.mass_kg), nullptr, &hull,
                                                btVector3(btScalar(inertia[0]), btScalar(inertia[4]), btScalar(inertia[8])));
  info.m_startWorldTransform = btTransform(btQuaternion(btVector3(3, 4, 0).normalized(), btScalar(0.5)), btVector3(0, 0, btScalar(0.4)));
  info.m_restitution = btScalar(0.5);
  info.m_friction = btScalar(0.6);
  btRigidBody body(info);
  body.setLinearVelocity(btVector3(btScalar(0.5), 0, 0));
  for (btRigidBody* one : {&floor, &body}) {
    one->setContactProcessingThreshold(0);  // else it is braked just before it touches, and does not bounce
    world.addRigidBody(one);
  }

  // Its sound: all of the default effects, and those of lasting contacts.
  carillon_body_options sound;
  carillon_body_options_init(&sound);
  sound.effects |= CARILLON_ROUGHNESS | CARILLON_ROLLING | CARILLON_CONTACT_DAMPING;
  carillon_touches_body touch;
  carillon_touches_body_init(&touch);
  touch.bank = bank;
  touch.restitution = 0.5;
  touch.friction = 0.6;
  check(carillon_add_body_with(synth, model, &sound, &touch.body, message, sizeof message));
  carillon_touches_options touches_options;
  carillon_touches_options_init(&touches_options);
  check(carillon_touches_create(synth, &touches_options, &touches, message, sizeof message));
  std::int32_t index = 0;
  check(carillon_touches_add(touches, &touch, &index, message, sizeof message));
  carillon::BulletTouches bullet(world, touches);
  bullet.add(body, index);
  check(bullet.start(0.0, message, sizeof message));

  std::vector<float> heard;
  for (int step = 1; step * kStep < kSeconds; ++step) {
    world.stepSimulation(btScalar(kStep), 0);
    check(bullet.step(step * kStep, message, sizeof message));
    while (carillon_time_s(synth) + 256 / 48000.0 < carillon_touches_mark_s(touches)) {  // an audio callback would do this
      float left[128], right[128];
      float* const ears[] = {left, right};
      carillon_process(synth, ears, 2, 128);
      for (int n = 0; n < 128; ++n) heard.insert(heard.end(), {left[n], right[n]});
    }
  }
  std::ofstream(argv[2], std::ios::binary)
      .write(reinterpret_cast<const char*>(heard.data()), std::streamsize(heard.size() * sizeof(float)));
  carillon_touches_counters seen;
  carillon_touches_counters_init(&seen);
  check(carillon_touches_get_counters(touches, &seen));
  carillon_counters counters;
  carillon_counters_init(&counters);
  check(carillon_get_counters(synth, &counters));
  const auto lost = counters.refused + counters.late + counters.faults + counters.overflows + counters.resets;
  std::printf("%lld hits, %lld lasting contacts, %zu frames, %lld events lost\n", static_cast<long long>(seen.hits),
              static_cast<long long>(seen.touches), heard.size() / 2, static_cast<long long>(lost));
  for (btRigidBody* one : {&floor, &body}) world.removeRigidBody(one);
  carillon_touches_destroy(touches);
  carillon_destroy(synth);
  carillon_model_release(model);
  carillon_bank_close(bank);
  return 0;
}
