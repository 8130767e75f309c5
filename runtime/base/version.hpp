// Version and commit of this build, as printed by --version.
#pragma once

#include <string>
#include <string_view>

namespace carillon::base {

/// "carillon-mesh 0.1.0 (3f2a...)": name, version and commit; no parentheses if the commit is unknown.
std::string describe(std::string_view program);

/// "0.1.0".
const char* get_number();

/// Commit of the build, with "-dirty" if tracked files differ from it; "unknown" outside git.
const char* get_git_id();

}  // namespace carillon::base
