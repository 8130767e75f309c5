// Which Carillon this is: what every program prints for --version.
#pragma once

#include <string>
#include <string_view>

namespace carillon::base {

/// "carillon-mesh 0.1.0 (3f2a...)": name, version and commit of the build; without the brackets where the commit is not known.
std::string describe(std::string_view program);

/// "0.1.0".
const char* get_number();

/// The commit that this build was made from, "-dirty" appended when tracked files differ from it; "unknown" outside git.
const char* get_git_id();

}  // namespace carillon::base
