// Commit of the build, written by git_id.cmake at every build. Internal to carillon::base.
#pragma once

namespace carillon::base {

extern const char* const kGitId;

}  // namespace carillon::base
