// The way of events from any thread to the one that plays.
// Method:     a bounded queue in which every cell carries a number that says whose turn it is: a producer takes the next place by raising
//             the tail, writes the cell, and publishes it by its number; so producers never wait for each other, and the reader for none.
// Source:     Vyukov, "Bounded MPMC queue", 1024cores.net, 2010 (with one reader here).
// Deviations: none.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "runtime/events/events.hpp"

namespace carillon::events {

/// Any number of producers, one reader. Memory is taken in the constructor only.
class EventRing {
 public:
  /// Room for at least `events`, rounded up to a power of two, at least 2. Throws std::bad_alloc.
  explicit EventRing(std::size_t events);

  /// False when the ring is full, or when the event has a fault (find_fault); both are counted. [any-thread]: no heap, no lock, no throw.
  bool push(const Event& event) noexcept;

  /// The oldest event. False when there is none. [audio-thread]
  bool pop(Event& event) noexcept;

  std::size_t get_room() const { return mask_ + 1; }
  /// Events that were refused so far: for lack of room, and for a fault. [any-thread]
  std::int64_t get_overflows() const noexcept { return overflows_.load(std::memory_order_relaxed); }
  std::int64_t get_faults() const noexcept { return faults_.load(std::memory_order_relaxed); }

 private:
  struct alignas(64) Cell {
    std::atomic<std::uint64_t> turn{0};  // place: free for the producer of this place; place + 1: to be read
    Event event;
  };

  std::unique_ptr<Cell[]> cells_;
  std::size_t mask_ = 0;
  alignas(64) std::atomic<std::uint64_t> tail_{0};  // places that producers have taken
  alignas(64) std::uint64_t head_ = 0;              // places that were read
  alignas(64) std::atomic<std::int64_t> overflows_{0};
  std::atomic<std::int64_t> faults_{0};
};

}  // namespace carillon::events
