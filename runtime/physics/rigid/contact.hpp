// Persistent contacts, and the reported impacts and forces.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/physics/geometry/touch.hpp"
#include "runtime/physics/rigid/body.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {

/// A touch tracked over several steps.
struct Contact {
  geometry::Touch touch;
  int a = 0, b = -1;  // bodies; -1: the ground
  int cord = -1;      // index of a cord or stop: gap = length until taut, normal from a to b; -1: a touch
  bool touching = false;
  double closes_s = -1.0;                         // from the start of the step, on the predicted paths; negative: does not close
  bool presses = false;                           // in a modal impact
  Vec3 impulse{}, couple{};                       // of the last step, on a [N s, N m s]
  double step_s = 0.0;                            // its length
  double until_s = 0.0;                           // its end
  double lost_j = 0.0;                            // lost by the contact in that step
  bool rests = false;                             // closed when one of its bodies fell asleep,
  Vec3 rest_n{};                                  // with this force on a,
  bool is_load = false;                           // acting on the awake body; included in `impulse`
  std::array<std::int32_t, 2> triangles{-1, -1};  // of a and b, at the last strike

  /// Force on a in the last step [N].
  Vec3 calc_force() const { return touching && step_s > 0.0 ? (1.0 / step_s) * impulse : Vec3{}; }
  /// Makes this a contact of a modal impact.
  void press() {
    presses = true;
    touching = false;
    impulse = couple = {};
  }
  /// Closed, not in a modal impact, not a cord.
  bool carries() const { return !presses && cord < 0 && touch.gap_m <= kTouchGapM; }
  /// Touching, or open by no more than facets of a rolling surface cause.
  bool is_close() const { return touching || (touch.smooth && touch.gap_m <= kMissingDepthM); }
  /// A rolling contact stays closed where its gap drifts.
  bool is_closed() const { return touching && touch.gap_m <= (!touch.smooth ? kTouchGapM : b < 0 ? kGroundDriftM : kGapDriftM); }
};

/// Contacts of two bodies, of a body and the ground, or of a cord.
struct Pair {
  int a = 0, b = -1;
  geometry::PairMemory memory;
  std::vector<Contact> contacts;
  struct Ahead {
    geometry::Frame a{}, b{};
    std::vector<geometry::Touch> touches;  // of the contacts; cleared whenever they change
  };
  Ahead ahead;                               // at predicted frames
  static constexpr double kMovedM = 1e-12;   // m; least travel of touches that must be refreshed
  double margin_m = 0.0, travelled_m = 0.0;  // since the last search
  struct Errors {
    double drift_m = 0.0, way_m = 0.0, turn = 0.0;
  };
  Errors errors;  // of its persistent touches, see TouchSets::refresh()
  bool searched = false;
  double next_search_s = 0.0;  // earliest next search for missing touches
  geometry::Frame measured{};  // frame of a at the last search for its lowest vertex over the ground,
  double lowest_m = -1.0;      // and its gap
  std::int64_t window = -1;    // last window in which the pair was near
  int cord = -1;               // number of the cord; -1: two bodies
  struct SlowHit {
    double time_s = -1.0, speed_m_s = 0.0;
  };
  std::array<SlowHit, 4> slow_hits{};  // its last impacts slower than kRattleSpeedMS
  double rattles_until_s = -1.0;       // until then slow touches are persistent
  double stored_j = 0.0;               // energy left in the springs of ended impacts, available for lifting
  double stopped_j = 0.0;              // lost in the last step by contacts that closed in it, available for lifting in the next
  double sag_m = 0.0;                  // depth left by an ended modal impact: permitted, decays
  Vec3 apart_m{};                      // displacement of a in touch searches if the penetration is large for the thickness

  void quiet_until(double time_s) { rattles_until_s = std::max(rattles_until_s, time_s); }

  /// Resets the travel, as after a search: no other point of the pair can touch.
  void renew_search() { travelled_m = std::min(travelled_m, kMovedM); }
  double take_stopped_j() { return std::exchange(stopped_j, 0.0); }
  bool touches() const {
    return std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return c.touching; });
  }
  /// Closed in a modal impact.
  bool presses() const {
    return std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return c.presses && c.touch.gap_m <= 0.0; });
  }
  /// Gap within kDeepM, with or without a force.
  bool has_closed_gap() const {
    return std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return c.touch.gap_m <= kDeepM; });
  }
};

/// A contact by its index in a pair.
struct ContactRef {
  Pair* pair = nullptr;
  int contact = 0;
  Contact& get() const { return pair->contacts[contact]; }
  bool operator==(const ContactRef&) const = default;
};

/// One point of an impact. Momentum and position in the world frame.
struct Hit {
  int a = 0, b = -1;
  geometry::Touch touch;
  double approach_m_s = 0.0, restitution = 0.0;
  Vec3 impulse{};                                          // on a [N s]
  bool is_cord = false;                                    // a cord becoming taut
  bool bends = false;                                      // a body too far for a modal impact
  double linked_mass_kg = 0.0;                             // effective mass at the point, for bodies on joints
  std::array<std::optional<geometry::Place>, 2> places{};  // on a and b, if already searched
  std::array<std::int32_t, 2> triangles{-1, -1};           // candidate triangles
};

/// One instant of impact: its points, and the bodies moved by it, before and after.
struct Strike {
  double time_s = 0.0;
  double together_s = 0.0;  // interval in which its points close
  std::vector<Hit> hits;
  std::vector<int> bodies;
  std::vector<State> before, after;
  double modes_j = 0.0;  // transferred to modes
  // Pulses on bodies that bend far: the first with the length of Hertz and this share of the impulse, the rest prolonged.
  double first_share = 1.0, stretch = 1.0;
  double prolong(double length_s) const { return std::max(length_s, std::min(stretch * length_s, kLongestPulseS)); }
};

/// Force of one contact of a modal impact, as impulses of equal steps; long ones are delivered in pieces.
struct Forces {
  int a = 0, b = -1;
  geometry::Place place_a, place_b;
  double time_s = 0.0, step_s = 0.0;
  bool continues = false;
  bool moves = false;            // the contact has stayed closed since a force at another place
  std::vector<Vec3> on_a, on_b;  // [N s], each in the mesh frame of its body at that time; on_b empty for the ground
};

}  // namespace carillon::rigid
