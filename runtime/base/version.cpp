#include "runtime/base/version.hpp"

#include <fmt/core.h>

#include "runtime/base/git_id.hpp"

namespace carillon::base {

const char* get_number() { return CARILLON_VERSION; }

const char* get_git_id() { return kGitId; }

std::string describe(std::string_view program) {
  const std::string_view id = kGitId;
  return id == "unknown" ? fmt::format("{} {}", program, get_number()) : fmt::format("{} {} ({})", program, get_number(), id);
}

}  // namespace carillon::base
