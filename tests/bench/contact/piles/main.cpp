// Cost of bodies in contact: a scene in physics::World or in Bullet from the same start.
//
// usage: bench_piles SCENE carillon|bullet SECONDS [TRIANGLES]
//          prints one line of JSON: CPU seconds (clock of the thread) for a second of the scene, the worst 100 ms and the worst 2 ms of it,
//          when all slept [s]
//        bench_piles steps
//          prints the cost of the longest step, and the errors of two motions
//   SCENE: pile10 pile20 pile50 heap bars stack dominoes ball coin bottle pen cards bunnies2 bunnies3
//   TRIANGLES: of a box of a pile; 12, 512 or 8384
#include <BulletCollision/Gimpact/btGImpactCollisionAlgorithm.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>
#include <btBulletDynamicsCommon.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/physics/world.hpp"
#include "tests/unit/runtime/physics/geometry/solids.hpp"
#include "tests/unit/runtime/physics/leaning_train.hpp"
#include "tests/unit/runtime/physics/rigid/drops.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace {

using namespace carillon;
using carillon::Vec3;

constexpr double kSlice = 2e-3;  // s
constexpr int kBulletSteps = 4;  // of a slice: 2 kHz
constexpr double kFriction = 0.4, kRestitution = 0.3;
constexpr int kRim = 96;                                               // corners of a coin
constexpr const char* kBunny = "/usr/share/glmark2/models/bunny.obj";  // the Stanford bunny of Debian's glmark2-data, 69,666 triangles

/// A flat cylinder about z.
bank::Bank make_coin(double radius_m, double thickness_m) {
  bank::Bank coin;
  coin.material = {200e9, 0.3, 7800.0, 1e-7, 1.0};
  for (const double z : {-0.5 * thickness_m, 0.5 * thickness_m}) {
    for (int i = 0; i < kRim; ++i)
      coin.vertices_m.push_back({radius_m * std::cos(2 * M_PI * i / kRim), radius_m * std::sin(2 * M_PI * i / kRim), z});
    coin.vertices_m.push_back({0, 0, z});
  }
  const int below = kRim, above = 2 * kRim + 1;
  for (int i = 0; i < kRim; ++i) {
    const int j = (i + 1) % kRim, up = kRim + 1;
    coin.triangles.push_back({below, j, i});
    coin.triangles.push_back({above, up + i, up + j});
    coin.triangles.push_back({i, j, up + j});
    coin.triangles.push_back({i, up + j, up + i});
  }
  physics::tests::set_rigid_of_solid(coin);
  return coin;
}

bank::Bank make_ceramic(bank::Bank bank) {
  bank.material = physics::tests::ceramic();
  physics::tests::set_rigid_of_solid(bank);
  return bank;
}

bank::Bank make_bank(const geometry::tests::Solid& solid) {
  bank::Bank bank;
  bank.vertices_m.assign(solid.vertices.begin(), solid.vertices.end());
  bank.triangles.assign(solid.triangles.begin(), solid.triangles.end());
  return make_ceramic(std::move(bank));
}

/// A full bottle: body, shoulder and neck about z.
bank::Bank make_bottle(double radius_m) {
  std::vector<std::array<double, 2>> outline{{0, 0}, {radius_m, 0}};
  for (int i = 1; i <= 48; ++i) {
    const double z = 0.005 * i, s = std::clamp((z - 0.14) / 0.05, 0.0, 1.0);
    outline.push_back({0.013 + (radius_m - 0.013) * 0.5 * (1.0 + std::cos(M_PI * s)), z});
  }
  outline.push_back({0, 0.24});
  return make_bank(geometry::tests::make_lathe(outline, 48, false));
}

/// Solid, standing on z = 0, y up in the file.
bank::Bank make_bunny(double height_m) {
  std::ifstream file(kBunny);
  if (!file) throw std::runtime_error(fmt::format("{}: not there; install Debian's glmark2-data", kBunny));
  bank::Bank bunny;
  Vec3 low{1e9, 1e9, 1e9}, high{-1e9, -1e9, -1e9};
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      double x = 0.0, y = 0.0, z = 0.0;
      words >> x >> y >> z;
      bunny.vertices_m.push_back({x, -z, y});
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], bunny.vertices_m.back()[k]);
        high[k] = std::max(high[k], bunny.vertices_m.back()[k]);
      }
    } else if (kind == "f") {
      std::array<std::int32_t, 3> triangle{};
      for (std::int32_t& corner : triangle) {
        std::string word;
        words >> word;
        corner = std::stoi(word) - 1;
      }
      bunny.triangles.push_back(triangle);
    }
  }
  const double scale = height_m / (high[2] - low[2]);
  for (Vec3& x : bunny.vertices_m)
    x = {scale * (x[0] - 0.5 * (low[0] + high[0])), scale * (x[1] - 0.5 * (low[1] + high[1])), scale * (x[2] - low[2])};
  return make_ceramic(std::move(bunny));
}

/// Bodies of few kinds.
struct Scene {
  std::vector<std::unique_ptr<bank::Bank>> banks;
  physics::WorldSpec spec;
  double ball_radius_m = 0.0;          // where the body is one; Bullet has a shape for it
  std::set<const bank::Bank*> hollow;  // not convex

  const bank::Bank* keep(bank::Bank bank) { return banks.emplace_back(std::make_unique<bank::Bank>(std::move(bank))).get(); }
  physics::BodySpec& add(const bank::Bank* bank, const Vec3& position) {
    physics::BodySpec body;
    body.name = fmt::format("body {}", spec.bodies.size());
    body.bank = bank;
    body.initial.position_m = position;
    body.restitution = kRestitution;
    body.friction = kFriction;
    spec.bodies.push_back(body);
    return spec.bodies.back();
  }
};

bank::Bank make_wood(const Vec3& size_m, std::array<int, 3> cells = {1, 1, 1}) {
  bank::Bank box = physics::tests::make_box(size_m, cells);
  box.material = {10e9, 0.3, 600.0, 1e-6, 20.0};
  physics::tests::set_rigid_of_solid(box);
  return box;
}

Scene make_scene(const std::string& name, int triangles) {
  Scene scene;
  scene.spec.ground = physics::GroundSpec{.restitution = kRestitution, .friction = kFriction};
  const auto turn = [](physics::BodySpec& body, double angle, const Vec3& axis) {
    const double s = std::sin(0.5 * angle);
    body.initial.rotation = {std::cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2]};
  };
  if (name.starts_with("pile")) {
    const std::array<int, 3> cells = triangles == 12    ? std::array{1, 1, 1}
                                     : triangles == 512 ? std::array{8, 8, 4}
                                                        : std::array{32, 28, 20};
    const bank::Bank* box = scene.keep(make_wood({0.06, 0.05, 0.04}, cells));
    if (static_cast<int>(box->triangles.size()) != triangles) throw std::runtime_error("boxes have 12, 512 or 8384 triangles");
    const int count = std::atoi(name.c_str() + 4);
    for (int i = 0; i < count; ++i) {
      // From a grid of two by two, layer above layer, each turned.
      physics::BodySpec& body = scene.add(box, {0.045 * (i % 2 ? 1 : -1), 0.045 * (i / 2 % 2 ? 1 : -1), 0.06 + 0.09 * (i / 4)});
      turn(body, 0.3 + 0.7 * i, {0.6, 0.0, 0.8});
    }
  } else if (name == "heap") {
    std::vector<const bank::Bank*> kinds;  // coin, ring, bowl, rod
    for (const int body : {1, 2, 6, 3}) kinds.push_back(scene.keep(make_bank(rigid::tests::make_drop_surface(body))));
    scene.hollow = {kinds[1], kinds[2]};
    for (int i = 0; i < 12; ++i) {
      physics::BodySpec& body = scene.add(kinds[(i + i / 4) % 4], {0.03 * (i % 2 ? 1 : -1), 0.03 * (i / 2 % 2 ? 1 : -1), 0.12 + 0.17 * i});
      turn(body, 0.3 + 0.7 * i, {0.6, 0.0, 0.8});
    }
  } else if (name == "bars") {
    const bank::Bank* bar = scene.keep(make_wood({0.2, 0.02, 0.02}));
    for (int i = 0; i < 200; ++i) {
      physics::BodySpec& body = scene.add(bar, {0.3 * (i % 20), 0.3 * (i / 20), 0.3 + 0.002 * i});
      turn(body, 0.2 + 0.05 * i, {0.0, 0.6, 0.8});
    }
  } else if (name == "stack") {
    const bank::Bank* block = scene.keep(make_wood({0.05, 0.05, 0.05}));
    for (int i = 0; i < 10; ++i) scene.add(block, {0, 0, 0.025 + 0.05 * i});
  } else if (name == "dominoes") {
    const bank::Bank* stone = scene.keep(make_wood({0.0075, 0.024, 0.048}));
    for (int i = 0; i < 50; ++i) scene.add(stone, {0.022 * i, 0, 0.024});
    turn(scene.spec.bodies.front(), 0.18, {0, 1, 0});  // past its balance, on its lower edge
    const double a = 0.18, x = 0.5 * 0.0075, z = 0.024;
    scene.spec.bodies.front().initial.position_m = {x - x * std::cos(a) + z * std::sin(a), 0, x * std::sin(a) + z * std::cos(a)};
  } else if (name == "ball") {
    scene.ball_radius_m = 0.03;
    physics::BodySpec& body = scene.add(scene.keep(physics::tests::make_ball(0.03, 4)), {0, 0, 0.03});
    body.velocity_m_s = {1.0, 0, 0};
    body.angular_velocity_rad_s = {0, 1.0 / 0.03, 0};
  } else if (name == "coin") {
    // About its centre, which rests: tests/unit/runtime/physics/known_motions_test.cpp.
    const double radius = 0.012, e = 0.0009, a = 0.5, s = std::sin(a), c = std::cos(a);
    const bank::Bank* coin = scene.keep(make_coin(radius, 2 * e));
    physics::BodySpec& body = scene.add(coin, {0, 0, radius * s + e * c});
    turn(body, a, {1, 0, 0});
    const double across = coin->rigid.inertia_kg_m2[0] / coin->rigid.mass_kg, along = coin->rigid.inertia_kg_m2[8] / coin->rigid.mass_kg;
    const double rate = std::sqrt(9.81 * (radius * c - e * s) / (s * (across * c - along * e / radius * s)));
    body.angular_velocity_rad_s = {0, -rate * s * (-c + e / radius * s), -rate * s * (-s - e / radius * c)};
  } else if (name == "bottle") {
    const double radius = 0.035, q = std::sqrt(0.5);
    const bank::Bank* bottle = scene.keep(make_bottle(radius));
    physics::BodySpec& body = scene.add(bottle, {0, 0, radius});
    body.initial.rotation = {q, q, 0, 0};
    body.velocity_m_s = {1.0, 0, 0};
    body.angular_velocity_rad_s = {0, 1.0 / radius, 0};
  } else if (name == "pen") {
    // Down a slope of 5 degrees.
    const double a = 5.0 * M_PI / 180.0, radius = 0.0045, q = std::sqrt(0.5);
    physics::BodySpec& body = scene.add(scene.keep(make_bank(rigid::tests::make_drop_surface(4))), {0, 0, radius});
    body.initial.rotation = {q, q, 0, 0};
    scene.spec.gravity_m_s2 = {9.81 * std::sin(a), 0, -9.81 * std::cos(a)};
  } else if (name == "cards") {
    // Three storeys of cards of 88 x 63 x 0.3 mm that lean by 20 degrees.
    bank::Bank paper = physics::tests::make_box({0.0003, 0.063, 0.088});
    paper.material = {3e9, 0.3, 900.0, 1e-6, 50.0};
    physics::tests::set_rigid_of_solid(paper);
    const bank::Bank* card = scene.keep(std::move(paper));
    const double lean = 20.0 * M_PI / 180.0, c = std::cos(lean), s = std::sin(lean);
    const double half = 0.5 * (0.088 * c + 0.0003 * s), side = 0.5 * (0.088 * s + 0.0003 * c), pitch = 4.0 * side;
    double below = 0.0;
    for (int frames = 3; frames > 0; --frames) {
      const double first = -0.5 * (frames - 1) * pitch;
      for (int i = 0; i < frames; ++i)
        for (const int way : {-1, 1}) turn(scene.add(card, {first + pitch * i + way * side, 0, below + half}), -way * lean, {0, 1, 0});
      below += 2.0 * half;
      for (int i = 0; i + 1 < frames; ++i) turn(scene.add(card, {first + pitch * (i + 0.5), 0, below + 0.00015}), 0.5 * M_PI, {0, 1, 0});
      below += 0.0003;
    }
    scene.spec.ground->friction = 0.5;
    for (physics::BodySpec& body : scene.spec.bodies) body.friction = 0.5;
  } else if (name.starts_with("bunnies")) {
    const bank::Bank* bunny = scene.keep(make_bunny(0.13));
    for (int i = 0; i < std::atoi(name.c_str() + 7); ++i)
      turn(scene.add(bunny, {0.01 * i, 0.005 * i, 0.02 + 0.16 * i}), 1.3 * i, {0, 0, 1});
  } else {
    throw std::runtime_error("no such scene: " + name);
  }
  return scene;
}

struct Cost {
  double cpu_s = 0.0, worst_100_ms = 0.0, worst_2_ms = 0.0;
  double last_awake_s = 0.0;
  long hits = 0;
};

/// `advance(t)` goes to t and says whether anything is awake.
template <class Advance>
Cost measure(double end_s, Advance&& advance) {
  Cost cost;
  std::vector<double> slices;
  for (int n = 1; n <= static_cast<int>(std::lround(end_s / kSlice)); ++n) {
    const double begin = base::get_thread_cpu_s();
    const bool awake = advance(n * kSlice);
    slices.push_back(base::get_thread_cpu_s() - begin);
    if (awake) cost.last_awake_s = n * kSlice;
  }
  double sum = 0.0;
  for (std::size_t n = 0; n < slices.size(); ++n) {
    cost.cpu_s += slices[n];
    sum += slices[n] - (n >= 50 ? slices[n - 50] : 0.0);
    cost.worst_100_ms = std::max(cost.worst_100_ms, sum);
    cost.worst_2_ms = std::max(cost.worst_2_ms, slices[n]);
  }
  return cost;
}

Cost run_ours(const Scene& scene, double end_s) {
  physics::World world(scene.spec, {.end_s = end_s});
  long hits = 0;
  std::int64_t steps = 0;
  Cost cost = measure(end_s, [&](double until_s) {
    world.advance(until_s, std::numeric_limits<double>::infinity(),
                  [&](const events::Event& event) { hits += std::holds_alternative<events::Impulse>(event); });
    // Where all sleeps no step is made.
    return std::exchange(steps, world.get_statistics().steps) != steps;
  });
  cost.hits = hits;
  return cost;
}

btVector3 to_bullet(const Vec3& x) { return {btScalar(x[0]), btScalar(x[1]), btScalar(x[2])}; }

Cost run_bullet(const Scene& scene, double end_s) {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
  world.setGravity(to_bullet(scene.spec.gravity_m_s2));
  btStaticPlaneShape floor({0, 0, 1}, 0);
  btRigidBody::btRigidBodyConstructionInfo ground_info(0, nullptr, &floor);
  ground_info.m_restitution = btScalar(kRestitution);
  ground_info.m_friction = btScalar(kFriction);
  btRigidBody ground(ground_info);
  world.addRigidBody(&ground);
  btGImpactCollisionAlgorithm::registerAlgorithm(&dispatcher);
  std::vector<std::unique_ptr<btTriangleMesh>> meshes;
  std::map<const bank::Bank*, std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> bodies;
  for (const physics::BodySpec& spec : scene.spec.bodies) {
    std::unique_ptr<btCollisionShape>& shape = shapes[spec.bank];
    if (!shape && scene.ball_radius_m > 0.0) shape = std::make_unique<btSphereShape>(btScalar(scene.ball_radius_m));
    if (!shape && scene.hollow.contains(spec.bank)) {
      auto& mesh = meshes.emplace_back(std::make_unique<btTriangleMesh>());
      const auto get = [&](std::int32_t vertex) { return to_bullet(spec.bank->vertices_m[vertex]); };
      for (const auto& t : spec.bank->triangles) mesh->addTriangle(get(t[0]), get(t[1]), get(t[2]));
      auto triangles = std::make_unique<btGImpactMeshShape>(mesh.get());
      triangles->setMargin(btScalar(0.0005));
      triangles->updateBound();
      shape = std::move(triangles);
    }
    if (!shape) {
      auto hull = std::make_unique<btConvexHullShape>();
      for (const Vec3& x : spec.bank->vertices_m) hull->addPoint(to_bullet(x), false);
      hull->recalcLocalAabb();
      hull->optimizeConvexHull();
      hull->setMargin(btScalar(0.0005));
      shape = std::move(hull);
    }
    const auto& i = spec.bank->rigid.inertia_kg_m2;
    btRigidBody::btRigidBodyConstructionInfo info(btScalar(spec.bank->rigid.mass_kg), nullptr, shape.get(), to_bullet({i[0], i[4], i[8]}));
    info.m_restitution = btScalar(spec.restitution);
    info.m_friction = btScalar(spec.friction);
    const auto& q = spec.initial.rotation;
    info.m_startWorldTransform =
        btTransform(btQuaternion(btScalar(q[1]), btScalar(q[2]), btScalar(q[3]), btScalar(q[0])), to_bullet(spec.initial.position_m));
    auto body = std::make_unique<btRigidBody>(info);
    body->setLinearVelocity(to_bullet(spec.velocity_m_s));
    body->setAngularVelocity(to_bullet(spec.angular_velocity_rad_s));
    world.addRigidBody(body.get());
    bodies.push_back(std::move(body));
  }
  const Cost cost = measure(end_s, [&](double) {
    for (int n = 0; n < kBulletSteps; ++n) world.stepSimulation(btScalar(kSlice / kBulletSteps), 0);
    return std::any_of(bodies.begin(), bodies.end(), [](const auto& body) { return body->isActive(); });
  });
  for (auto& body : bodies) world.removeRigidBody(body.get());
  world.removeRigidBody(&ground);
  return cost;
}

/// Where each body is on the way, every 2 ms.
std::vector<std::vector<events::BodyMotion>> follow(const physics::WorldSpec& spec, double end_s, double step_s, double& cpu_s_per_s) {
  physics::World world(spec, {.contact_step_s = step_s, .end_s = end_s});
  std::vector<std::vector<events::BodyMotion>> motions(spec.bodies.size());
  const double begin = base::get_thread_cpu_s();
  world.advance(end_s, std::numeric_limits<double>::infinity(), [&](const events::Event& event) {
    if (const auto* motion = std::get_if<events::BodyMotion>(&event)) motions[motion->body].push_back(*motion);
  });
  cpu_s_per_s = (base::get_thread_cpu_s() - begin) / end_s;
  return motions;
}

/// The error of the speed of the wave in a row of dominoes without friction between them, stones 15 to 25.
double calc_domino_error(double step_s, double& cpu_s_per_s) {
  Scene row;
  row.spec.ground = physics::GroundSpec{.restitution = 0.0, .friction = 5e4};  // with that of the stones: 5 at their feet
  const bank::Bank* stone = row.keep(make_wood({0.0075, 0.024, 0.048}));
  const double pitch = 0.0171, push = 6.0;
  const std::vector<double> expected = physics::tests::LeaningTrain(0.048, 0.0075, 0.0096, 0.0).calc_starts(28, push);
  for (int i = 0; i < 28; ++i) {
    physics::BodySpec& body = row.add(stone, {pitch * i, 0, 0.024});
    body.friction = 5e-4;
    body.restitution = 0.0;
  }
  row.spec.bodies[0].angular_velocity_rad_s = {0, push, 0};
  row.spec.bodies[0].velocity_m_s = {push * 0.024, 0, push * 0.5 * 0.0075};
  const auto motions = follow(row.spec, 1.0, step_s, cpu_s_per_s);
  const auto find_start = [&](std::size_t i) {
    const auto found = std::find_if(motions[i].begin(), motions[i].end(), [](const auto& m) { return m.velocity_m_s[0] > 0.02; });
    return found == motions[i].end() ? 0.0 : found->time_s;
  };
  return (expected[25] - expected[15]) / (find_start(25) - find_start(15)) - 1.0;
}

/// The error of the acceleration of a ball that rolls down 3 degrees: 5/7 g (sin a - c cos a).
double calc_rolling_error(double step_s, double& cpu_s_per_s) {
  const double a = 3.0 * M_PI / 180.0, radius = 0.03, c = 1e-3;
  Scene slope;
  const bank::Bank *ball = slope.keep(physics::tests::make_ball(radius, 4)), *plane = slope.keep(make_wood({4.0, 0.4, 0.04}));
  const double along = -1.9, above = radius + 0.02;
  slope.add(ball, {along * std::cos(a) + above * std::sin(a), 0, -along * std::sin(a) + above * std::cos(a)});
  physics::BodySpec& fixed = slope.add(plane, {});
  fixed.fixed = true;
  fixed.initial.rotation = {std::cos(a / 2), 0, std::sin(a / 2), 0};
  const auto path = follow(slope.spec, 1.2, step_s, cpu_s_per_s)[0];
  const auto get_speed = [&](double time_s) {
    const auto at = std::find_if(path.begin(), path.end(), [&](const auto& m) { return m.time_s > time_s - 1e-6; });
    return at->velocity_m_s[0] * std::cos(a) - at->velocity_m_s[2] * std::sin(a);
  };
  return (get_speed(1.1) - get_speed(0.1)) / (5.0 / 7.0 * 9.81 * (std::sin(a) - c * std::cos(a))) - 1.0;
}

void print_steps() {
  fmt::print("| longest step, ms | wave of dominoes: error | CPU s/s | ball down 3 degrees: error | CPU s/s |\n|--:|--:|--:|--:|--:|\n");
  for (const double step_s : {2e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5}) {
    double row_cpu = 0.0, ball_cpu = 0.0;
    const double row = calc_domino_error(step_s, row_cpu), ball = calc_rolling_error(step_s, ball_cpu);
    fmt::print("| {:g} | {:+.2f} % | {:.2f} | {:+.2f} % | {:.3f} |\n", 1e3 * step_s, 100 * row, row_cpu, 100 * ball, ball_cpu);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::string(argv[1]) == "steps") {
    print_steps();
    return 0;
  }
  if (argc != 4 && argc != 5) {
    std::fputs("usage: bench_piles SCENE carillon|bullet SECONDS [TRIANGLES]\n", stderr);
    return 2;
  }
  try {
    const std::string engine = argv[2];
    const double end_s = std::atof(argv[3]);
    const double begin = base::get_thread_cpu_s();
    const Scene scene = make_scene(argv[1], argc == 5 ? std::atoi(argv[4]) : 12);
    const double made = base::get_thread_cpu_s() - begin;
    const Cost cost = engine == "bullet" ? run_bullet(scene, end_s) : run_ours(scene, end_s);
    fmt::print(
        R"({{"scene": "{}", "engine": "{}", "triangles": {}, "made_s": {:.6f}, "cpu_s_per_s": {:.6f}, "worst_100_ms": {:.6f}, "worst_2_ms": {:.6f}, "awake_until_s": {:.3f}, "hits": {}}})"
        "\n",
        argv[1], engine, scene.banks.front()->triangles.size(), made, cost.cpu_s / end_s, cost.worst_100_ms, cost.worst_2_ms,
        cost.last_awake_s, cost.hits);
  } catch (const std::exception& error) {
    fmt::print(stderr, "bench_piles: {}\n", error.what());
    return 1;
  }
  return 0;
}
