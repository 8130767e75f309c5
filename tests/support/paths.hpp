// Where the sources and the built programs are. Compiled into one object, so that all others are equal in every clone (ccache).
#pragma once

#include <string>

namespace carillon::tests {

/// The root of the sources: get_source_dir() + "/tests/unit/...".
const std::string& get_source_dir();
/// The folder of the built programs.
const std::string& get_bin_dir();

}  // namespace carillon::tests
