#include "runtime/bank/mounting/heard.hpp"

#include "runtime/bank/corrected.hpp"

namespace carillon::mounting {
namespace {

/// Copy without surface and shapes, which do not affect frequencies and decays.
bank::Bank copy_modes(const bank::Bank& bank) {
  bank::Bank modes;
  modes.eigenvalue_rad2_s2 = bank.eigenvalue_rad2_s2;
  modes.decay_per_s = bank.decay_per_s;
  modes.residual = bank.residual;
  modes.radiation_gain = bank.radiation_gain;
  modes.shape_scale = bank.shape_scale;
  modes.algebraic_error_cents = bank.algebraic_error_cents;
  modes.discretisation_error_cents = bank.discretisation_error_cents;
  modes.corrected = bank.corrected;
  modes.multipoles = bank.multipoles;
  modes.rigid = bank.rigid;
  modes.supports = bank.supports;
  modes.material = bank.material;
  modes.damping = bank.damping;
  return modes;
}

}  // namespace

std::vector<bank::HeardMode> mount(bank::Bank& played, const MountingRequest& request) {
  const Losses losses = calc_losses(played, request);
  apply(losses, played);
  return bank::list_heard(played, losses.decay_per_s);
}

std::vector<bank::HeardMode> calc_heard_as_played(const bank::Bank& played) {
  bank::Bank modes = copy_modes(played);
  return mount(modes);
}

std::vector<bank::HeardMode> calc_heard(const bank::Bank& bank) {
  const std::vector<std::size_t> order = bank::sort_played_modes(bank);
  bank::Bank played = bank::calc_corrected(copy_modes(bank));
  const std::vector<bank::HeardMode> heard = mount(played);
  std::vector<bank::HeardMode> by_number(heard.size());
  for (std::size_t k = 0; k < heard.size(); ++k) by_number[order[k]] = heard[k];
  return by_number;
}

}  // namespace carillon::mounting
