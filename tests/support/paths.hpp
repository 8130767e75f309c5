// Paths of sources and built programs. Compiled into one object, so that all others are equal in every clone (ccache).
#pragma once

#include <string>

namespace carillon::tests {

/// Root of the sources: get_source_dir() + "/tests/unit/...".
const std::string& get_source_dir();
/// Folder of the built programs.
const std::string& get_bin_dir();

}  // namespace carillon::tests
