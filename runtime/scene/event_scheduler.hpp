// When a synthesiser must know an event, and the queue of the events that it does not know yet. Used offline and live.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include "runtime/events/events.hpp"

namespace carillon::scene {

/// What the scheduler needs to know of a body.
struct ScheduledBody {
  int number = -1;      // in the synthesiser; -1: not played
  bool moves = false;   // its motions are pushed; of a body that does not move its place is enough
  double lead_s = 0.0;  // by which a strike must be known before it begins
};

/// When an event is due: it must be known before anything at this time is made.
struct DueEvent {
  double due_s = 0.0;
  std::uint64_t number = 0;  // of the event: of two that are due at once the smaller is first
  bool is_still = false;     // the same place without its velocity, pushed before it
  bool operator>(const DueEvent& other) const {
    if (due_s != other.due_s) return due_s > other.due_s;
    return number != other.number ? number > other.number : is_still < other.is_still;
  }
};

/// Derives due times from the events so far: a pulse is due when it begins, a waypoint or a record of a contact at the time of the one
/// before it, for between the two it is interpolated. Events are given in the order in which they are numbered.
class DueTimes {
 public:
  /// `bodies` must outlive the result. `margin_s`: by which waypoints and records are due earlier, so that a strike knows the attitude of
  /// its body in the middle of its pulse.
  DueTimes(const std::vector<ScheduledBody>& bodies, double margin_s);

  /// Calls work(DueEvent) for each time that the event is to be pushed: never, once, or twice for the first waypoint of a body.
  template <class Work>
  void find(const events::Event& event, Work&& work) {
    DueEvent due[2];
    const int count = find(event, due);
    for (int i = 0; i < count; ++i) work(due[i]);
  }
  /// The same for the listener's next waypoint; its numbers are behind those of all other events.
  template <class Work>
  void find_listener(const events::Listener& waypoint, Work&& work) {
    DueEvent due[2];
    const int count = find_waypoint(last_s_.back(), waypoint.time_s, kListenerNumbers + listener_number_++, due);
    for (int i = 0; i < count; ++i) work(due[i]);
  }
  /// Events so far that cannot be played (events::find_fault) and are never due.
  std::int64_t get_faults() const { return faults_; }
  /// nullptr for a body that is not played.
  const ScheduledBody* find_body(std::int32_t body) const;

 private:
  static constexpr std::uint64_t kListenerNumbers = std::uint64_t{1} << 63;

  int find(const events::Event& event, DueEvent* due);
  int find_waypoint(double& last_s, double time_s, std::uint64_t number, DueEvent* due) const;

  const std::vector<ScheduledBody>* bodies_;
  double margin_s_ = 0.0;
  std::uint64_t number_ = 0, listener_number_ = 0;
  std::int64_t faults_ = 0;
  std::vector<double> last_s_;                                         // of the waypoints of each body, then of the listener
  std::map<std::pair<std::int32_t, std::uint64_t>, double> contacts_;  // time of the last record
};

/// Events on their way to a synthesiser. Every event that was added and has no fault is pushed once (the first waypoint of a body twice),
/// in order of due times, by the first push_until() whose time is after its due time.
class EventScheduler {
 public:
  /// False when the synthesiser has no room: the event stays here.
  using Push = std::function<bool(const events::Event&)>;

  /// Body i of the events is bodies[i]; events of others are dropped, and so are those with a fault (events::find_fault), which are
  /// counted.
  EventScheduler(std::vector<ScheduledBody> bodies, double margin_s);
  EventScheduler(const EventScheduler&) = delete;
  EventScheduler& operator=(const EventScheduler&) = delete;

  /// An event, in the order in which they happen. An events::Listener is dropped: the scene says where the listener is.
  void add(const events::Event& event) {
    add(event, [](const DueEvent&) { return true; });
  }
  /// The same for those of its due times for which is_wanted(DueEvent).
  template <class Filter>
  void add(const events::Event& event, Filter&& is_wanted) {
    times_.find(event, [&](const DueEvent& due) {
      if (is_wanted(due)) add(due, event);
    });
  }
  void add(const DueEvent& due, const events::Event& event) { queue_.push({due, event}); }
  void add_listener(std::span<const events::Listener> path);

  /// Pushes what must be known before the samples until `until_s` are made, then a TimeWatermark: physics is known to `known_s`. False when
  /// not all of it was taken.
  bool push_until(double until_s, double known_s, const Push& push);

  std::int64_t get_faults() const { return times_.get_faults(); }

 private:
  struct Queued {
    DueEvent due;
    events::Event event;
    bool operator>(const Queued& other) const { return due > other.due; }
  };

  events::Event make_event(const Queued& queued) const;

  std::vector<ScheduledBody> bodies_;
  DueTimes times_;
  std::priority_queue<Queued, std::vector<Queued>, std::greater<>> queue_;
  double marked_s_;
};

/// Half of the time in which the force of an impulse is not zero; 0 for other events.
double calc_half_length_s(const events::Event& event);

}  // namespace carillon::scene
