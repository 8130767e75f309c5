// What the transfers of all modes to one place cost: a body with the orders of a hollow ceramic bunny, 228 modes from 0.8 to 20 kHz.
//
// usage: bench_transfers [--quick]     median microseconds of one evaluation by instruction set and distance
#include "runtime/acoustics/radiation/transfers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstring>
#include <numbers>
#include <numeric>
#include <random>
#include <vector>

#include "runtime/base/clock.hpp"

namespace {

using namespace carillon;

constexpr double kRadius = 0.084;
constexpr int kModes = 228;

/// Orders grow with frequency from 4 at 0.8 kHz to 32 at 20 kHz, k R from 1.2 to 31; every coefficient counts.
bank::Bank make_bank() {
  bank::Bank bank;
  bank::Multipoles& air = bank.multipoles;
  air.radius_m = kRadius;
  air.nearest_m = 2.0 * kRadius;
  air.air_density_kg_m3 = bank::kAirDensityKgM3;
  air.sound_speed_ms = bank::kSoundSpeedMs;
  std::mt19937 random(1);
  for (int m = 0; m < kModes; ++m) {
    const double share = m / (kModes - 1.0), freq_hz = 800.0 + 19200.0 * std::pow(share, 0.735);
    bank.eigenvalue_rad2_s2.push_back(std::pow(2.0 * std::numbers::pi * freq_hz, 2));
    air.freq_hz.push_back(freq_hz);
    air.order.push_back(static_cast<std::int32_t>(std::lround(4.0 + 28.0 * (freq_hz - 800.0) / 19200.0)));
    air.scale.push_back(1e-4);
    const int numbers = 2 * (air.order.back() + 1) * (air.order.back() + 1);
    for (int i = 0; i < numbers; ++i) air.coefficient.push_back(static_cast<std::int16_t>(random()));
  }
  return bank;
}

/// The median of so many evaluations at places on a sphere [us].
double time_us(const radiation::Transfers& transfers, double distance_m, int rounds) {
  std::vector<std::int32_t> modes(kModes);
  std::iota(modes.begin(), modes.end(), 0);
  std::vector<std::complex<float>> transfer(kModes);
  std::vector<double> times;
  for (int i = 0; i < rounds; ++i) {
    const double angle = 0.01 * i;
    const Vec3 place{distance_m * 0.6 * std::cos(angle), distance_m * 0.6 * std::sin(angle), distance_m * 0.8};
    const double begin = base::get_thread_cpu_s();
    transfers.evaluate(place, modes, transfer);
    times.push_back(1e6 * (base::get_thread_cpu_s() - begin));
  }
  std::nth_element(times.begin(), times.begin() + rounds / 2, times.end());
  return times[rounds / 2];
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  const bank::Bank bank = make_bank();
  fmt::print("{} modes, {} multipoles; median us of one evaluation at\n", kModes, bank.multipoles.coefficient.size() / 2);
  fmt::print("| instructions | 1.05 R | 2 R | 1 m | 10 m |\n|---|--:|--:|--:|--:|\n");
  for (const base::Instructions instructions : base::list_instructions()) {
    const radiation::Transfers transfers(bank, instructions);
    fmt::print("| {} ", base::get_name(instructions));
    for (const double distance_m : {1.05 * kRadius, 2.0 * kRadius, 1.0, 10.0})
      fmt::print("| {:.1f} ", time_us(transfers, distance_m, quick ? 21 : 5001));
    fmt::print("|\n");
  }
  return 0;
}
