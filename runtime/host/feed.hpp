// The events of a scene that is known to its end, handed to a synthesiser as it needs them.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include "runtime/host/events.hpp"
#include "runtime/stream/events.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::host {

/// What a feed needs to know of a body.
struct FedBody {
  int number = -1;      // in the synthesiser; -1: not played
  bool moves = false;   // its motions are handed on; of a body that does not move its place is enough
  double lead_s = 0.0;  // by which a strike has to be known before it begins
};

class Feed {
 public:
  /// `events` and `walk` must outlive the feed; body i of them is bodies[i], events of others are left out. No event may be earlier than
  /// one before it by more than a second. `walk` is the listener's.
  Feed(const Events& events, std::vector<FedBody> bodies, std::span<const stream::Listener> walk);

  Feed(const Feed&) = delete;
  Feed& operator=(const Feed&) = delete;

  /// Waypoints that are to be remembered of each body, and behind them of the listener, when its sound travels for at most longest_s[body];
  /// the listener's place of `longest_s` may be left out. Goes through all events.
  std::vector<int> count_waypoints(std::span<const double> longest_s) const;

  /// Hands on what must be known before the samples until `until_s` are made. The synthesiser must be between two calls of process();
  /// what does not fit into its ring at once goes in parts. [main-thread], and the audio thread's place.
  void hand_on(double until_s, synth::Synthesiser& synthesiser);

 private:
  struct Item {
    double due_s = 0.0;       // it must be known before anything at this time is made
    std::uint64_t event = 0;  // of events_, then of walk_
    bool is_still = false;    // the same without its velocity, and before it
    bool operator>(const Item& other) const {
      if (due_s != other.due_s) return due_s > other.due_s;
      return event != other.event ? event > other.event : is_still < other.is_still;
    }
  };
  struct Held {
    Item item;
    stream::Event event;
    bool operator>(const Held& other) const { return item > other.item; }
  };
  /// When events are due, which follows from those before them.
  class Times;

  const FedBody* find(std::int32_t body) const;
  stream::Event make_event(const Item& item, stream::Event event) const;
  void read_until(double until_s);

  const Events* events_;
  std::span<const stream::Listener> walk_;
  std::vector<FedBody> bodies_;
  double margin_s_ = 0.0;  // by which ways are known longer ahead than they need to be
  bool has_contacts_ = false;
  double end_s_ = -1e300;    // when the last thing happens
  std::vector<Item> early_;  // in order, what is due long before it happens; the walk
  std::size_t next_early_ = 0;
  // Of what is due shortly before it happens as much as may be due now.
  std::shared_ptr<Times> times_;
  Events::Reader reader_;
  double read_s_ = -1e300;  // latest event that was read
  std::priority_queue<Held, std::vector<Held>, std::greater<>> held_;
};

}  // namespace carillon::host
