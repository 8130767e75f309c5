// Cost of one microphone for one source: Receiver::process in blocks of 128 samples.
//
// usage: bench_ears [--quick]       prints the table of docs/reports/performance-runtime.md
//
// Method:     a source that stands still or swings with up to 6 m/s two metres away, with what it sends all round alone or with its three
//             dipoles, noise in all; CPU time, medians of the rounds, the instruction sets in turns.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <random>
#include <span>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/synth/receiver.hpp"
#include "tests/bench/runtime/fma_limit.hpp"

namespace {

using namespace carillon;

constexpr double kRate = 48000.0;
constexpr int kBlock = 128;
constexpr int kBlocks = 375;  // one second

synth::Trajectory make_path(bool moves) {
  std::vector<synth::PathPoint> places;
  for (int i = 0; i <= (moves ? 100 : 0); ++i) {
    const double t = i / 100.0;
    places.push_back({t, {2.0 + std::sin(6.0 * t), 0.5, 0.2 * std::cos(9.0 * t)}});
  }
  return synth::make_trajectory(places);
}

/// CPU time of a block and ear [s].
double measure(synth::Isa isa, const synth::Trajectory& path, bool dipoles, const std::vector<float>& noise) {
  synth::Trajectory listener(1);
  listener.push({});
  std::vector<synth::DelayLine> sent(dipoles ? 4 : 1, synth::DelayLine(10.0, kRate, kBlock));
  synth::Source source{.track = &path, .monopole = sent.data()};
  for (std::size_t k = 0; k < 3 && dipoles; ++k) source.dipole[k] = &sent[k + 1];
  synth::Receiver ear({0.0, 0.1, 0.0}, kRate, {synth::Effect::kAirDelay, synth::Effect::kDoppler}, isa);
  std::array<double, kBlock> heard{};
  double spent = 0.0;
  for (int block = 0; block < kBlocks; ++block) {
    for (std::size_t k = 0; k < sent.size(); ++k) sent[k].push(std::span(noise).subspan((block * 7 + k) % 1000, kBlock));
    const double started = base::get_thread_cpu_s();
    ear.process(source, listener, static_cast<std::int64_t>(block) * kBlock, heard);
    spent += base::get_thread_cpu_s() - started;
  }
  if (!std::isfinite(heard[0])) std::puts("not finite");
  return spent / kBlocks;
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 && std::strcmp(argv[1], "--quick") == 0 ? 1 : 15;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  std::vector<float> noise(1000 + kBlock);
  for (float& x : noise) x = number(random);
  // Cost of reading the clock.
  double empty = 1.0;
  for (int i = 0; i < 1000; ++i) {
    const double started = base::get_thread_cpu_s();
    empty = std::min(empty, base::get_thread_cpu_s() - started);
  }
  std::printf("| us a block of %d and ear | still | still, dipoles | moves | moves, dipoles |\n|---|--:|--:|--:|--:|\n", kBlock);
  std::vector<synth::Isa> sets;
  for (const synth::Isa isa : {synth::Isa::kAvx512, synth::Isa::kAvx2, synth::Isa::kSse4, synth::Isa::kPlain}) {
    if (synth::get_kernels(isa).isa == isa) sets.push_back(isa);
  }
  std::vector<std::array<std::vector<double>, 4>> seconds(sets.size());
  const std::array<synth::Trajectory, 2> paths{make_path(false), make_path(true)};
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t s = 0; s < sets.size(); ++s) {
      for (std::size_t c = 0; c < 4; ++c) seconds[s][c].push_back(measure(sets[s], paths[c / 2], c % 2 == 1, noise) - empty);
    }
  }
  for (std::size_t s = 0; s < sets.size(); ++s) {
    std::printf("| %s |", synth::get_name(sets[s]));
    for (std::vector<double>& times : seconds[s]) {
      std::sort(times.begin(), times.end());
      std::printf(" %.2f |", 1e6 * times[times.size() / 2]);
    }
    std::printf("\n");
  }
  return 0;
}
