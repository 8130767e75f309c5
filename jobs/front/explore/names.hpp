// Names as parts of longer names.
#pragma once

#include <string>

namespace carillon::explore {

/// Cuts a name to 100 bytes at a character boundary: room for suffixes of file names, and the limit of a body's name.
std::string cut_name(std::string name);

}  // namespace carillon::explore
