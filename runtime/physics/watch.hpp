// Audit of penetrations between bodies and into the ground, and of hit counts.
#pragma once

#include <deque>
#include <map>
#include <utility>
#include <vector>

#include "runtime/physics/events.hpp"
#include "runtime/physics/rigid/space.hpp"

namespace carillon::physics {

/// Depths are computed from the poses of the bodies, not from the touches of the simulation, which may be incomplete. Invariant: hits are
/// added in time order.
class ContactWatch {
 public:
  using Bodies = std::pair<int, int>;  // other: -1, or greater

  /// After a step: moving bodies in the ground.
  void look_at_ground(const rigid::Space& space);
  /// At the end of a window: those of `pairs` with a moving body. All of them if `is_start`.
  void look_at_pairs(const rigid::Space& space, const std::vector<Bodies>& pairs, bool is_start);
  void add_hit(double time_s, int a, int b);
  /// Audit at the current time.
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
