// Repair of damaged jobs in a store.
#pragma once

#include <optional>
#include <string>

#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

/// The request of a job, from its folder of work, its bank, or the log of submissions: the first with this id.
std::optional<store::Request> find_request(const store::Store& store, const registry::Registry& registry, const store::Id& id);

/// Prepares a job without a running attempt for computation: sets a damaged bank aside, copies damaged inputs again from their original
/// paths, rebuilds a missing or damaged folder of work. Does not change its row. Returns the reason if impossible, in one sentence.
/// SystemError when the disk refuses.
std::optional<std::string> restore(const store::Store& store, const registry::Registry& registry, const store::Id& id);

}  // namespace carillon::queue
