// A body that slides, and is edited while it rings: the same as slide.c, in C++, with the budget found from a share of a core.
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/synth/load_keeper.hpp"
#include "runtime/synth/synthesiser.hpp"

using namespace carillon;

namespace {

constexpr double kRateHz = 48000.0;

std::shared_ptr<const synth::Model> make_model(const bank::Bank& bank) {
  auto gains = radiation::calc_gains(bank, radiation::GainKind::kSphere);
  radiation::limit_gains(gains, bank.decay_per_s);  // no louder than its damping allows
  return synth::Model::make(bank, {.rate_hz = kRateHz, .gains = gains});
}

events::LastingContact make_contact(int body, double time_s, events::ContactState state) {
  return {.time_s = time_s,
          .id = 1,
          .body = body,
          .state = state,
          .normal = {0.0, 0.0, 1.0},
          .slip_m_s = {0.4, 0.0, 0.0},
          .force_n = 3.0,
          .other_sweep_m_s = 0.4,  // the spot moves over the ground, not over the body
          .patch_radius_m = 2e-4};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: edit_cpp BANK\n"), 2;
  try {
    const bank::Bank bank = bank::read_bank(argv[1]);
    const bank::Bank edited = bank::calc_edited(bank, {.density_scale = 0.5, .size_scale = 0.8});
    synth::Synthesiser synthesiser({.rate_hz = kRateHz});
    const int body = synthesiser.add_body(make_model(bank), {.position_m = {0.0, 1.0, 0.0}});
    synthesiser.push(events::Impulse{.time_s = 0.01, .body = body, .triangle = 0, .impulse_n_s = {0.0, 0.0, 0.01}, .duration_s = 1e-4});
    synthesiser.push(make_contact(body, 0.02, events::ContactState::kBegin));
    synthesiser.push(make_contact(body, 0.48, events::ContactState::kHold));
    synthesiser.push(make_contact(body, 0.50, events::ContactState::kEnd));
    synthesiser.push(events::TimeWatermark{2.0});  // nothing else happens

    std::array<float, 480> left, right;
    const std::array<float*, 2> out{left.data(), right.data()};
    synth::LoadKeeper keeper;
    double busy_s = 0.0;
    float before = 0.0F, after = 0.0F;
    for (int block = 0; block < 100; ++block) {  // one second
      if (block == 50) synthesiser.swap_model(body, make_model(edited));
      const auto started = std::chrono::steady_clock::now();
      synthesiser.process(out.data(), 2, 480);  // the audio thread's; all else here is the main thread's
      busy_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
      for (const float pressure : left) (block < 50 ? before : after) = std::fmax(block < 50 ? before : after, std::fabs(pressure));
      if (block % 10 == 9) keeper.keep(synthesiser, 0.3, busy_s);  // 30 % of a core
      synthesiser.collect();
    }
    std::printf("peak %g Pa, %g Pa after the edit; %.0f -> %.0f Hz\n", static_cast<double>(before), static_cast<double>(after),
                bank.freq_hz(0), edited.freq_hz(0));
    return before > 0.0F && after > 0.0F ? 0 : 1;
  } catch (const std::exception& error) {
    return std::fprintf(stderr, "edit_cpp: %s\n", error.what()), 1;
  }
}
