// Due times of events, and the queue of events not yet pushed to a synthesiser. Used offline and live.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include "runtime/events/events.hpp"

namespace carillon::scene {

/// Body as seen by the scheduler.
struct ScheduledBody {
  int number = -1;      // in the synthesiser; -1: not played
  bool moves = false;   // its motions are pushed; otherwise its initial position suffices
  double lead_s = 0.0;  // time by which a strike must be known before it begins
};

/// Due time of an event: it must be pushed before later samples are made.
struct DueEvent {
  double due_s = 0.0;
  std::uint64_t number = 0;  // of the event; orders events due at the same time
  bool is_still = false;     // the same pose without velocity, pushed before it
  bool operator>(const DueEvent& other) const {
    if (due_s != other.due_s) return due_s > other.due_s;
    return number != other.number ? number > other.number : is_still < other.is_still;
  }
};

/// Derives due times from the events so far. A pulse is due at its start; a waypoint or contact record at the time of its predecessor,
/// because values are interpolated between the two. Events are given in the order of their numbers.
class DueTimes {
 public:
  /// `bodies` must outlive the result. `margin_s`: extra lead of waypoints and contact records, so that a strike finds the attitude of its
  /// body at the middle of its pulse.
  DueTimes(const std::vector<ScheduledBody>& bodies, double margin_s);

  /// Calls work(DueEvent) for each push of the event: none, one, or two (first waypoint of a body).
  template <class Work>
  void find(const events::Event& event, Work&& work) {
    DueEvent due[2];
    const int count = find(event, due);
    for (int i = 0; i < count; ++i) work(due[i]);
  }
  /// The same for the listener's next waypoint; its numbers follow those of all other events.
  template <class Work>
  void find_listener(const events::Listener& waypoint, Work&& work) {
    DueEvent due[2];
    const int count = find_waypoint(last_s_.back(), waypoint.time_s, kListenerNumbers + listener_number_++, due);
    for (int i = 0; i < count; ++i) work(due[i]);
  }
  /// Invalid events so far (events::find_fault); they are never due.
  std::int64_t get_faults() const { return faults_; }
  /// Appends a body.
  void add_body() { last_s_.insert(last_s_.end() - 1, kNever); }
  /// nullptr for an unplayed body.
  const ScheduledBody* find_body(std::int32_t body) const;

 private:
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  static constexpr std::uint64_t kListenerNumbers = std::uint64_t{1} << 63;

  int find(const events::Event& event, DueEvent* due);
  int find_waypoint(double& last_s, double time_s, std::uint64_t number, DueEvent* due) const;

  const std::vector<ScheduledBody>* bodies_;
  double margin_s_ = 0.0;
  std::uint64_t number_ = 0, listener_number_ = 0;
  std::int64_t faults_ = 0;
  std::vector<double> last_s_;                                         // last waypoint per body, then of the listener
  std::map<std::pair<std::int32_t, std::uint64_t>, double> contacts_;  // time of the last record
};

/// Queue of events for a synthesiser. Every valid event is pushed once (the first waypoint of a body twice), in order of due times, by the
/// first push_until() after its due time.
class EventScheduler {
 public:
  /// Pushes to the synthesiser. False: no room, the event stays queued.
  using Push = std::function<bool(const events::Event&)>;

  /// Body i of the events is bodies[i]. Events of other bodies are dropped; invalid events (events::find_fault) are dropped and counted.
  EventScheduler(std::vector<ScheduledBody> bodies, double margin_s);
  EventScheduler(const EventScheduler&) = delete;
  EventScheduler& operator=(const EventScheduler&) = delete;

  /// Appends a body.
  void add_body(const ScheduledBody& body) {
    bodies_.push_back(body);
    times_.add_body();
  }

  /// Adds an event, in order of time. events::Listener is ignored: the scene defines the listener.
  void add(const events::Event& event) {
    add(event, [](const DueEvent&) { return true; });
  }
  /// The same, only for due times with is_wanted(DueEvent).
  template <class Filter>
  void add(const events::Event& event, Filter&& is_wanted) {
    times_.find(event, [&](const DueEvent& due) {
      if (is_wanted(due)) add(due, event);
    });
  }
  void add(const DueEvent& due, const events::Event& event) { queue_.push({due, event}); }
  void add_listener(std::span<const events::Listener> path);

  /// Pushes the events needed for the samples before `until_s`, then a TimeWatermark: physics is known to `known_s`. False if an event was
  /// not accepted.
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

/// Half the duration of an impulse; 0 for other events.
double calc_half_length_s(const events::Event& event);

}  // namespace carillon::scene
