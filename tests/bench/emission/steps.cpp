// The processor time that sound takes of a simulation: ns a triangle and step, with two ears, for several steps a sample.
//
// usage: bench_emission [N]     a ball of 20 N^2 triangles, N = 7 without it (980 triangles)
#include <fmt/format.h>
#include <mpi.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "tests/unit/precompute/simulation/emission/motions.hpp"

namespace {

using namespace carillon;
using namespace carillon::emission;

/// Median of five runs of 100 samples each, behind 100 that are not counted.
double measure(const SurfacePart& part, Radiation radiation, bool has_visibility, int steps) {
  constexpr int kSamples = 100, kRuns = 5;
  Options options = testing::make_options(kSamples * (kRuns + 2), {}, steps);
  options.radiation = radiation;
  options.has_visibility = has_visibility;
  options.receivers = make_ears({0.0, -1.0, 0.3}, {});
  Emission sound(MPI_COMM_SELF, part, options);
  auto u = testing::calc_displacement(
      part, [](const Vec3& x, double) { return 1e-6 * x; }, 0.0);
  std::vector<double> seconds;
  for (int run = 0; run <= kRuns; ++run) {
    const std::clock_t begin = std::clock();
    for (int n = 0; n < kSamples * steps; ++n) {
      u[static_cast<std::size_t>(4 * n) % u.size()] += 1e-9;
      sound.add_step(u.data());
    }
    if (run > 0) seconds.push_back(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  std::sort(seconds.begin(), seconds.end());
  return 1e9 * seconds[kRuns / 2] / (kSamples * steps) / static_cast<double>(part.triangles.size());
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  const auto part = testing::make_part(air::testing::make_ball(argc > 1 ? std::max(1, std::atoi(argv[1])) : 7, 0.1));
  fmt::print("{} triangles, two ears; ns a triangle and step\n{:>16} {:>12} {:>12} {:>22} {:>12}\n", part.triangles.size(),
             "steps a sample", "kirchhoff", "rayleigh", "rayleigh, visibility", "paper2001");
  for (const int steps : {16, 64, 112, 208}) {
    fmt::print("{:>16} {:>12.2f} {:>12.2f} {:>22.2f} {:>12.2f}\n", steps, measure(part, Radiation::kKirchhoff, false, steps),
               measure(part, Radiation::kRayleigh, false, steps), measure(part, Radiation::kRayleigh, true, steps),
               measure(part, Radiation::kPaper2001, true, steps));
  }
  MPI_Finalize();
  return 0;
}
