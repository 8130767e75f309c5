// Temporary folders after all ways of ending a process, with real signals.
#include "runtime/base/temporary.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "runtime/base/command.hpp"

namespace carillon::base {
namespace {

namespace fs = std::filesystem;

class Temporary : public testing::Test {
 protected:
  Temporary() {
    std::string name = (fs::temp_directory_path() / "temporary-test-XXXXXX").string();
    parent_ = ::mkdtemp(name.data());
  }
  ~Temporary() override { fs::remove_all(parent_); }

  /// Exit status of a process with a full folder that receives the signal inside `wait`.
  template <class Wait>
  int end_one(int signal, const Wait& wait) {
    int ready[2];
    EXPECT_EQ(::pipe(ready), 0);
    const pid_t child = ::fork();
    if (child == 0) {
      const TemporaryFolder folder(parent_, ".page.");
      fs::create_directories(folder.path() / "a/b");
      std::ofstream(folder.path() / "a/b/bank.hdf") << "content";
      (void)!::write(ready[1], "1", 1);
      wait(folder);
      ::_exit(0);
    }
    char got = 0;
    EXPECT_EQ(::read(ready[0], &got, 1), 1);
    ::close(ready[0]);
    ::close(ready[1]);
    ::kill(child, signal);
    int status = 0;
    EXPECT_EQ(::waitpid(child, &status, 0), child);
    return status;
  }
  static void sleep_for_long(const TemporaryFolder&) {
    for (;;) ::pause();
  }

  bool is_empty() const { return fs::is_empty(parent_); }

  fs::path parent_;
};

TEST_F(Temporary, ends_with_its_scope_unless_kept) {
  {
    const TemporaryFolder folder(parent_, "carillon-");
    std::ofstream(folder.path() / "file") << "content";
    EXPECT_FALSE(is_empty());
  }
  EXPECT_TRUE(is_empty());
  const fs::path kept = make_temporary_folder(parent_, ".page.");
  std::ofstream(kept / "index.html") << "content";
  keep_temporary_folder(kept);
  (void)TemporaryFolder(parent_, ".page.");
  EXPECT_EQ(std::distance(fs::directory_iterator(kept), fs::directory_iterator()), 1);  // without the lock file
}

TEST_F(Temporary, is_removed_after_a_signal_to_a_second_thread) {
  for (int k = 0; k < 200; ++k) {
    int ready[2];
    ASSERT_EQ(::pipe(ready), 0);
    const pid_t child = ::fork();
    if (child == 0) {
      std::thread([] {
        for (;;) ::pause();
      }).detach();
      const TemporaryFolder first(parent_, ".page.");
      (void)!::write(ready[1], "1", 1);
      for (;;) TemporaryFolder(parent_, ".page.");
    }
    char got = 0;
    ASSERT_EQ(::read(ready[0], &got, 1), 1);
    ::close(ready[0]);
    ::close(ready[1]);
    ::usleep(7 * k);
    ::kill(child, SIGTERM);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM) << status;
    ASSERT_TRUE(is_empty()) << k;
  }
}

TEST_F(Temporary, is_removed_after_a_signal) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const int status = end_one(signal, sleep_for_long);
    EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == signal) << status;  // terminated by the signal itself
    EXPECT_TRUE(is_empty()) << signal;
  }
}

TEST_F(Temporary, is_removed_with_a_writing_child) {
  const int status = end_one(SIGTERM, [](const TemporaryFolder& folder) {
    (void)run({.words = {"sh", "-c", "i=0; while :; do i=$((i+1)); mkdir -p d$i; : >d$i/f; done"}, .folder = folder.path()});
  });
  EXPECT_TRUE(WIFSIGNALED(status)) << status;
  EXPECT_TRUE(is_empty());
}

TEST_F(Temporary, of_a_killed_process_is_removed_by_the_next) {
  end_one(SIGKILL, sleep_for_long);
  EXPECT_FALSE(is_empty());
  (void)TemporaryFolder(parent_, ".other.");
  EXPECT_FALSE(is_empty());
  (void)TemporaryFolder(parent_, ".page.");
  EXPECT_TRUE(is_empty());
}

TEST_F(Temporary, leaves_other_folders) {
  fs::create_directory(parent_ / ".page.backup");  // a user's folder of similar name
  const TemporaryFolder mine(parent_, ".page.");   // in use
  (void)TemporaryFolder(parent_, ".page.");
  EXPECT_TRUE(fs::exists(parent_ / ".page.backup"));
  EXPECT_TRUE(fs::exists(mine.path()));
}

TEST_F(Temporary, leaves_ignored_signals) {
  ::signal(SIGHUP, SIG_IGN);  // nohup
  {
    const TemporaryFolder folder(parent_, "carillon-");
    ::raise(SIGHUP);
    EXPECT_TRUE(fs::exists(folder.path()));
  }
  struct sigaction action {};
  ::sigaction(SIGHUP, nullptr, &action);
  EXPECT_EQ(action.sa_handler, SIG_IGN);
  ::sigaction(SIGTERM, nullptr, &action);
  EXPECT_EQ(action.sa_handler, SIG_DFL);
  ::signal(SIGHUP, SIG_DFL);
}

}  // namespace
}  // namespace carillon::base
