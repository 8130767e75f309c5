// The cache of banks without a solver.
#include "jobs/front/cache/cache.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"

namespace carillon::cache {
namespace {

TEST(Cache, default_folder) {
  const char* const kept_home = std::getenv("HOME");
  const std::string home = kept_home == nullptr ? "" : kept_home;
  ::setenv("XDG_CACHE_HOME", "/a", 1);
  EXPECT_EQ(find_default_cache(), "/a/carillon");
  ::setenv("XDG_CACHE_HOME", "relative", 1);
  ::setenv("HOME", "/h", 1);
  EXPECT_EQ(find_default_cache(), "/h/.cache/carillon");
  ::unsetenv("HOME");
  EXPECT_THROW(find_default_cache(), SystemError);
  ::unsetenv("XDG_CACHE_HOME");
  if (kept_home != nullptr) ::setenv("HOME", home.c_str(), 1);
}

TEST(Cache, unusable_folder_and_missing_input_leave_nothing) {
  const tests::Folder folder;
  const job::JobSpec job = job::parse_job(R"({"mesh": "nowhere.msh", "material": "steel", "bank": "b.hdf"})", folder / "scene.json");
  tests::expect_error<InputError>({"nowhere.msh"}, [&] { find_or_make(job, "solver", folder / "cache", true); });
  EXPECT_TRUE(std::filesystem::is_empty(folder / "cache/tmp"));
  EXPECT_THROW(find_or_make(job, "solver", folder.write("file", "") / "cache", true), SystemError);
}

}  // namespace
}  // namespace carillon::cache
