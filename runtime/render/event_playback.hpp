// The events of a scene that is known to its end, pushed to a synthesiser as it needs them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "runtime/scene/event_scheduler.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::render {

/// Events are read once as the sound advances, kAheadS ahead of it, so that memory does not grow with the scene. Those few that are due
/// longer before they happen (after a pause of a contact or a body) are found beforehand and kept by their numbers.
class EventPlayback {
 public:
  /// `events` must outlive the result. No event may be earlier than one before it by more than kDisorderS. `path` is the listener's.
  EventPlayback(const scene::Events& events, const std::vector<scene::ScheduledBody>& bodies, std::span<const events::Listener> path);

  /// Waypoints that are to be remembered of each body, and behind them of the listener, when its sound travels for at most longest_s[body];
  /// the listener's place of `longest_s` may be left out. Goes through all events.
  std::vector<int> count_waypoints(std::span<const double> longest_s) const;

  /// Pushes what must be known before the samples until `until_s` are made. The synthesiser must be between two calls of process(); what
  /// does not fit into its ring at once goes in parts. [main-thread], and in place of the audio thread.
  void push_until(double until_s, synth::Synthesiser& synthesiser);

  /// Events that could not be played: numbers that are not finite, and what else events::find_fault names.
  std::int64_t get_faults() const { return scheduler_.get_faults(); }

 private:
  static constexpr double kAheadS = 1.0;
  static constexpr double kDisorderS = 1.0;
  /// What all events together say.
  struct Survey {
    double margin_s = 0.0;    // the longest time between the start of a pulse and its middle, with the lead of its body
    double known_s = -1e300;  // when the last thing happens; where no contact lasts, as from the start: no marks
  };

  static Survey survey(const scene::Events& events, const std::vector<scene::ScheduledBody>& bodies);
  EventPlayback(const scene::Events& events, const std::vector<scene::ScheduledBody>& bodies, std::span<const events::Listener> path, Survey survey);
  void read_until(double until_s);

  const scene::Events* events_;
  std::span<const events::Listener> path_;
  std::vector<scene::ScheduledBody> bodies_;
  Survey survey_;
  scene::EventScheduler scheduler_;
  std::vector<scene::DueEvent> early_;  // in order; due more than kAheadS before they happen
  std::size_t next_early_ = 0;
  scene::Events::Reader reader_;
  double read_s_ = -1e300;  // latest event that was read
};

}  // namespace carillon::render
