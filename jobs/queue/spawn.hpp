// Starts attempts.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::queue {

/// Starts arguments[0] in a session of its own, with no input and its output appended to `log`. It outlives this process. SystemError when
/// it cannot be started.
pid_t spawn(const std::vector<std::string>& arguments, const std::filesystem::path& log);

}  // namespace carillon::queue
