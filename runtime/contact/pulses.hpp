// What an impact gives to the sound: one pulse for every spot and body.
#pragma once

#include <vector>

#include "runtime/contact/lasting.hpp"
#include "runtime/rigid/space.hpp"
#include "runtime/stream/events.hpp"

namespace carillon::contact {

/// Gathers the points of an impact into spots, strongest first, and appends one pulse a spot and body. `lasting` is told of it.
void add_pulses(const rigid::Space& space, const rigid::Strike& strike, LastingContacts& lasting, std::vector<stream::Event>& events);

}  // namespace carillon::contact
