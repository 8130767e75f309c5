// The events of a scene that is known to its end, handed to a synthesiser as it needs them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "runtime/stream/events.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::host {

/// What a feed needs to know of a body.
struct FedBody {
  int number = -1;      // in the synthesiser; -1: nobody hears of it
  bool moves = false;   // its motions are handed on; of a body that does not move its place is enough
  double lead_s = 0.0;  // by which a strike has to be known before it begins
};

class Feed {
 public:
  /// `events` and `walk` must outlive the feed; body i of them is bodies[i], events of others are left out. `walk` is the listener's.
  Feed(std::span<const stream::Event> events, std::vector<FedBody> bodies, std::span<const stream::Listener> walk);

  /// Waypoints that are to be remembered of a body (-1: of the listener), when sound travels for at most `longest_s`.
  int count_waypoints(int body, double longest_s) const;

  /// Hands on what must be known before the samples until `until_s` are made. The synthesiser must be between two calls of process();
  /// what does not fit into its ring at once goes in parts. [main-thread], and the audio thread's place.
  void hand_on(double until_s, synth::Synthesiser& synthesiser);

 private:
  struct Item {
    double due_s = 0.0;     // it must be known before anything at this time is made
    std::size_t event = 0;  // of events_, then of walk_
    bool is_still = false;  // the same without its velocity
  };
  stream::Event make_event(const Item& item) const;

  std::span<const stream::Event> events_;
  std::span<const stream::Listener> walk_;
  std::vector<FedBody> bodies_;
  std::vector<Item> items_;                   // in order of due_s
  std::vector<std::vector<double>> times_s_;  // of the motions of each body, then of the listener
  double margin_s_ = 0.0;                     // by which ways are known longer ahead than they need to be
  bool has_contacts_ = false;
  double end_s_ = -1e300;  // when the last thing happens
  std::size_t next_ = 0;
};

}  // namespace carillon::host
