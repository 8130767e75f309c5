#include "runtime/synth/energy_book.hpp"

#include <cmath>

#include "runtime/bank/air.hpp"

namespace carillon::synth {

double calc_radiated_share(double gain, double decay_per_s) noexcept {
  const double radiation_per_s = bank::calc_radiation_decay(gain);
  return radiation_per_s < decay_per_s ? radiation_per_s / decay_per_s : 1.0;
}

EnergyBook::EnergyBook(const Model& model) {
  const double h = 1.0 / model.get_rate_hz();
  modes_.resize(model.get_mode_count());
  kept_.resize((static_cast<std::size_t>(model.get_ringing_mode_count()) + kGroup - 1) / kGroup);
  for (int m = 0; m < model.get_mode_count(); ++m) {
    Mode& mode = modes_[m];
    mode.lambda = model.get_eigenvalue_rad2_s2(m);
    mode.decay = model.get_decay_per_s(m);
    mode.loss = 2.0 * mode.decay * h;
    for (std::size_t n = 0; n < mode.falls.size(); ++n) mode.falls[n] = -std::expm1(-mode.loss * kSubBlock * static_cast<double>(n + 1));
    mode.alone = calc_oscillator_map(mode.lambda, mode.decay, kSubBlock * h);
    if (m >= model.get_ringing_mode_count()) continue;  // radiation of damped modes is left out
    mode.share = calc_radiated_share(model.get_gain(m), mode.decay);
    mode.omega_d = calc_damped_omega(mode.lambda, mode.decay);
    mode.turn_re = std::exp(-mode.decay * h) * std::cos(mode.omega_d * h);
    mode.turn_im = std::exp(-mode.decay * h) * std::sin(mode.omega_d * h);
  }
}

/// Loss of a ringing mode to damping in the sub-block that begins in mode.state [J].
double EnergyBook::calc_lost_j(const Mode& mode, const SampleStates& kept, int lane, bool is_all) const noexcept {
  double re = is_all ? 0.0 : mode.state.v + mode.decay * mode.state.q, im = is_all ? 0.0 : mode.omega_d * mode.state.q, sum = 0.0;
  const double tilt = mode.decay / mode.omega_d;
  for (int n = 0; n < kSubBlock; ++n) {
    const double v = re + static_cast<double>(kept.re[n][lane]) - tilt * (im + static_cast<double>(kept.im[n][lane]));
    sum += v * v;
    const double turned = re * mode.turn_re - im * mode.turn_im;
    im = re * mode.turn_im + im * mode.turn_re;
    re = turned;
  }
  return mode.loss * sum;
}

}  // namespace carillon::synth
