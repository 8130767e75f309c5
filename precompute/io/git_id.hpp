// Where the build came from. The value is written by git_id.cmake at every build.
#pragma once

namespace carillon::io {

extern const char* const kGitId;

}  // namespace carillon::io
