// Contacts that last: told apart from impacts, followed while they last, and written down as stream events.
#pragma once

#include <SimTKcommon.h>

#include <array>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "runtime/contact/engine.hpp"
#include "runtime/stream/events.hpp"

namespace carillon::contact {

/// A place where two bodies touch, followed while they do.
struct Spot {
  std::uint64_t id = 0;  // of the contact, from its first record on
  int a = 0, b = -1;
  SimTK::Vec3 where{0};
  SimTK::Vec3 drift{0};                      // velocity of the place over the surface whose corners carry, smoothed
  std::vector<std::array<int, 3>> features;  // that carry there
  double quiet_s = 0.0;                      // time of the first touch, or of the last impact since
  double seen_s = 0.0;                       // when it last touched
  double recorded_s = 0.0;
  double begun_s = -1.0;                // time of its first record; below 0: none yet
  double radius_m = 0.0;                // of the Hertz contact of both surfaces there
  std::array<stream::Contact, 2> last;  // of both bodies
};

/// How many lasting contacts each pair of bodies has had, by their numbers in the scene; -1: the ground.
using TouchCounts = std::map<std::pair<int, int>, std::uint64_t>;

class LastingContacts {
 public:
  /// `before`: what was counted by others, which must outlive this and not change while this one counts.
  explicit LastingContacts(const TouchCounts& before) : before_(&before) {}

  /// After a step: what touches now, from the resting points of the engine at the state reached. Appends events with the engine's own
  /// numbers of bodies; `members`: their numbers in the scene.
  void update(const Engine& engine, const std::vector<int>& members, const Snapshot& now, std::vector<stream::Contact>& events);
  /// An impact at a place: what follows there is no lasting contact for the next moments.
  void note_impact(const Engine& engine, int a, int b, const SimTK::Vec3& where, double time_s);

  std::vector<Spot>& spots() { return spots_; }
  const std::vector<Spot>& spots() const { return spots_; }
  /// Of the pairs that began a contact here, with what was before.
  const TouchCounts& get_touches() const { return touches_; }

 private:
  std::uint64_t make_id(const Engine& engine, const std::vector<int>& members, const Spot& spot);

  const TouchCounts* before_;
  TouchCounts touches_;
  std::vector<Spot> spots_;
};

}  // namespace carillon::contact
