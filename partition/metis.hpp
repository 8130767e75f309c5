// What every call of METIS needs here: options, and its status as an error.
#pragma once

#include <metis.h>

#include <array>
#include <cstdint>

namespace carillon::partition {

static_assert(sizeof(idx_t) == sizeof(std::int32_t), "METIS has to be built with 32-bit indices");

using MetisOptions = std::array<idx_t, METIS_NOPTIONS>;
/// METIS's own, counted from zero, with a seed: the same graph gives the same answer.
MetisOptions make_metis_options();

/// Throws SystemError where METIS did not succeed. what: the call.
void check_metis(int status, const char* what);

}  // namespace carillon::partition
