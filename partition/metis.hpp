// Calls of METIS: options, errors, signals.
#pragma once

#include <metis.h>

#include <array>
#include <cstdint>
#include <functional>

namespace carillon::partition {

static_assert(sizeof(idx_t) == sizeof(std::int32_t), "METIS has to be built with 32-bit indices");

using MetisOptions = std::array<idx_t, METIS_NOPTIONS>;
/// Default options with zero-based numbering and a fixed seed: deterministic.
MetisOptions make_metis_options();

/// Calls METIS; throws SystemError on failure. what: name of the call. A SIGTERM runs the handler of the program at once, and METIS
/// continues when it returns.
void call_metis(const char* what, const std::function<int()>& call);

}  // namespace carillon::partition
