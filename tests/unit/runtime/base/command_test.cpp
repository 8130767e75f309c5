// Child processes with real programs: start, input, output, termination, no zombies.
#include "runtime/base/command.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/descriptor.hpp"
#include "runtime/base/environment.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::base {
namespace {

namespace fs = std::filesystem;

Command make_shell(const std::string& script) { return {.words = {"sh", "-c", script}, .output = kCapture, .errors = kCapture}; }

/// Open descriptors of this process.
std::ptrdiff_t count_descriptors() { return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator()); }

TEST(Command, returns_output_and_exit_status) {
  const Finished finished = run(make_shell("echo out; echo err >&2; exit 3"));
  EXPECT_EQ(finished.output, "out\n");
  EXPECT_EQ(finished.errors, "err\n");
  EXPECT_EQ(finished.exit_code, 3);
  EXPECT_EQ(finished.signal, 0);
  const Finished killed = run(make_shell("kill -SEGV $$"));
  EXPECT_EQ(killed.signal, SIGSEGV);
  EXPECT_EQ(killed.exit_code, 128 + SIGSEGV);
}

TEST(Command, is_not_a_rank_of_this_run) {
  // Per-rank variables of mpirun (Open MPI 4.1), and user settings.
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK", "OMPI_MCA_ess", "OMPI_MCA_orte_hnp_uri", "PMIX_RANK", "PMIX_ID",
                           "PRTE_LAUNCHED", "PMI_RANK", "OMPI_MCA_btl", "PRTE_MCA_rmaps_default_mapping_policy", "SLURM_JOB_ID"})
    ::setenv(name, "x", 1);
  const auto list = [](const std::vector<std::string>& environment) {
    return run({.words = {"sh", "-c", "env | grep -E '^(OMPI|PMI|PRTE|SLURM)' | sort"}, .environment = environment, .output = kCapture})
        .output;
  };
  const std::string own = run(make_shell("env | grep -E '^(OMPI|PMI|PRTE|SLURM)' | sort")).output;
  EXPECT_NE(own.find("OMPI_MCA_btl=x\n"), std::string::npos) << own;
  EXPECT_NE(own.find("PRTE_MCA_rmaps_default_mapping_policy=x\n"), std::string::npos) << own;
  EXPECT_NE(own.find("SLURM_JOB_ID=x\n"), std::string::npos) << own;
  for (const char* begin : {"OMPI_COMM", "OMPI_MCA_ess", "OMPI_MCA_orte", "PMI", "PRTE_LAUNCHED"})
    EXPECT_EQ(own.find(begin), std::string::npos) << own;
  EXPECT_EQ(list(make_environment()), own);
  const std::string lone = list(make_lone_environment());
  EXPECT_NE(lone.find("OMPI_MCA_ess_singleton_isolated=1\n"), std::string::npos) << lone;
  EXPECT_NE(lone.find("OMPI_MCA_orte_create_session_dirs=0\n"), std::string::npos) << lone;
  EXPECT_EQ(lone.find("SLURM_"), std::string::npos) << lone;
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK", "OMPI_MCA_ess", "OMPI_MCA_orte_hnp_uri", "PMIX_RANK", "PMIX_ID",
                           "PRTE_LAUNCHED", "PMI_RANK", "OMPI_MCA_btl", "PRTE_MCA_rmaps_default_mapping_policy", "SLURM_JOB_ID"})
    ::unsetenv(name);
}

TEST(Command, arguments_are_passed_unchanged) {
  const std::string odd = "a b'c\"$HOME `x` * \\ \n;";
  const Finished finished = run({.words = {"printf", "%s", odd}, .output = kCapture});
  EXPECT_EQ(finished.output, odd);
}

TEST(Command, input_may_exceed_the_pipe_buffer) {
  std::string input(10 << 20, 'x');
  for (std::size_t i = 0; i < input.size(); i += 1009) input[i] = static_cast<char>('a' + i % 26);
  const Finished finished = run({.words = {"cat"}, .output = kCapture}, {.input = input});
  EXPECT_EQ(finished.output, input);
  EXPECT_EQ(run({.words = {"true"}, .output = kCapture}, {.input = input}).exit_code, 0) << "one that takes none";
}

TEST(Command, start_errors_state_the_reason) {
  const std::ptrdiff_t before = count_descriptors();
  for (const std::string& program :
       {std::string("/no/such/program"), std::string("no-such-program-anywhere"), std::string("/etc/passwd")}) {
    tests::expect_error<StartError>({program + ": cannot be started: "}, [&] { run({.words = {program}}); });
  }
  EXPECT_THROW(run({.words = {"true"}, .folder = "/no/such/folder"}), StartError);
  EXPECT_EQ(count_descriptors(), before);
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1) << "a zombie";
}

TEST(Command, slow_long_and_stopped_programs_are_killed) {  // a survivor exceeds the time limit of this test
  EXPECT_TRUE(run({.words = {"sleep", "1000"}, .output = kCapture}, {.patience_s = 0.2}).was_slow);
  EXPECT_TRUE(run(make_shell("exec >&- 2>&-; sleep 1000"), {.patience_s = 0.2}).was_slow) << "it has closed its outputs";
  EXPECT_TRUE(run(make_shell("yes"), {.max_bytes = 100000}).was_long);
  int asked = 0;
  const Finished stopped =
      run(make_shell("echo now; sleep 1000"), {.may_stop = [&](const Finished& now) { return ++asked > 1 && now.output == "now\n"; }});
  EXPECT_TRUE(stopped.was_stopped);
  EXPECT_EQ(stopped.signal, SIGKILL);
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1) << "a zombie";
}

TEST(Command, the_tail_of_long_output_is_kept) {
  const Finished finished =
      run(make_shell("i=0; while [ $i -lt 3000 ]; do echo line $i; i=$((i+1)); done"), {.max_bytes = 50, .keeps_tail = true});
  EXPECT_EQ(finished.exit_code, 0);
  EXPECT_EQ(finished.output.size(), 50u);
  EXPECT_TRUE(finished.output.ends_with("line 2998\nline 2999\n"));
}

TEST(Command, folder_environment_session_and_signals_are_applied) {
  Command command = make_shell("pwd; echo $WORD; echo $HOME; cut -d ' ' -f 6 /proc/$$/stat; echo $$");
  command.folder = "/";
  command.environment = {"WORD=given", "PATH=/usr/bin:/bin"};
  command.group = Command::Group::session;
  const Finished finished = run(command);
  std::istringstream lines(finished.output);
  std::string folder, word, home, session, own;
  std::getline(lines, folder), std::getline(lines, word), std::getline(lines, home), std::getline(lines, session), std::getline(lines, own);
  EXPECT_EQ(folder, "/");
  EXPECT_EQ(word, "given");
  EXPECT_EQ(home, "");
  EXPECT_EQ(session, own);
  const Finished mask = run({.words = {"grep", "SigBlk", "/proc/self/status"}, .output = kCapture, .blocked = {SIGUSR1}});
  EXPECT_TRUE(mask.output.ends_with("0000000200\n")) << mask.output;
}

TEST(Command, signals_that_this_process_ignores_stay_ignored_unless_asked) {
  ::signal(SIGTERM, SIG_IGN);
  Command command = make_shell("kill -TERM $$; echo alive");
  const Finished as_here = run(command);
  command.default_signals = true;
  const Finished by_default = run(command);
  ::signal(SIGTERM, SIG_DFL);
  EXPECT_EQ(as_here.output, "alive\n");
  EXPECT_EQ(by_default.signal, SIGTERM);
  EXPECT_EQ(by_default.output, "");
}

// As under a parent that ignores SIGCHLD: the kernel would discard the status.
TEST(Command, the_status_of_a_child_is_never_lost) {
  ::signal(SIGCHLD, SIG_IGN);
  const Finished failed = run(make_shell("exit 7"));
  ::signal(SIGCHLD, SIG_DFL);
  EXPECT_EQ(failed.exit_code, 7);
}

TEST(Command, a_continuously_printing_program_is_stopped) {
  const auto begin = std::chrono::steady_clock::now();
  const auto is_late = [&](const Finished&) { return std::chrono::steady_clock::now() - begin > std::chrono::milliseconds(300); };
  const Finished stopped = run(make_shell("yes"), {.patience_s = 20.0, .max_bytes = 1000, .keeps_tail = true, .may_stop = is_late});
  EXPECT_TRUE(stopped.was_stopped);
  EXPECT_FALSE(stopped.was_slow);
}

TEST(Command, a_non_executable_is_not_passed_to_a_shell) {
  const fs::path file = fs::temp_directory_path() / "carillon-no-program";
  std::ofstream(file) << "exit 0\n";
  fs::permissions(file, fs::perms::owner_all);
  try {
    run({.words = {file}});
    ADD_FAILURE() << "it ran";
  } catch (const StartError& error) {
    EXPECT_EQ(error.get_error(), ENOEXEC);
  }
  fs::remove(file);
}

TEST(Command, input_works_without_captured_output) {
  const fs::path file = fs::temp_directory_path() / "carillon-input";
  EXPECT_EQ(run({.words = {"sh", "-c", "exec >&- 2>&-; cat > " + file.string()}}, {.input = "all of it", .patience_s = 20.0}).exit_code, 0);
  std::string text;
  std::getline(std::ifstream(file), text);
  EXPECT_EQ(text, "all of it");
  fs::remove(file);
}

TEST(Command, an_exception_kills_the_program) {
  pid_t child = 0;
  EXPECT_THROW(run({.words = {"sleep", "60"}}, {.started = [&](pid_t pid) { child = pid, throw SystemError("stop"); }}), SystemError);
  EXPECT_EQ(::kill(child, 0), -1);
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1) << "a zombie";
}

TEST(Command, a_program_ends_with_its_parent) {
  // A child of this process starts one, and is killed.
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const pid_t middle = ::fork();
  if (middle == 0) {
    const pid_t last = start({.words = {"sleep", "60"}, .signal_at_end = SIGKILL});
    (void)!::write(ends[1], &last, sizeof last);
    ::pause();
    ::_exit(0);
  }
  pid_t last = 0;
  ASSERT_EQ(::read(ends[0], &last, sizeof last), static_cast<ssize_t>(sizeof last));
  ::kill(middle, SIGKILL);
  ::waitpid(middle, nullptr, 0);
  bool is_gone = false;
  for (int look = 0; look < 1000 && !is_gone; ++look) {
    std::ifstream stat("/proc/" + std::to_string(last) + "/stat");
    std::string number, name, state;
    is_gone = !(stat >> number >> name >> state) || state == "Z";
    if (!is_gone) ::usleep(10000);
  }
  EXPECT_TRUE(is_gone);
  ::close(ends[0]);
  ::close(ends[1]);
}

/// Exit code of a child; -1: it is none of this process.
int await_child(pid_t child) {
  int status = 0;
  if (::waitpid(child, &status, 0) != child) return -1;
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

TEST(Command, a_function_runs_in_a_fork_like_a_program) {
  const Descriptor marked(::open("/dev/null", O_RDONLY | O_CLOEXEC)), kept(::open("/dev/null", O_RDONLY));
  int count = 0;
  const auto function = [&] {
    ++count;
    const bool is_right = ::fcntl(marked.get(), F_GETFD) < 0 && ::fcntl(kept.get(), F_GETFD) == 0 && ::getsid(0) == ::getpid() &&
                          fs::current_path() == "/usr" && std::string_view(std::getenv("NAME")) == "value" && ::getenv("PATH") == nullptr;
    return is_right ? 7 : 1;
  };
  const std::vector<std::string> environment{"NAME=value"};
  const auto begin = [&](const std::function<int()>& work) {
    return start({.words = {"work"}, .environment = environment, .folder = "/usr", .group = Command::Group::session, .function = work});
  };
  EXPECT_EQ(await_child(begin(function)), 7);
  EXPECT_EQ(count, 0);
  EXPECT_EQ(await_child(begin([]() -> int { throw SystemError("refused"); })), kExitSystem);
  EXPECT_EQ(await_child(begin([] { return ::raise(SIGKILL); })), 128 + SIGKILL);
}

TEST(Command, a_function_that_is_given_away_is_a_child_of_the_subreaper) {
  const auto begin = [] { return start({.words = {"work"}, .function = [] { return 7; }, .is_given_away = true}); };
  ASSERT_EQ(::prctl(PR_SET_CHILD_SUBREAPER, 1), 0);
  EXPECT_EQ(await_child(begin()), 7);
  // Starter without subreaper: no child.
  const pid_t between = start({.words = {"between"}, .function = [&] { return await_child(begin()) == -1 ? 5 : 1; }});
  EXPECT_EQ(await_child(between), 5);
  int status = 0;
  EXPECT_GT(::waitpid(-1, &status, 0), 0);
  EXPECT_EQ(WEXITSTATUS(status), 7);
  ::prctl(PR_SET_CHILD_SUBREAPER, 0);
}

TEST(Command, closed_standard_streams_are_permitted) {
  const int kept = ::fcntl(0, F_DUPFD, 10);
  ::close(0);
  const Finished finished = run({.words = {"sh", "-c", "cat; echo done"}, .input = kInherit, .output = kCapture});
  ::dup2(kept, 0);
  ::close(kept);
  EXPECT_EQ(finished.output, "done\n");
}

TEST(Command, programs_are_found_next_to_this_one_and_along_the_path) {
  EXPECT_EQ(find_program(find_self().filename()), find_self());
  EXPECT_TRUE(find_program("sh"));
  EXPECT_FALSE(find_program("no-such-program-anywhere"));
  EXPECT_FALSE(is_program("/etc/passwd"));
}

TEST(Command, a_missing_helper_is_named_with_its_place) {
  try {
    find_helper("no-such-helper");
    FAIL();
  } catch (const SystemError& error) {
    EXPECT_EQ(error.what(), (find_self().parent_path().parent_path() / "libexec/carillon/no-such-helper").string() +
                                " is missing; install Carillon again");
  }
}

}  // namespace
}  // namespace carillon::base
