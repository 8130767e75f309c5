// Cost of a touch search [us].
//
// usage: bench_shape [--quick]
#include <cstdio>
#include <cstring>
#include <string>

#include "runtime/base/clock.hpp"
#include "tests/unit/runtime/physics/geometry/solids.hpp"

namespace carillon::geometry::tests {
namespace {

bool quick = false;

/// The least mean of several rounds [us].
template <class Work>
double time_us(Work&& work, int repeats = 200) {
  const int rounds = quick ? 1 : 7;
  double min = 1e300;
  for (int round = 0; round < rounds; ++round) {
    const double begin = 1e6 * base::get_thread_cpu_s();
    for (int i = 0; i < repeats; ++i) work(i);
    min = std::min(min, (1e6 * base::get_thread_cpu_s() - begin) / repeats);
  }
  return min;
}

/// Searches between b and a, which moves sideways by `step` a query: again and again from memory, or from nothing.
void report(const char* name, const Shape& a, Frame fa, const Shape& b, const Frame& fb, double margin, double step) {
  PairMemory memory;
  std::vector<Touch> out;
  find_touches(a, fa, b, fb, margin, memory, out);
  const Frame start = fa;
  const double again = time_us([&](int i) {
    fa.position_m[0] = start.position_m[0] + step * (i % 2);
    find_touches(a, fa, b, fb, margin, memory, out);
  });
  const double fresh = time_us([&](int i) {
    fa.position_m[0] = start.position_m[0] + step * (i % 2);
    memory.known = false;
    find_touches(a, fa, b, fb, margin, memory, out);
  });
  std::vector<Touch> touches = out;
  const double moved = time_us([&](int) {
    for (Touch& t : touches) refresh(t, a, fa, &b, fb);
  });
  std::printf("%-44s %8.2f %8.2f %8.2f %6zu\n", name, again, fresh, touches.empty() ? 0.0 : moved / static_cast<double>(touches.size()),
              touches.size());
}

void report_ground(const char* name, const Shape& a, const Frame& fa, double margin) {
  PairMemory memory;
  std::vector<Touch> out;
  const double again = time_us([&](int) { find_ground_touches(a, fa, 0.0, margin, memory, out); });
  const double fresh = time_us([&](int) {
    memory.known = false;
    find_ground_touches(a, fa, 0.0, margin, memory, out);
  });
  std::vector<Touch> touches = out;
  const double moved = time_us([&](int) {
    for (Touch& t : touches) refresh(t, a, fa, nullptr, {});
  });
  std::printf("%-44s %8.2f %8.2f %8.2f %6zu\n", name, again, fresh, touches.empty() ? 0.0 : moved / static_cast<double>(touches.size()),
              touches.size());
}

/// Cost of creating a shape and its search structures [ms].
void report_making(const char* name, const Solid& solid) {
  const double begin = 1e6 * base::get_thread_cpu_s();
  const auto shape = solid.make();
  const double made = 1e6 * base::get_thread_cpu_s();
  shape->prepare();
  const double end = 1e6 * base::get_thread_cpu_s();
  std::printf("%-44s %8.1f %8.1f %8zu\n", name, 1e-3 * (made - begin), 1e-3 * (end - made), solid.triangles.size());
}

int run(int argc, char** argv) {
  quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  std::printf("%-44s %8s %8s %8s %6s\n", "us a query", "again", "fresh", "refresh", "points");
  Frame fa, fb;
  const auto box = make_box({0.06, 0.05, 0.04}, 1).make(), fine_box = make_box({0.06, 0.05, 0.04}, 26).make();
  fa.rotation = make_turn({0, 0, 1}, 0.3);
  fa.position_m = {0.01, 0.01, 0.04};
  report("box flush on box", *box, fa, *box, fb, 1e-3, 1e-5);
  report("the same, 8,112 triangles each", *fine_box, fa, *fine_box, fb, 1e-3, 1e-5);
  const auto beam = make_box({0.2, 0.02, 0.02}, 1).make();
  Frame bar;
  fb.rotation = make_turn({1, 0, 0}, std::numbers::pi / 4);
  bar.rotation = multiply(make_turn({0, 0, 1}, 1.0), fb.rotation);
  bar.position_m = {0, 0, 0.02 * std::sqrt(2.0)};
  report("edge across edge", *beam, bar, *beam, fb, 1e-3, 1e-5);
  fb = {};
  fa.position_m = {0.01, 0.01, 0.0415};
  report("boxes 1.5 mm apart, margin 1 mm", *box, fa, *box, fb, 1e-3, 1e-5);

  Frame on;
  on.position_m[2] = 0.02;
  report_ground("box on the ground", *box, on, 1e-3);
  const auto ball = make_ball(0.03, 16).make(), coarse_ball = make_ball(0.03, 6).make();
  on.position_m[2] = 0.03;
  report_ground("ball of 720 triangles on the ground", *coarse_ball, on, 1e-3);
  report_ground("ball of 5,120 triangles on the ground", *ball, on, 1e-3);
  const auto slab = make_box({0.2, 0.2, 0.02}, 1).make();
  Frame above;
  above.position_m = {0.01, 0.02, 0.04};
  report("ball of 5,120 triangles on a slab", *ball, above, *slab, fb, 1e-3, 1e-5);
  above.position_m = {0, 0.01, 0.059};
  report("ball on ball, 5,120 triangles each", *ball, above, *ball, fb, 1e-3, 1e-5);
  const auto rod = make_cylinder(0.01, 0.1, 48).make();
  Frame lying, across;
  lying.rotation = make_turn({1, 0, 0}, std::numbers::pi / 2);
  across.rotation = make_turn({0, 1, 0}, std::numbers::pi / 2);
  across.position_m = {0.003, 0.004, 0.02};
  report("rod across rod", *rod, across, *rod, lying, 1e-3, 1e-5);
  above = {};
  above.position_m[2] = 0.06;
  report("rod that stands on a slab", *rod, above, *slab, fb, 1e-3, 1e-5);

  std::printf("\n%-44s %8s %8s %8s %6s\n", "lumpy ball on lumpy ball, triangles each", "again", "fresh", "refresh", "points");
  for (const int n : {5, 10, 20, 45}) {  // 500 to 40,500 triangles
    const auto lumpy = make_lumpy(0.05, n).make();
    Frame fl;
    fl.position_m = {0, 0.02, 0.1003};
    report(std::to_string(20 * n * n).c_str(), *lumpy, fl, *lumpy, fb, 1e-3, 1e-5);
  }
  std::printf("\n%-44s %8s %8s %8s\n", "making, ms", "shape", "search", "triangles");
  report_making("box", make_box({0.06, 0.05, 0.04}, 26));
  report_making("ball", make_ball(0.03, 16));
  report_making("lumpy ball", make_lumpy(0.05, 45));
  report_making("bowl", make_lathe({{0, 0}, {0.03, 0}, {0.06, 0.04}, {0.058, 0.04}, {0.029, 0.002}, {0, 0.002}}, 400, false));
  return 0;
}

}  // namespace
}  // namespace carillon::geometry::tests

int main(int argc, char** argv) { return carillon::geometry::tests::run(argc, argv); }
