// What every call of METIS needs here: options, its status as an error, and signals that reach the program.
#pragma once

#include <metis.h>

#include <array>
#include <cstdint>
#include <functional>

namespace carillon::partition {

static_assert(sizeof(idx_t) == sizeof(std::int32_t), "METIS has to be built with 32-bit indices");

using MetisOptions = std::array<idx_t, METIS_NOPTIONS>;
/// METIS's own, counted from zero, with a seed: the same graph gives the same answer.
MetisOptions make_metis_options();

/// Calls METIS, and throws SystemError where it did not succeed. what: the name of the call. Signals are left to the program: a SIGTERM
/// runs its handler at once, and METIS continues when that returns.
void call_metis(const char* what, const std::function<int()>& call);

}  // namespace carillon::partition
