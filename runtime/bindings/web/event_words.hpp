// Events as rows of numbers: their form between JavaScript and WebAssembly memories.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "runtime/events/events.hpp"

namespace carillon::web {

/// Timing of an event.
enum class Timing {
  kExact,  // at its time
  kSoon    // as soon as possible, delayed by its time [s]; a waypoint is reached soon along a smooth path
};

/// An event as one row: length in words, kind, Timing, time [s], and the fields in the order of events.hpp, one word per vector component.
/// A Force has one row of three per step; a LastingContact has its id as upper and lower 32 bits. Kinds are the indices of events::Event: 0
/// mark, 1 impulse, 2 force, 3 contact, 4 motion, 5 listener.
void append_words(std::vector<double>& words, const events::Event& event, Timing timing = Timing::kExact);

/// Passes the events of any number of rows to `sink` in order. Throws InputError for malformed rows: wrong length, unknown kind, index out
/// of range. Event values are not checked (see events::find_fault).
void read_words(std::span<const double> words, const std::function<void(const events::Event&, Timing)>& sink);

}  // namespace carillon::web
