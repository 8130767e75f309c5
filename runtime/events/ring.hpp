// Lock-free queue of events from any thread to the audio thread.
// Method: bounded queue with a turn number per cell: a producer claims a place by advancing the tail, writes the cell and publishes it by
//   its turn number; neither producers nor reader wait.
// Source: Vyukov, "Bounded MPMC queue", 1024cores.net, 2010 (here with one reader).
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "runtime/events/events.hpp"

namespace carillon::events {

/// Multiple producers, single reader. Allocates in the constructor only.
class EventRing {
 public:
  /// Capacity: at least `events`, rounded up to a power of two, at least 2. Throws std::bad_alloc.
  explicit EventRing(std::size_t events);

  /// False if the ring is full or the event is invalid (find_fault); both are counted. [any-thread]: no heap, no lock, no throw.
  bool push(const Event& event) noexcept;

  /// Removes the oldest event; false if empty. [audio-thread]
  bool pop(Event& event) noexcept;

  std::size_t get_room() const { return mask_ + 1; }
  /// Events rejected so far: ring full; invalid. [any-thread]
  std::int64_t get_overflows() const noexcept { return overflows_.load(std::memory_order_relaxed); }
  std::int64_t get_faults() const noexcept { return faults_.load(std::memory_order_relaxed); }

 private:
  struct alignas(64) Cell {
    std::atomic<std::uint64_t> turn{0};  // place: free for its producer; place + 1: to be read
    Event event;
  };

  std::unique_ptr<Cell[]> cells_;
  std::size_t mask_ = 0;
  alignas(64) std::atomic<std::uint64_t> tail_{0};  // places claimed by producers
  alignas(64) std::uint64_t head_ = 0;              // places read
  alignas(64) std::atomic<std::int64_t> overflows_{0};
  std::atomic<std::int64_t> faults_{0};
};

}  // namespace carillon::events
