// A bank that is struck once and flies past two ears: block by block, as a game's audio callback would play it.
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/synth/synthesiser.hpp"

using namespace carillon;

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: strike_cpp BANK\n"), 2;
  try {
    constexpr double kRateHz = 48000.0;
    const bank::Bank bank = bank::read_bank(argv[1]);
    auto gains = radiation::calc_gains(bank, radiation::GainKind::kSphere);
    radiation::limit_gains(gains, bank.decay_per_s);  // no louder than its damping allows
    const auto model = synth::Model::make(bank, {.rate_hz = kRateHz, .gains = gains});

    synth::Synthesiser synthesiser({.rate_hz = kRateHz});
    const int body = synthesiser.add_body(model, {.position_m = {-1.0, 2.0, 0.0}});
    synthesiser.push(events::BodyMotion{.time_s = 0.0, .body = body, .position_m = {-1.0, 2.0, 0.0}, .velocity_m_s = {2.0, 0.0, 0.0}});
    synthesiser.push(events::BodyMotion{.time_s = 1.0, .body = body, .position_m = {1.0, 2.0, 0.0}, .velocity_m_s = {2.0, 0.0, 0.0}});
    synthesiser.push(events::Impulse{.time_s = 0.01, .body = body, .triangle = 0, .impulse_n_s = {0.0, 0.0, 0.01}, .duration_s = 1e-4});

    std::array<float, 128> left, right;
    const std::array<float*, 2> out{left.data(), right.data()};
    float peak = 0.0F;
    for (int block = 0; block < 375; ++block) {  // one second
      synthesiser.process(out.data(), 2, 128);   // no heap, no lock, no system call
      for (const float pressure : left) peak = std::fmax(peak, std::fabs(pressure));
    }
    std::printf("%d modes, peak %g Pa at the left ear\n", model->get_mode_count(), static_cast<double>(peak));
    return peak > 0.0F ? 0 : 1;
  } catch (const std::exception& error) {
    return std::fprintf(stderr, "strike_cpp: %s\n", error.what()), 1;
  }
}
