// Truncation of names.
#pragma once

#include <string>

namespace carillon::explore {

/// Truncates to 100 bytes at a character boundary: space for suffixes, and the limit of body names.
std::string cut_name(std::string name);

}  // namespace carillon::explore
