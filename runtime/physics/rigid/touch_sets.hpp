// Touches of bodies: found with a margin, followed from step to step, identified.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/physics/rigid/bodies.hpp"
#include "runtime/physics/rigid/contact.hpp"
#include "runtime/physics/rigid/links.hpp"
#include "runtime/physics/rigid/step.hpp"

namespace carillon::rigid {

class ModalImpacts;

/// Contacts of all pairs of near bodies, and of all cords. Invariant: after search() or update() a pair has every touch that can close
/// within the step at the current speeds; after complete() none is missing where its bodies would be deepest at the end of the step; a
/// persistent touch keeps its id, and its contact its impulses.
class TouchSets {
 public:
  TouchSets(const Bodies& bodies, std::vector<Cord> cords, const ModalImpacts& impacts, Ledger& ledger);

  /// Created on first request. b: -1, or greater than a.
  Pair& get(int a, int b);
  std::map<std::pair<int, int>, Pair>& pairs() { return pairs_; }
  const std::map<std::pair<int, int>, Pair>& pairs() const { return pairs_; }
  /// One per cord.
  std::vector<Pair>& cord_pairs() { return cord_pairs_; }
  const std::vector<Pair>& cord_pairs() const { return cord_pairs_; }
  const Cord& cord(int number) const { return cords_[number]; }
  /// Removes pairs that are not near in this window, unless both bodies are static or asleep.
  void forget_far(std::int64_t window);
  /// Removes the pairs of a body.
  void forget(int body);

  /// Searches the touches at the current poses, for an approach of at least `least_m_s`.
  void search(Pair& pair, double step_s, double least_m_s = 0.0);
  /// Moves the touches with the bodies. Touches off their surfaces are dropped, and the pair is searched at its next update. Records the
  /// largest changes of persistent curved touches: of the gap, of the position on body a, and of the normal in it.
  void refresh(Pair& pair) const;
  /// Removes deep touches of curved surfaces on far sides or past the ends of edges and facets.
  void remove_false(Pair& pair) const;
  /// Updates touches for a step: searched again if the pair may have moved by its margin.
  void update(Pair& pair, double step_s);
  /// True if the bodies of a pair may meet within a step: they have contacts, or come nearer than they move.
  bool may_meet(Pair& pair, double step_s) const;
  /// Resets the closing times of the contacts of a step.
  void forget_closing(const Step& step) const;
  /// Touches at the end of a step.
  struct Ahead {
    bool was_missing = false;  // touches, or with `finds_closing` closings
    double depth_m = 0.0;      // largest penetration, less the explained depth of its pair
  };
  /// Adds touches that are missing at the end of a step by its predicted motion, and with `finds_closing` finds those that close.
  Ahead complete(const Step& step, bool finds_closing);
  /// Like complete(), for one pair after a time of free flight.
  void complete_in_flight(Pair& pair, double time_s);
  /// Closing point of a touch of a curved surface within a time of free flight, moved back with the bodies.
  geometry::Touch find_closing(Pair& pair, const Contact& contact, double time_s) const;
  /// Accumulates a movement of `time_s` in a step.
  void travel(Pair& pair, double time_s, double step_s) const;
  /// Searches the touches with the bodies separated by the depth explained by springs and modes, along `normal` (to a). Past the middle of
  /// a thin body the nearest surface would be its other side.
  void part(Pair& pair, double depth_m, const Vec3& normal) const;
  /// Depth of a pair that springs and modes of its impact explain, or that an ended one has left [m].
  double calc_explained_depth(const Pair& pair) const;
  /// The same at a touch, `after_s` later.
  double calc_explained_depth(const Pair& pair, const geometry::Touch& touch, double after_s) const;
  /// Frees the contacts of two bodies after a modal impact. depth_m: explained by it; stored_j: energy of its springs, for lifting.
  void release(int a, int b, double depth_m, double stored_j);
  /// Adds the energy left in springs of ended impacts to the books.
  void add_to(Books& books) const;
  /// A touch of a pair with its bodies at these frames.
  geometry::Touch find_moved(const Pair& pair, geometry::Touch touch, const geometry::Frame& a, const geometry::Frame& b) const;

  /// True if a touch has moved to a far part of its surface.
  bool is_far_jump(const Pair& pair, const geometry::Touch& from, const geometry::Touch& to) const;

 private:
  bool is_jump(const Pair& pair, const geometry::Touch& from, const geometry::Touch& to) const;
  void keep_lost(Pair& pair, const std::vector<Contact>& old) const;
  void merge(Pair& pair) const;
  bool follow(const Pair& pair, geometry::Touch& touch, const geometry::Frame& a, const geometry::Frame& b) const;
  double calc_way(const Pair& pair, double time_s, double step_s) const;
  void lose_stored(Pair& pair) const;
  void lose_all(Pair& pair) const;
  void limit_apart(Pair& pair) const;
  std::pair<Contact*, double> find_least(Pair& pair, const geometry::Frame& a, const geometry::Frame& b) const;
  Ahead complete(Pair& pair, const geometry::Frame& a, const geometry::Frame& b, double closing_s);
  Ahead complete_polyhedra(Pair& pair, const geometry::Frame& a, const geometry::Frame& b);
  std::optional<geometry::Touch> find_deepest(const Pair& pair, const geometry::Frame& a, const geometry::Frame& b);
  geometry::Frame find_flown(int body, double time_s) const;
  void add(Pair& pair, const geometry::Deepest& deepest);
  void add(Pair& pair, const geometry::Touch& touch);

  const Bodies& bodies_;
  const ModalImpacts& impacts_;
  Ledger& ledger_;
  std::vector<Cord> cords_;
  std::vector<Pair> cord_pairs_;
  std::map<std::pair<int, int>, Pair> pairs_;
  std::vector<geometry::Touch> found_;  // work memory
};

}  // namespace carillon::rigid
