#include "runtime/synth/energy_book.hpp"

#include <cmath>

#include "runtime/bank/air.hpp"

namespace carillon::synth {

double calc_radiated_share(double gain, double decay_per_s) noexcept {
  const double radiation_per_s = bank::calc_radiation_decay(gain);
  return radiation_per_s < decay_per_s ? radiation_per_s / decay_per_s : 1.0;
}

EnergyBook::EnergyBook(const Model& model) {
  const double h = kSubBlock / model.get_rate_hz();
  modes_.resize(static_cast<std::size_t>(model.get_mode_count()));
  for (int m = 0; m < model.get_mode_count(); ++m) {
    Mode& mode = modes_[static_cast<std::size_t>(m)];
    mode.lambda = model.get_eigenvalue_rad2_s2(m);
    const double decay = model.get_decay_per_s(m);
    // The sound of modes near and above critical damping is left out.
    if (m < model.get_ringing_mode_count()) mode.share = calc_radiated_share(model.get_gain(m), decay);
    mode.alone = calc_oscillator_map(mode.lambda, decay, h);
    const double x = 2.0 * decay * h;
    mode.factor = x > 1e-9 ? x / -std::expm1(-x) : 1.0;
    for (std::size_t n = 0; n < mode.falls.size(); ++n) mode.falls[n] = -std::expm1(-x * static_cast<double>(n + 1));
  }
}

}  // namespace carillon::synth
