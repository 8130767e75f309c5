// What every call of METIS needs here.
#pragma once

#include <metis.h>

#include <cstdint>

namespace carillon::partition {

static_assert(sizeof(idx_t) == sizeof(std::int32_t), "METIS has to be built with 32-bit indices");

inline constexpr idx_t kSeed = 1;  // the same graph gives the same answer

/// Throws SystemError where METIS did not succeed. what: the call.
void check_metis(int status, const char* what);

}  // namespace carillon::partition
