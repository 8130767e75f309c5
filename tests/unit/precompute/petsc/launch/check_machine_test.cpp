// Errors for machines that do not meet the requirements of Open MPI.
#include "precompute/petsc/launch/check_machine.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdlib>
#include <string>

#include "runtime/base/error.hpp"

namespace carillon::launch {
namespace {

/// Exits with 0 after a refusal with this text.
[[noreturn]] void expect_refusal(const char* words) {
  try {
    check_machine();
  } catch (const SystemError& error) {
    std::_Exit(std::string(error.what()).find(words) != std::string::npos ? 0 : 1);
  }
  std::_Exit(2);
}

TEST(CheckMachine, accepts_this_machine_and_a_missing_folder) {
  EXPECT_NO_THROW(check_machine());
  EXPECT_EXIT(::setenv("TMPDIR", "/does/not/exist", 1); check_machine(); std::_Exit(0), ::testing::ExitedWithCode(0), "");
}

TEST(CheckMachine, names_a_temporary_folder_that_takes_no_files) {
  EXPECT_EXIT(::setenv("TMPDIR", "/proc", 1); expect_refusal("/proc: cannot create temporary files"), ::testing::ExitedWithCode(0), "");
}

TEST(CheckMachine, names_a_limit_on_the_size_of_files) {
  const rlimit limit{20'000, 20'000};
  EXPECT_EXIT(::setrlimit(RLIMIT_FSIZE, &limit);
              expect_refusal("the file size limit is 20000 bytes (ulimit -f"), ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace carillon::launch
