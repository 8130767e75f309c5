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

/// Throws SystemError where METIS did not succeed. what: the call.
void check_metis(int status, const char* what);

/// check_metis(call(), what) for calls that take SIGTERM for themselves, which are all but METIS_ComputeVertexSeparator: it comes to the
/// handler that the program set, at once, in some thread. Two threads must not be in it at a time.
void call_metis(const char* what, const std::function<int()>& call);

}  // namespace carillon::partition
