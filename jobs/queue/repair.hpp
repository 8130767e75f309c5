// What is damaged in a store is made again from what is whole.
#pragma once

#include <optional>
#include <string>

#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

/// The request of a job, from its folder of work, from that of its bank, else from the log of submissions: the first that gives this id.
std::optional<store::Request> find_request(const store::Store& store, const registry::Registry& registry, const store::Id& id);

/// Makes a job without a running attempt ready to be computed: sets a damaged bank aside, copies a damaged input again from where it was
/// submitted from, and makes a missing or damaged folder of work again. Its row stays as it is. Why that cannot be, in one sentence; none
/// when it is ready. SystemError when the disk refuses.
std::optional<std::string> restore(const store::Store& store, const registry::Registry& registry, const store::Id& id);

}  // namespace carillon::queue
