// Names that other names are made of.
#pragma once

#include <string>

namespace carillon::explore {

/// A name of a file short enough for what is added to it there and for the name of a body: at most 100 bytes, of whole characters.
std::string cut_name(std::string name);

}  // namespace carillon::explore
