// Jobs as text lines.
#pragma once

#include <string>
#include <vector>

#include "jobs/cli/shared.hpp"

namespace carillon::cli {

/// One line per job (and one for its reason), running jobs first, at most `rows` lines of `columns` characters, and a line of counts.
std::vector<std::string> format_bars(Shared& shared, const std::vector<registry::Job>& jobs, std::size_t rows, std::size_t columns);

}  // namespace carillon::cli
