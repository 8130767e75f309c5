// Cost of a small physics step of a body, by kind of motion.
//
// usage: bench_body_steps [SECONDS]     prints a table of docs/reports/effects.md: CPU time of the thread per second of the scene, steps of
//                                       bodies, microseconds per step
#include <fmt/format.h>

#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "runtime/base/clock.hpp"
#include "tests/hard/contact_course.hpp"

namespace {

using namespace carillon;
using namespace carillon::hard;

void print_row(const std::string& what, const WorldSpec& spec, double seconds) {
  std::vector<double> costs;
  physics::Statistics cost;
  for (int round = 0; round < 5; ++round) {
    World world(spec, {.end_s = seconds});
    const double begin = base::get_thread_cpu_s();
    world.advance(seconds, std::numeric_limits<double>::infinity(), [](const events::Event&) {});
    costs.push_back(base::get_thread_cpu_s() - begin);
    cost = world.get_statistics();
  }
  std::sort(costs.begin(), costs.end());
  const double steps = static_cast<double>(cost.body_steps);
  fmt::print("| {} | {} | {:.2f} | {:.0f} | {:.1f} |\n", what, spec.bodies.size(), 1e3 * costs[2] / seconds, steps / seconds,
             steps > 0.0 ? 1e6 * costs[2] / steps : 0.0);
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 1.0;
  const bank::Bank box = make_dense_box({0.06, 0.05, 0.04}, 600.0), ball = make_round(0.02, 6);
  const auto make = [](bool has_ground) {
    WorldSpec spec;
    if (has_ground) spec.ground = GroundSpec{};
    return spec;
  };
  fmt::print("| what | bodies | CPU, ms/s | steps of a body, 1/s | us a step |\n|---|--:|--:|--:|--:|\n");
  WorldSpec spec = make(false);
  spec.bodies = {make_body(box, {})};
  spec.bodies[0].angular_velocity_rad_s = {3, 2, 1};
  print_row("a box flies", spec, seconds);
  spec = make(true);
  spec.bodies = {make_body(box, {0, 0, 0.02})};
  print_row("a box lies", spec, seconds);
  spec.bodies[0].friction = 0.0;
  spec.bodies[0].velocity_m_s = {1, 0, 0};
  print_row("a box slides", spec, seconds);
  spec = make(true);
  spec.bodies = {make_body(ball, {0, 0, 0.02})};
  spec.bodies[0].velocity_m_s = {1, 0, 0};
  spec.bodies[0].angular_velocity_rad_s = {0, 50, 0};
  print_row("a ball of 720 triangles rolls", spec, seconds);
  spec = make(true);
  for (int i = 0; i < 10; ++i) {
    spec.bodies.push_back(make_body(box, {0.1 * i, 0, 0.3}));
    spec.bodies.back().initial.rotation = {1.0, 0.3 * i, 0.2, 0.1 * i};
  }
  print_row("ten boxes fall next to each other", spec, seconds);
  spec = make(true);
  for (int i = 0; i < 10; ++i) {
    spec.bodies.push_back(make_body(box, {0.02 * (i % 3), 0.02 * (i % 2), 0.06 + 0.09 * i}));
    spec.bodies.back().initial.rotation = {1.0, 0.3 * i, 0.2, 0.1 * i};
  }
  print_row("ten boxes fall on each other", spec, seconds);
}
