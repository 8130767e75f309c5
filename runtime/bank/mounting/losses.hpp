// What fixes or carries a body takes energy out of its modes; docs/equations.md, supports.
//
//   mounting::Losses losses = mounting::calc_losses(bank, {.all = fixing});
//   mounting::apply(losses, bank);  // decays and frequencies of the body as it is mounted
//
// Made when a bank is loaded; not for an audio thread.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/material/supports.hpp"

namespace carillon::mounting {

/// Something that touches a body at a point of its surface.
struct Holder {
  material::Base by;
  Vec3 point_m{};  // frame of the mesh; the nearest point of the surface is meant
};

/// What a scene says of a body. Nothing: as the bank has it.
struct MountingRequest {
  std::optional<material::Fixing> all{};              // behind every patch of fixed nodes
  std::map<std::string, material::Fixing> by_name{};  // behind one of them, in place of `all`
  std::vector<Holder> held{};

  bool is_empty() const { return !all && by_name.empty() && held.empty(); }
};

/// Of every mode (m). Where first order does not hold (the shift is more than kMaxShift of the frequency) the frequency stays, and the
/// decay is kMaxDecay of it at most.
struct Losses {
  std::vector<double> decay_per_s;    // added by the supports
  std::vector<double> shift_rad_s;    // of the angular frequency
  std::size_t beyond = 0;             // modes beyond first order
  bool is_lowest_beyond = false;      // the lowest mode is one of them
  std::size_t mixed = 0;              // modes whose neighbour is so near that both share their loss
  std::vector<std::string> supports;  // in words: "y-max: on a brick wall, screwed"

  bool is_empty() const { return decay_per_s.empty(); }
};
inline constexpr double kMaxShift = 0.1, kMaxDecay = 0.3;

/// A text that differs for requests that differ.
std::string write_key(const MountingRequest& request);

/// The names of a bank's supports, in its order. Throws InputError for a bank whose text is damaged.
std::vector<std::string> list_names(const bank::Bank& bank);

/// Calculates d = r^T Re Y r / (2 omega^2) + eta s omega / 2 of every patch and d = phi^T Re Z phi / 2 of every holder. Empty when nothing
/// takes anything. Throws InputError for fixings of a bank that has no supports, and for names that it has not.
Losses calc_losses(const bank::Bank& bank, const MountingRequest& request);

/// Puts the losses into the bank's decays and frequencies. The damping law is then "mixed": the decays are no longer of the material alone.
void apply(const Losses& losses, bank::Bank& bank);

/// One line for people: supports, decays of the mode of the longest decay and of the lowest one before and after. Empty without losses.
std::string describe(const Losses& losses, const bank::Bank& before);

/// One line, empty when first order holds but for a few of the higher modes: of how many modes it does not hold, and what was done.
std::string describe_limits(const Losses& losses, const bank::Bank& before);

}  // namespace carillon::mounting
