#include "runtime/events/ring.hpp"

#include <algorithm>
#include <bit>

namespace carillon::events {

EventRing::EventRing(std::size_t events) {
  const std::size_t room = std::bit_ceil(std::max<std::size_t>(events, 2));
  cells_ = std::make_unique<Cell[]>(room);
  mask_ = room - 1;
  for (std::size_t i = 0; i < room; ++i) cells_[i].turn.store(i, std::memory_order_relaxed);
}

bool EventRing::push(const Event& event) noexcept {
  if (find_fault(event) != nullptr) {
    faults_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  std::uint64_t place = tail_.load(std::memory_order_relaxed);
  Cell* cell = nullptr;
  while (true) {
    cell = &cells_[place & mask_];
    const auto ahead = static_cast<std::int64_t>(cell->turn.load(std::memory_order_acquire) - place);
    if (ahead < 0) {  // not yet freed by the reader
      overflows_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    if (ahead > 0) {
      place = tail_.load(std::memory_order_relaxed);
    } else if (tail_.compare_exchange_weak(place, place + 1, std::memory_order_relaxed)) {
      break;
    }
  }
  cell->event = event;
  cell->turn.store(place + 1, std::memory_order_release);
  return true;
}

bool EventRing::pop(Event& event) noexcept {
  Cell& cell = cells_[head_ & mask_];
  if (cell.turn.load(std::memory_order_acquire) != head_ + 1) return false;
  event = cell.event;
  cell.turn.store(head_ + mask_ + 1, std::memory_order_release);
  ++head_;
  return true;
}

}  // namespace carillon::events
