// Identity and life of processes; termination by an environment entry.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "jobs/store/process/process.hpp"
#include "tests/support/folder.hpp"

namespace {

namespace fs = std::filesystem;
using namespace carillon;

pid_t start_shell(const char* script, const char* entry) {
  const pid_t child = ::fork();
  if (child == 0) {
    const char* environment[] = {entry, "PATH=/usr/bin:/bin", nullptr};
    ::execle("/bin/sh", "sh", "-c", script, nullptr, environment);
    ::_exit(127);
  }
  return child;
}

void wait_until(const std::function<bool()>& is_true) {
  for (int i = 0; i < 1000 && !is_true(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_TRUE(is_true());
}

TEST(Processes, life_of_processes_and_zombies) {
  const pid_t child = start_shell("exec sleep 1000", "X=1");
  const std::optional<process::Identity> identity = process::find_process(child);
  ASSERT_TRUE(identity);
  EXPECT_EQ(process::find_life(*identity), process::Life::running);
  process::Identity other = *identity;
  other.start_ticks += 1;  // the number was given again
  EXPECT_EQ(process::find_life(other), process::Life::gone);
  other = *identity;
  other.boot = "another-boot:1";
  EXPECT_EQ(process::find_life(other), process::Life::gone);
  other.host = "another-host";
  EXPECT_EQ(process::find_life(other), process::Life::elsewhere);
  ::kill(child, SIGKILL);
  wait_until([&] { return process::find_life(*identity) == process::Life::gone; });  // not buried yet
  ::waitpid(child, nullptr, 0);
  EXPECT_EQ(process::find_life(*identity), process::Life::gone);
  EXPECT_EQ(process::find_life(process::Identity{}), process::Life::gone);
}

TEST(Processes, processes_with_an_environment_entry_are_ended) {
  const std::string entry = "CARILLON_TEST_MARK=" + std::to_string(::getpid());
  const pid_t marked = start_shell("trap '' TERM; (setsid sleep 1000 &) ; setsid sleep 1000 & sleep 1000; sleep 1000", entry.c_str());
  const pid_t other = start_shell("exec sleep 1000", (entry + "0").c_str());
  wait_until([&] { return process::find_with_environment(entry).size() >= 4; });
  EXPECT_GE(process::end_with_environment(entry), 4);
  EXPECT_TRUE(process::find_with_environment(entry).empty());
  ::waitpid(marked, nullptr, 0);
  EXPECT_TRUE(process::find_process(other));
  ::kill(other, SIGKILL);
  ::waitpid(other, nullptr, 0);
}

TEST(Processes, processes_that_end_within_the_grace_are_not_killed) {
  const std::string entry = "CARILLON_TEST_MARK=" + std::to_string(::getpid());
  const pid_t quick = start_shell("sleep 0.3; exit 7", entry.c_str());
  const pid_t slow = start_shell("exec sleep 1000", entry.c_str());
  wait_until([&] { return process::find_with_environment(entry).size() >= 2; });
  EXPECT_GE(process::end_with_environment(entry, 20.0, 1.5), 2);
  int status = 0;
  ::waitpid(quick, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 7);
  ::waitpid(slow, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
}

TEST(Processes, a_lock_is_held_until_its_holder_dies) {
  const tests::Folder folder;
  const fs::path file = folder / "lock";
  EXPECT_FALSE(process::Lock::is_held(file));
  const pid_t holder = ::fork();
  if (holder == 0) {
    const std::optional<process::Lock> lock = process::Lock::take(file);
    for (;;) ::pause();
  }
  wait_until([&] { return process::Lock::is_held(file); });
  EXPECT_FALSE(process::Lock::take(file));
  ::kill(holder, SIGKILL);
  ::waitpid(holder, nullptr, 0);
  EXPECT_FALSE(process::Lock::is_held(file));
  std::optional<process::Lock> lock = process::Lock::take(file);
  EXPECT_TRUE(lock);
  EXPECT_THROW((void)process::Lock::take(folder / "nowhere" / "lock"), SystemError);
}

}  // namespace
