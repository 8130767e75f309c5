// Time of the first impact of a step.
#pragma once

#include <optional>
#include <vector>

#include "runtime/physics/rigid/step.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"

namespace carillon::rigid {

/// True if this touch closes within the step, fast enough for an impact of its pair.
bool is_fast(const Bodies& bodies, const Pair& pair, const Contact& contact, double step_s);

/// Finds the instants of impacts on the predicted paths of a step, and tracks crowded islands, whose many impacts are all applied once per
/// step.
class Instants {
 public:
  Instants(Bodies& bodies, TouchSets& touches) : bodies_(bodies), touches_(touches), crowded_until_s_(bodies) {}

  /// First instant from now at which a fast touch closes on the paths of the step; sets `at_s` and the touches that close with it.
  bool find(const Step& step, double& at_s, std::vector<ContactRef>& first) const;
  /// Touches that close within the step.
  std::vector<ContactRef> list_closing(const Step& step, double step_s) const;
  /// Searches the pairs of an impact again at its instant: closely passing edges were treated as planes until now. Keeps the touches that
  /// close within step.together_s of the first one, with gaps up to `near_m` (infinite: current gap).
  bool confirm(const Step& step, std::vector<ContactRef>& first, double step_s, double near_m) const;
  /// Longest part of a step without impacts in which no touch gets much deeper. A row stops its touch only at the end of the part, where it
  /// is too deep by half of its movement.
  double calc_stopping_time(const Step& step) const;

  /// Records an impact of these hits: a pair with many slow ones rattles.
  void note(const std::vector<ContactRef>& contacts, const std::vector<Hit>& hits, double time_s) const;

  void set_crowded(const Island& island, double time_s);
  bool is_crowded(int body, double time_s) const { return crowded_until_s_[body] > time_s; }
  bool is_crowded(const Island& island, double time_s) const;

 private:
  std::optional<double> find_instant(const Step& step, const ContactRef& ref, double apex_s, double guess_s) const;

  const Bodies& bodies_;
  TouchSets& touches_;
  PerBody<double> crowded_until_s_;  // until then the impacts of a body are simultaneous
};

}  // namespace carillon::rigid
