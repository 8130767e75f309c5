// Where the build came from. The value is written by git_id.cmake at every build. Internal to carillon::version.
#pragma once

namespace carillon::version {

extern const char* const kGitId;

}  // namespace carillon::version
