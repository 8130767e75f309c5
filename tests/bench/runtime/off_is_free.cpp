// What effects cost that are compiled in but not called for: the same scene in a build with all of them and in one without.
//
// usage: bench_off_is_free [--quick]       prints the figures of docs/reports/performance-runtime.md
//
// Method:     bodies that ring, struck now and then, with no effect but modal and hertz_pulse. The two builds are libraries of their own,
//             loaded side by side; they play the same seconds of the scene in turns, and each round gives a ratio of CPU time; a second
//             copy of the first build says how far ratios are to be trusted. All must give the same bits, and the build without the other
//             effects must refuse them.
// Source:     none.
// Deviations: none.
#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "runtime/synth/effects.hpp"

namespace {

struct Build {
  double (*play)(int, std::uint64_t*) = nullptr;
  int (*refuses)(int) = nullptr;
  std::uint64_t sum = 0;
};

/// `again`: a second copy of what is loaded already.
Build load(const char* file, bool again = false) {
  void* library = again ? dlmopen(LM_ID_NEWLM, file, RTLD_NOW | RTLD_LOCAL) : dlopen(file, RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    std::fprintf(stderr, "bench_off_is_free: %s\n", dlerror());
    std::exit(1);
  }
  Build build;
  build.play = reinterpret_cast<double (*)(int, std::uint64_t*)>(dlsym(library, "carillon_bench_play"));
  build.refuses = reinterpret_cast<int (*)(int)>(dlsym(library, "carillon_bench_refuses"));
  return build;
}

}  // namespace

int main(int argc, char** argv) {
  using carillon::synth::Effect;
  const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  Build all = load(CARILLON_BENCH_ALL), lean = load(CARILLON_BENCH_LEAN);
  for (int e = 0; e < carillon::synth::kEffectCount; ++e) {
    const bool is_kept = e == static_cast<int>(Effect::kModal) || e == static_cast<int>(Effect::kHertzPulse);
    if (lean.refuses(e) != (is_kept ? 0 : 1)) {
      std::fprintf(stderr, "bench_off_is_free: the build without it does not refuse %s as it should\n",
                   carillon::synth::get_name(static_cast<Effect>(e)));
      return 1;
    }
  }
  Build again = load(CARILLON_BENCH_ALL, true);
  const std::array<Build*, 3> builds{&all, &lean, &again};
  const int blocks = quick ? 20 : 200, rounds = quick ? 3 : 300;
  std::vector<double> ratios, noise, seconds;
  for (int round = -3; round < rounds; ++round) {
    std::array<double, 3> spent{};
    for (int turn = 0; turn < 3; ++turn) {  // everybody is first, second and third in turn, and follows everybody
      const int first = (round + 3) % 3, step = (round + 3) / 3 % 2 == 0 ? 1 : 2;
      const std::size_t i = (first + step * turn) % 3;
      spent[i] = builds[i]->play(blocks, &builds[i]->sum);
    }
    if (all.sum != lean.sum || all.sum != again.sum) {
      std::fprintf(stderr, "bench_off_is_free: the builds do not give the same bits\n");
      return 1;
    }
    if (round < 0) continue;  // the scene sets in
    ratios.push_back(spent[0] / spent[1]);
    noise.push_back(spent[0] / spent[2]);
    seconds.push_back(spent[1]);
  }
  const auto pick = [](std::vector<double> x, double share) {
    std::sort(x.begin(), x.end());
    return x[share * (static_cast<double>(x.size()) - 1.0)];
  };
  const auto print = [&](const char* what, const std::vector<double>& x) {
    std::printf("%s: median %+.2f %%, quartiles %+.2f %% and %+.2f %%\n", what, 100.0 * (pick(x, 0.5) - 1.0), 100.0 * (pick(x, 0.25) - 1.0),
                100.0 * (pick(x, 0.75) - 1.0));
  };
  std::printf("20 bodies of 100 modes, %d rounds of %.2f s of sound, %.1f ms of CPU each (median)\n", rounds, blocks * 128 / 48000.0,
              1e3 * pick(seconds, 0.5));
  print("all effects compiled in, two called for, over a build with these two", ratios);
  print("the first build over a second copy of itself", noise);
  return 0;
}
