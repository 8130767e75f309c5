// Hits of a step as pulses or as impacts with modes. Internal to this folder.
#pragma once

#include <vector>

#include "runtime/drive/lasting.hpp"
#include "runtime/drive/pulses.hpp"
#include "runtime/drive/touch_spots.hpp"

namespace carillon::drive {

/// Invariant: no hit gives the modes of its bodies more energy than it took from their motion.
class HitSounds {
 public:
  void resize(int bodies) { masks_.resize(bodies); }
  void forget(int body) { masks_.forget(body); }

  /// Sounds the hits of a step, strongest first. Appends events and notifies `lasting`.
  void add(const StepView& step, std::vector<FinishedHit>& hits, LastingContacts& lasting, TouchesCounters& counters,
           std::vector<events::Event>& events);

 private:
  /// A hit and the properties of its pulse.
  struct Contact {
    const FinishedHit& hit;
    double mass_kg = 0.0, speed_m_s = 0.0, restitution = 0.0, radius_m = 0.0, compliance = 0.0;
    std::array<geometry::Place, 2> places{};
    std::array<std::vector<double>, 2> shapes{};  // (n, 3) at the places; empty: no modes

    /// Kinetic energy lost [J], at least 1 % of the blow.
    double calc_lost_j() const;
  };

  bool sound(const StepView& step, const FinishedHit& hit, TouchesCounters& counters, std::vector<events::Event>& events);
  static Contact make_contact(const StepView& step, const FinishedHit& hit);
  bool integrate(const StepView& step, const Contact& contact, TouchesCounters& counters, std::vector<events::Event>& events);

  Masks masks_{0};
  int impacts_left_ = 0;
};

}  // namespace carillon::drive
