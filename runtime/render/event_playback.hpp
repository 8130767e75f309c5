// Pushes the known events of a scene to a synthesiser when due.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "runtime/scene/event_scheduler.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::render {

/// Reads the events once, kAheadS ahead of the sound, so memory does not grow with the scene. The few events due earlier than that (after a
/// pause of a contact or a body) are found in a first pass and kept by number.
class EventPlayback {
 public:
  /// `events` must outlive the result. Events may be out of order by at most kDisorderS. `path` is the listener's.
  EventPlayback(const scene::Events& events, const std::vector<scene::ScheduledBody>& bodies, std::span<const events::Listener> path);

  /// Waypoints to keep per body, and after them for the listener, if sound travels at most longest_s[body]; the listener's `longest_s` is
  /// optional. Reads all events.
  std::vector<int> count_waypoints(std::span<const double> longest_s) const;

  /// Pushes the events needed for the samples before `until_s`. Call between two calls of process(); a full ring is emptied in parts.
  /// [main-thread], in place of the audio thread.
  void push_until(double until_s, synth::Synthesiser& synthesiser);

  /// Rejected events: non-finite numbers and other faults of events::find_fault.
  std::int64_t get_faults() const { return scheduler_.get_faults(); }

 private:
  static constexpr double kAheadS = 1.0;
  static constexpr double kDisorderS = 1.0;
  /// Summary over all events.
  struct Survey {
    double margin_s = 0.0;    // longest time from the start of a pulse to its middle, plus the lead of its body
    double known_s = -1e300;  // time of the last event; without lasting contacts the initial value: no watermarks
  };

  static Survey survey(const scene::Events& events, const std::vector<scene::ScheduledBody>& bodies);
  EventPlayback(const scene::Events& events, const std::vector<scene::ScheduledBody>& bodies, std::span<const events::Listener> path,
                Survey survey);
  void read_until(double until_s);

  const scene::Events* events_;
  std::span<const events::Listener> path_;
  std::vector<scene::ScheduledBody> bodies_;
  Survey survey_;
  scene::EventScheduler scheduler_;
  std::vector<scene::DueEvent> early_;  // in order; due more than kAheadS before their time
  std::size_t next_early_ = 0;
  scene::Events::Reader reader_;
  double read_s_ = -1e300;  // time of the latest event read
};

}  // namespace carillon::render
