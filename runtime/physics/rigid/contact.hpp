// Contacts that persist from step to step, and the impacts and forces that are reported.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "runtime/physics/rigid/body.hpp"
#include "runtime/physics/rigid/limits.hpp"
#include "runtime/physics/geometry/touch.hpp"

namespace carillon::rigid {

/// A touch that is followed from step to step.
struct Contact {
  geometry::Touch touch;
  int a = 0, b = -1;  // bodies; -1: the ground
  int cord = -1;      // of a cord or stop: gap = length until taut, normal from a to b; -1: a touch
  bool touching = false;
  double closes_s = -1.0;                         // from the begin of the step on, by the predicted paths; negative: not so found
  bool presses = false;                           // in an impact with modes
  Vec3 impulse{}, couple{};                       // of the last step, on a [N s, N m s]
  double step_s = 0.0;                            // its length
  double until_s = 0.0;                           // its end
  double lost_j = 0.0;                            // by it, in that step
  bool rests = false;                             // it was closed when one of its bodies fell asleep,
  Vec3 rest_n{};                                  // with this force on a,
  bool is_load = false;                           // which acts on the body that is awake; `impulse` includes it
  std::array<std::int32_t, 2> triangles{-1, -1};  // of a and b, where it struck last

  /// Force on a in its last step [N].
  Vec3 calc_force() const { return touching && step_s > 0.0 ? (1.0 / step_s) * impulse : Vec3{}; }
  /// Becomes a contact of an impact with modes.
  void press() {
    presses = true;
    touching = false;
    impulse = couple = {};
  }
  /// Closed, and in no impact with modes; not of cords.
  bool carries() const { return !presses && cord < 0 && touch.gap_m <= kTouch; }
  bool is_closed() const { return touching && touch.gap_m <= kTouch; }
};

/// The contacts of two bodies, of a body and the ground, or of a cord.
struct Pair {
  int a = 0, b = -1;
  geometry::PairMemory memory;
  std::vector<Contact> contacts;
  struct Ahead {
    geometry::Frame a{}, b{};
    std::vector<geometry::Touch> touches;  // of the contacts; cleared by every change of them
  };
  Ahead ahead;                               // at predicted frames
  double margin_m = 0.0, travelled_m = 0.0;  // since the last search
  struct Errors {
    double drift_m = 0.0, way_m = 0.0, turn = 0.0;
  };
  Errors errors;  // of its lasting touches, see TouchSets::refresh()
  bool searched = false;
  double next_search_s = 0.0;  // earliest next search for missing touches
  geometry::Frame measured{};     // of a, at the last search for its lowest vertex over the ground,
  double lowest_m = -1.0;      // and its gap
  std::int64_t window = -1;    // in which it was last near
  int cord = -1;               // number of the cord; -1: two bodies
  struct SlowHit {
    double time_s = -1.0, speed_m_s = 0.0;
  };
  std::array<SlowHit, 4> slow_hits{};  // its last impacts slower than kRattling, since a faster one
  double rattles_until_s = -1.0;       // until then its slow touches last
  double stored_j = 0.0;               // energy left in the springs of ended impacts, for lifting
  double sag_m = 0.0;                  // depth left by an ended impact with modes: allowed, decays
  Vec3 apart_m{};                      // displacement of a for finding touches, where bodies are deep for their thickness

  bool touches() const {
    return std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return c.touching; });
  }
  /// Within kDeep, with or without a force.
  bool has_closed_gap() const {
    return std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return c.touch.gap_m <= kDeep; });
  }
};

/// A contact by its place in a pair.
struct ContactRef {
  Pair* pair = nullptr;
  int contact = 0;
  Contact& get() const { return pair->contacts[contact]; }
  bool operator==(const ContactRef&) const = default;
};

/// One point of an impact. Momentum and place in the world.
struct Hit {
  int a = 0, b = -1;
  geometry::Touch touch;
  double approach_m_s = 0.0, restitution = 0.0;
  Vec3 impulse{};                                       // on a [N s]
  bool is_cord = false;                                 // comes taut
  double linked_mass_kg = 0.0;                          // that meets there, where bodies are on joints
  std::array<std::optional<geometry::Place>, 2> places{};  // on a and b, where they were looked for
  std::array<std::int32_t, 2> triangles{-1, -1};        // on which they may be
};

/// An instant of impact: its points, and the bodies that it moved, before and after.
struct Strike {
  double time_s = 0.0;
  double together_s = 0.0;  // its points close within so much of that
  std::vector<Hit> hits;
  std::vector<int> bodies;
  std::vector<State> before, after;
  double modes_j = 0.0;  // given to modes
};

/// The force of one contact of an impact with modes, as impulses of equal steps; long ones come in pieces.
struct Forces {
  int a = 0, b = -1;
  geometry::Place place_a, place_b;
  double time_s = 0.0, step_s = 0.0;
  bool continues = false;
  std::vector<Vec3> on_a, on_b;  // [N s], each in the frame of its body's mesh as it was then; on_b empty for the ground
};

}  // namespace carillon::rigid
