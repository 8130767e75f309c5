#include "runtime/support/heard.hpp"

#include <utility>

#include "runtime/bank/corrected.hpp"
#include "runtime/support/losses.hpp"

namespace carillon::support {

std::vector<bank::HeardMode> calc_heard(const bank::Bank& bank) {
  const std::vector<std::size_t> order = bank::sort_played_modes(bank);
  bank::Bank played;  // without surface and shapes: most of a bank, and no part of frequencies and decays
  played.eigenvalue_rad2_s2 = bank.eigenvalue_rad2_s2;
  played.decay_per_s = bank.decay_per_s;
  played.residual = bank.residual;
  played.radiation_gain = bank.radiation_gain;
  played.shape_scale = bank.shape_scale;
  played.algebraic_error_cents = bank.algebraic_error_cents;
  played.discretisation_error_cents = bank.discretisation_error_cents;
  played.corrected = bank.corrected;
  played.multipoles = bank.multipoles;
  played.rigid = bank.rigid;
  played.supports = bank.supports;
  played.material = bank.material;
  played.damping = bank.damping;
  played = bank::calc_corrected(std::move(played));
  const Losses losses = calc_losses(played, {});
  apply(losses, played);
  const std::vector<bank::HeardMode> heard = bank::list_heard(played, losses.decay_per_s);
  std::vector<bank::HeardMode> by_number(heard.size());
  for (std::size_t k = 0; k < heard.size(); ++k) by_number[order[k]] = heard[k];
  return by_number;
}

}  // namespace carillon::support
