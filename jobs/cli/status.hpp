// Jobs as lines for people.
#pragma once

#include <string>
#include <vector>

#include "jobs/cli/shared.hpp"

namespace carillon::cli {

/// A line a job (and one for its reason), those that run first, at most `rows` lines of `columns` characters, and a line of counts.
std::vector<std::string> format_bars(Shared& shared, const std::vector<registry::Job>& jobs, std::size_t rows, std::size_t columns);

}  // namespace carillon::cli
