// Cost of bodies without contact: one group each against one problem for all, in one run.
//
// usage: bench_islands [BOXES [SECONDS]]     prints CPU seconds a simulated second and their ratio, which no exit code judges. Exit 1 when
//                                            the bodies moved, summed over all steps, are not 2.5 times fewer with islands
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <limits>

#include "runtime/base/clock.hpp"
#include "runtime/physics/world.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace {

using namespace carillon;

physics::WorldSpec make_rain(const bank::Bank& box, int count) {
  physics::WorldSpec w;
  w.ground = physics::GroundSpec{};
  for (int i = 0; i < count; ++i) {
    physics::BodySpec b;
    b.name = fmt::format("box {}", i);
    b.bank = &box;
    b.initial.position_m = {0.3 * (i % 5), 0.3 * (i / 5), 0.3 + 0.02 * i};
    b.initial.rotation = {std::cos(0.1 + 0.07 * i), std::sin(0.1 + 0.07 * i) * 0.6, std::sin(0.1 + 0.07 * i) * 0.8, 0.0};
    b.angular_velocity_rad_s = {2.0, 0.3 * i, 0.0};
    w.bodies.push_back(b);
  }
  return w;
}

struct Cost : physics::Statistics {
  double seconds_cpu = 0.0;
};

Cost run(const physics::WorldSpec& spec, double end_s, bool islands) {
  physics::World world(spec, {.end_s = end_s, .islands = islands});
  const double began_s = base::get_thread_cpu_s();
  world.advance(end_s, std::numeric_limits<double>::infinity(), [](const events::Event&) {});
  return {world.get_statistics(), base::get_thread_cpu_s() - began_s};
}

}  // namespace

int main(int argc, char** argv) {
  const int boxes = argc > 1 ? std::atoi(argv[1]) : 20;
  const double end_s = argc > 2 ? std::atof(argv[2]) : 2.0;
  const bank::Bank box = physics::tests::make_box({0.06, 0.05, 0.04}, {4, 4, 4});
  const physics::WorldSpec spec = make_rain(box, boxes);
  const Cost together = run(spec, end_s, false), apart = run(spec, end_s, true);
  const auto print = [&](const char* name, const Cost& cost) {
    fmt::print("{:<11} {:8.3f} CPU s/s  {:8} steps  {:8} steps of a body  {} searches\n", name, cost.seconds_cpu / end_s, cost.steps,
               cost.body_steps, cost.searches);
  };
  fmt::print("{} boxes dropped 0.3 m apart, {:g} s\n", boxes, end_s);
  print("one problem", together);
  print("islands", apart);
  fmt::print("ratio       {:8.2f} of CPU, {:.2f} of steps of a body\n", together.seconds_cpu / apart.seconds_cpu,
             static_cast<double>(together.body_steps) / static_cast<double>(apart.body_steps));
  return 2 * together.body_steps >= 5 * apart.body_steps ? 0 : 1;
}
