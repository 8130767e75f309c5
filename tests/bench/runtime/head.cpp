// What a head costs for one source: EarFilter::process, both ears, in blocks of 128 and of 32 samples, while the source stands still and
// while it goes round.
//
// usage: bench_head [--quick] [SOFA]     the sphere, and the head of the file
//
// Method:     noise; CPU time of a second of sound, the least of the rounds.
// Source:     none.
// Deviations: none.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <random>
#include <span>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/head/ear_filter.hpp"
#include "runtime/head/sofa.hpp"
#include "runtime/head/sphere.hpp"

namespace {

using namespace carillon;

constexpr double kRate = 48000.0;

/// CPU time of a sample [ns].
double measure(const std::shared_ptr<const head::Head>& head, std::size_t size, bool turns, int rounds) {
  std::mt19937 chance(1);
  std::normal_distribution<double> normal;
  std::vector<double> input(size), left(size), right(size);
  for (double& value : input) value = normal(chance);
  head::EarFilter filter(head);
  const int blocks = static_cast<int>(kRate / static_cast<double>(size));
  double least = 1e9;
  for (int round = 0; round < rounds; ++round) {
    const double started = base::get_thread_cpu_s();
    for (int block = 0; block < blocks; ++block) {
      const double angle = turns ? 6.28 * block / blocks : 0.7;
      filter.process({std::cos(angle), std::sin(angle), 0.3}, input, left, right);
    }
    least = std::min(least, base::get_thread_cpu_s() - started);
  }
  if (!std::isfinite(left[0])) std::puts("not finite");
  return 1e9 * least / (blocks * static_cast<double>(size));
}

void print(const char* name, const std::shared_ptr<const head::Head>& head, int rounds) {
  for (const std::size_t size : {std::size_t{128}, std::size_t{32}}) {
    const double still = measure(head, size, false, rounds), turning = measure(head, size, true, rounds);
    std::printf("%-8s %4d taps, blocks of %3zu: %5.1f ns a sample standing still, %5.1f ns going round\n", name, head->get_taps(), size,
                still, turning);
  }
}

}  // namespace

int main(int count, char** words) {
  const bool is_quick = count > 1 && std::strcmp(words[1], "--quick") == 0;
  const int rounds = is_quick ? 2 : 21;
  const double started = base::get_thread_cpu_s();
  const auto sphere = head::make_sphere(kRate);
  std::printf("sphere made in %.1f ms\n", 1e3 * (base::get_thread_cpu_s() - started));
  print("sphere", sphere, rounds);
  if (count > (is_quick ? 2 : 1)) {
    const double before = base::get_thread_cpu_s();
    const auto measured = head::read_sofa(words[count - 1], kRate);
    std::printf("%zu responses read in %.1f ms\n", measured->count_responses(), 1e3 * (base::get_thread_cpu_s() - before));
    print("SOFA", measured, rounds);
  }
}
