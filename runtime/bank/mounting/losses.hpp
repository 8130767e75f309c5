// Damping of modes by supports; docs/equations.md, supports.
//
//   mounting::Losses losses = mounting::calc_losses(bank, {.all = fixing});
//   mounting::apply(losses, bank);  // decays and frequencies of the mounted body
//
// Run when a bank is loaded; not for audio threads.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/material/supports.hpp"

namespace carillon::mounting {

/// Point support on the surface.
struct Holder {
  material::Base by;
  Vec3 point_m{};  // mesh axes; projected to the surface
};

/// Supports of a body in a scene. Default: as in the bank.
struct MountingRequest {
  std::optional<material::Fixing> all{};              // all patches of fixed nodes
  std::map<std::string, material::Fixing> by_name{};  // by patch, overrides `all`
  std::vector<Holder> held{};

  bool is_empty() const { return !all && by_name.empty() && held.empty(); }
};

/// Per mode (m). Beyond first order (shift above kMaxShift of the frequency) the frequency is kept and the decay limited to kMaxDecay of
/// it.
struct Losses {
  std::vector<double> decay_per_s;    // by the supports
  std::vector<double> shift_rad_s;    // shift of the angular frequency
  std::size_t beyond = 0;             // modes beyond first order
  bool is_lowest_beyond = false;      // includes the lowest mode
  std::size_t mixed = 0;              // modes so close to a neighbour that both share their loss
  std::vector<std::string> supports;  // "y-max: on a brick wall, screwed"

  bool is_empty() const { return decay_per_s.empty(); }
};
inline constexpr double kMaxShift = 0.1, kMaxDecay = 0.3;

/// Key that differs for different requests.
std::string write_key(const MountingRequest& request);

/// Names of a bank's supports, in order. Throws InputError if its text is damaged.
std::vector<std::string> list_names(const bank::Bank& bank);

/// d = r^T Re Y r / (2 omega^2) + eta s omega / 2 for each patch, d = phi^T Re Z phi / 2 for each holder. Empty without losses. Throws
/// InputError for fixings of a bank without supports and for unknown names.
Losses calc_losses(const bank::Bank& bank, const MountingRequest& request);

/// Adds the losses to the bank's decays and frequencies. The damping law becomes "mixed".
void apply(const Losses& losses, bank::Bank& bank);

/// One line: supports, decays of the longest and of the lowest mode before and after. Empty without losses.
std::string describe(const Losses& losses, const bank::Bank& before);

/// One line on modes beyond first order and their treatment; empty if only a few of the higher ones are.
std::string describe_limits(const Losses& losses, const bank::Bank& before);

}  // namespace carillon::mounting
