// Events as rows of numbers: how they pass from JavaScript, and from one WebAssembly memory to another.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "runtime/events/events.hpp"

namespace carillon::web {

/// When an event is meant.
enum class Timing {
  kExact,  // at its time
  kSoon    // as soon as possible, later by its time [s]; a waypoint: reached soon, along a smooth path
};

/// An event as one row: its length in words, its kind, its Timing, its time [s], and its fields in the order of events.hpp, vectors one
/// word a component; of a Force as many rows of three as it has steps, of a LastingContact the id as its upper and lower 32 bits.
/// Kinds are the places of events::Event: 0 mark, 1 impulse, 2 force, 3 contact, 4 motion, 5 listener.
void append_words(std::vector<double>& words, const events::Event& event, Timing timing = Timing::kExact);

/// Gives the events of any number of rows to `sink` in their order. Throws InputError for malformed rows: a wrong length, an
/// unknown kind, an index out of range. The values of events are not checked (events::find_fault).
void read_words(std::span<const double> words, const std::function<void(const events::Event&, Timing)>& sink);

}  // namespace carillon::web
