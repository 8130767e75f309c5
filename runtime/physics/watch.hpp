// Depths of bodies in each other and in the ground, and counts of their hits, for an audit.
#pragma once

#include <array>
#include <deque>
#include <map>
#include <utility>
#include <vector>

#include "runtime/physics/events.hpp"
#include "runtime/physics/rigid/space.hpp"

namespace carillon::physics {

/// Depths are those of the bodies' places, not of the touches that a simulation has found, which may be incomplete. Invariant: hits are
/// added in order of time.
class ContactWatch {
 public:
  using Bodies = std::pair<int, int>;  // other: -1, or greater

  /// After a step: bodies that move, in the ground.
  void look_at_ground(const rigid::Space& space);
  /// At the end of a window: those of `pairs` of which one moves, in each other. They are looked at all where `is_start`.
  void look_at_pairs(const rigid::Space& space, const std::vector<Bodies>& pairs, bool is_start);
  void add_hit(double time_s, int a, int b);
  /// At the present time.
  ContactAudit find(const rigid::Space& space) const;

 private:
  /// Hits of the last `length_s`.
  struct Recent {
    explicit Recent(double length) : length_s(length) {}
    void add(double time_s, Bodies bodies);
    void forget(double now_s);
    HitRate find_worst() const;

    double length_s;
    std::deque<std::pair<double, Bodies>> hits;
    std::map<Bodies, int> counts;
  };

  void keep(const Depth& depth);

  Depth deepest_, unexplained_;
  Recent second_{1.0}, half_{0.5};
  HitRate busiest_;
};

}  // namespace carillon::physics
