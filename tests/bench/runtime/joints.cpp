// Cost of the free motion of mechanisms, and effect of the integration tolerance; the table of docs/decisions/joints.md.
//
// usage: bench_joints [--quick]     chains of links let go out of the horizontal, in windows of 2 ms; the error is that of the last link
//                                   against a tolerance of 1e-13. Exit 1 when a tolerance of 1e-10 is off by more than 1 um after 0.5 s
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>

#include "runtime/physics/joints/mechanism.hpp"

namespace {

using namespace carillon;
using carillon::operator-;

double get_cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::unique_ptr<joints::Mechanism> make_chain(int links) {
  std::vector<joints::Member> members;
  std::vector<joints::Joint> joints;
  const double length = 0.6 / links, mass = 0.3 / links;
  for (int i = 0; i < links; ++i) {
    joints::Member m;
    m.mass_kg = mass;
    const double across = mass * length * length / 12.0;
    m.inertia_kg_m2 = {carillon::Vec3{0.1 * across, 0, 0}, carillon::Vec3{0, across, 0}, carillon::Vec3{0, 0, across}};
    m.start.centre = {length * (i + 0.5), 0, 0};
    members.push_back(m);
    joints.push_back({.kind = joints::Kind::kHinge, .body = i, .to = i - 1, .at = {length * i, 0, 0}, .axis = {0, 1, 0}});
  }
  return joints::make_mechanism(members, joints, {0, 0, -9.81});
}

struct Run {
  carillon::Vec3 end{};
  double cpu_s = 0.0;
};

Run run(int links, double tolerance, double seconds) {
  const auto mechanism = make_chain(links);
  joints::Coordinates now = mechanism->get_start();
  std::vector<joints::Motion> motions;
  const double begun = get_cpu_s();
  const int windows = static_cast<int>(std::lround(seconds / 2e-3));
  for (int n = 0; n < windows; ++n) {
    now = mechanism->fly(now, 2e-3, tolerance);
    mechanism->find_motions(now, motions);
  }
  return {motions.back().centre, (get_cpu_s() - begun) / seconds};
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  const auto begun = std::chrono::steady_clock::now();
  (void)make_chain(1);
  fmt::print("first mechanism: {:.1f} ms, with the engine's loading\n\n",
             1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
  fmt::print("| links | tolerance | error after 0.5 s, m | CPU s/s |\n|--:|--:|--:|--:|\n");
  bool right = true;
  for (const int links : quick ? std::vector<int>{2} : std::vector<int>{1, 2, 20}) {
    const carillon::Vec3 exact = run(links, 1e-13, 0.5).end;
    for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10, 1e-12}) {
      const Run one = run(links, tolerance, 0.5);
      const carillon::Vec3 off = one.end - exact;
      const double error = std::sqrt(carillon::dot(off, off));
      fmt::print("| {} | {:.0e} | {:.1e} | {:.3f} |\n", links, tolerance, error, one.cpu_s);
      std::fflush(stdout);
      if (tolerance == 1e-10 && links <= 2 && error > 1e-6) right = false;
    }
  }
  return right ? 0 : 1;
}
