// Cost of the contact tracker next to Bullet: a heap of boxes falls and rests.
//
// usage: bench_touches BANK [HZ [BOXES [found]]]    BANK: of a box; 240 steps per second and 64 boxes; found: impulses from velocities
//          prints one line of JSON: points per step, CPU seconds (clock of the thread) for a second of the heap of Bullet and of the
//          tracker, their ratio, and the tracker's worst step [ms]
#include <carillon/bullet.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include "runtime/base/clock.hpp"

namespace {

using carillon::base::get_thread_cpu_s;

constexpr double kSeconds = 3.0;
char message[512];

void check(carillon_status status) {
  if (status == CARILLON_OK) return;
  std::fprintf(stderr, "bench_touches: %s\n", message);
  std::exit(1);
}

bool is_found = false;  // impulses are withheld, and found from the velocities

/// Counts events; nothing plays them.
void count_event(void* count, int32_t, const void*) { ++*static_cast<long*>(count); }

struct Heap {
  Heap(const carillon_bank* bank, int boxes) {
    world.setGravity(btVector3(0, 0, btScalar(-9.81)));
    carillon_body_facts facts;
    carillon_body_facts_init(&facts);
    check(carillon_bank_get_facts(bank, &facts));
    btVector3 half(0, 0, 0);
    const double* x = carillon_bank_vertices_m(bank);
    for (int32_t v = 0; v < 3 * carillon_bank_vertex_count(bank); ++v) half[v % 3] = std::max(half[v % 3], btScalar(std::abs(x[v])));
    shape = std::make_unique<btBoxShape>(half);
    const double* i = facts.inertia_kg_m2;
    const btRigidBody::btRigidBodyConstructionInfo of_box(btScalar(facts.mass_kg), nullptr, shape.get(),
                                                          btVector3(btScalar(i[0]), btScalar(i[4]), btScalar(i[8])));
    add(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &plane));
    const btScalar apart = btScalar(2.4) * half.length();
    for (int n = 0; n < boxes; ++n) {
      btRigidBody::btRigidBodyConstructionInfo info = of_box;
      const btVector3 turns(btScalar(0.3 * n), btScalar(0.5 * n), btScalar(0.7 * n));
      info.m_startWorldTransform = btTransform(btQuaternion(turns[2], turns[1], turns[0]),
                                               btVector3(btScalar(n % 4 * 0.5), btScalar(n / 4 % 4 * 0.5), btScalar(1 + n / 16)) * apart);
      add(info);
    }
  }
  ~Heap() {
    for (const auto& body : bodies) world.removeRigidBody(body.get());
  }
  void add(btRigidBody::btRigidBodyConstructionInfo info) {
    info.m_restitution = info.m_friction = btScalar(0.7);
    bodies.push_back(std::make_unique<btRigidBody>(info));
    bodies.back()->setContactProcessingThreshold(0);
    world.addRigidBody(bodies.back().get());
  }

  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btStaticPlaneShape plane{btVector3(0, 0, 1), 0};
  std::unique_ptr<btBoxShape> shape;
  btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  std::vector<std::unique_ptr<btRigidBody>> bodies;  // the first is the floor
};

}  // namespace

// Between the adapter and the library (--wrap of the linker).
extern "C" {
carillon_status __real_carillon_touches_step(carillon_touches*, double, const carillon_pose*, int32_t, const carillon_point*, int32_t,
                                             char*, size_t);
carillon_status __wrap_carillon_touches_step(carillon_touches* touches, double time_s, const carillon_pose* poses, int32_t bodies,
                                             const carillon_point* points, int32_t count, char* text, size_t size) {
  static std::vector<carillon_point> given;
  given.assign(points, points + count);
  for (carillon_point& p : given)
    if (is_found) p.impulse_n_s = p.friction_n_s[0] = p.friction_n_s[1] = p.friction_n_s[2] = NAN;
  return __real_carillon_touches_step(touches, time_s, poses, bodies, given.data(), count, text, size);
}
}

int main(int argc, char** argv) {
  if (argc < 2) return std::fputs("usage: bench_touches BANK [HZ [BOXES [found]]]\n", stderr), 2;
  const double hz = argc > 2 ? std::atof(argv[2]) : 240.0;
  const int boxes = argc > 3 ? std::atoi(argv[3]) : 64;
  is_found = argc > 4 && std::strcmp(argv[4], "found") == 0;
  carillon_bank* bank = nullptr;
  check(carillon_bank_open(argv[1], &bank, message, sizeof message));
  carillon_touches_options options;
  carillon_touches_options_init(&options);
  long events = 0;
  options.sink = count_event;
  options.user = &events;
  carillon_touches* touches = nullptr;
  check(carillon_touches_create(nullptr, &options, &touches, message, sizeof message));
  Heap heap(bank, boxes);
  carillon::BulletTouches reader(heap.world, touches);
  for (int n = 0; n < boxes; ++n) {
    carillon_touches_body body;
    carillon_touches_body_init(&body);
    body.body = n;
    body.bank = bank;
    body.name_seed = static_cast<uint64_t>(n) + 1;
    int32_t index = 0;
    check(carillon_touches_add(touches, &body, &index, message, sizeof message));
    reader.add(*heap.bodies[static_cast<std::size_t>(n) + 1], index);
  }
  check(reader.start(0.0, message, sizeof message));
  double engine_s = 0.0, tracker_s = 0.0, worst_s = 0.0;
  long most = 0, before = 0;
  carillon_touches_counters seen;
  carillon_touches_counters_init(&seen);
  const int steps = static_cast<int>(kSeconds * hz + 0.5);
  for (int n = 1; n <= steps; ++n) {
    const double begin = get_thread_cpu_s();
    heap.world.stepSimulation(btScalar(1 / hz), 0);
    const double middle = get_thread_cpu_s();
    check(reader.step(n / hz, message, sizeof message));
    const double took = get_thread_cpu_s() - middle;
    engine_s += middle - begin;
    tracker_s += took;
    worst_s = std::max(worst_s, took);
    check(carillon_touches_get_counters(touches, &seen));
    most = std::max(most, static_cast<long>(seen.points) - before);
    before = static_cast<long>(seen.points);
  }
  std::printf(
      "{\"hz\": %g, \"boxes\": %d, \"mean_points\": %.1f, \"most_points\": %ld, \"hits\": %lld, \"events\": %ld, "
      "\"engine_cpu\": %.4f, \"tracker_cpu\": %.4f, \"ratio\": %.3g, \"worst_step_ms\": %.2f}\n",
      hz, boxes, static_cast<double>(seen.points) / steps, most, static_cast<long long>(seen.hits), events, engine_s / kSeconds,
      tracker_s / kSeconds, tracker_s / engine_s, 1e3 * worst_s);
  carillon_touches_destroy(touches);
  carillon_bank_close(bank);
  return most > 0 && seen.hits > 0 ? 0 : 1;
}
