// Method: vfork() and exec with all signals blocked; poll() on the pipes until the child closes them or times out, then non-blocking
//   waitpid(): a child may outlive its outputs, and one blocked on a dead disk cannot be killed.
// Source: POSIX; Linux vfork(2), prctl(2) (PR_SET_PDEATHSIG), proc(5) (oom_score_adj).
// Deviations: between vfork() and exec the child makes system calls and writes to `Plan`: more than POSIX permits, safe on Linux.
#include "runtime/base/command.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <utility>

#include "runtime/base/clock.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/environment.hpp"
#include "runtime/base/signal_pause.hpp"
#include "runtime/base/temporary.hpp"

extern "C" char** environ;

namespace carillon::base {
namespace {

namespace fs = std::filesystem;

constexpr long kWaitPollNs = 2'000'000;  // interval of waitpid() polls
constexpr double kMayStopPollS = 0.1;    // interval of may_stop() calls
constexpr double kOutputGraceS = 1.0;    // grace for reading the output of a late process
constexpr double kKillPatienceS = 5.0;   // wait after SIGKILL
constexpr const char* kHelperFolder = "libexec/carillon";
constexpr const char* kDataFolder = "share/carillon";
/// Programs of components, which a build may leave out (docs/components.md).
constexpr std::array<std::array<std::string_view, 2>, 3> kComponentPrograms{
    {{"carillon-simulate", "SIMULATION"}, {"carillon-study", "STUDIES"}, {"carillon-tune", "STUDIES"}}};
constexpr const char* kOomScore = "500";  // out of 1,000

struct Pipe {
  Descriptor read, write;
  Pipe() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw SystemError(fmt::format("cannot make a pipe: {}; close other programs", std::strerror(errno)));
    const Descriptor low_read(ends[0]), low_write(ends[1]);
    read = Descriptor(::fcntl(ends[0], F_DUPFD_CLOEXEC, 3));  // not a number of a closed standard stream
    write = Descriptor(::fcntl(ends[1], F_DUPFD_CLOEXEC, 3));
    if (read.get() < 0 || write.get() < 0) throw SystemError("cannot make a pipe: too many files are open");
  }
};

/// A child that does not read its input must not end this process.
class IgnoredPipeSignal {
 public:
  IgnoredPipeSignal() {
    struct sigaction ignore {};
    ignore.sa_handler = SIG_IGN;
    ::sigaction(SIGPIPE, &ignore, &before_);
  }
  ~IgnoredPipeSignal() { ::sigaction(SIGPIPE, &before_, nullptr); }
  IgnoredPipeSignal(const IgnoredPipeSignal&) = delete;
  IgnoredPipeSignal& operator=(const IgnoredPipeSignal&) = delete;

 private:
  struct sigaction before_ {};
};

std::vector<char*> to_pointers(const std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (const std::string& text : texts) pointers.push_back(const_cast<char*>(text.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

/// Input of the child between vfork() and exec, and its error.
struct Plan {
  const char* program = nullptr;  // a path
  char* const* words = nullptr;
  char* const* environment = nullptr;
  const char* folder = nullptr;
  std::array<int, 3> streams{};  // descriptors >= 3
  Command::Group group{};
  int signal_at_end = 0;
  bool yields_memory = false, default_signals = false;
  const std::function<int()>* function = nullptr;  // instead of `program`
  sigset_t mask{};
  pid_t parent = 0;
  int error = 0;
};

bool is_fault(int signal) { return signal == SIGSEGV || signal == SIGBUS || signal == SIGFPE || signal == SIGABRT || signal == SIGILL; }

/// Like exec, closes the descriptors with FD_CLOEXEC.
void close_marked_descriptors() {
  for (const int descriptor : list_descriptors()) {
    const int flags = ::fcntl(descriptor, F_GETFD);
    if (descriptor > STDERR_FILENO && flags >= 0 && (flags & FD_CLOEXEC) != 0) ::close(descriptor);
  }
}

/// In a fork, in place of exec.
[[noreturn]] void call(const Plan& plan) {
  close_marked_descriptors();
  environ = const_cast<char**>(plan.environment);
  int code = kExitSystem;
  try {
    code = (*plan.function)();
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
  }
  std::fflush(nullptr);
  ::_exit(code);
}

/// Runs in the child, which shares the parent's memory unless it is a fork.
[[noreturn]] void execute(Plan& plan) {
  if (plan.group == Command::Group::own) ::setpgid(0, 0);
  if (plan.group == Command::Group::session) ::setsid();
  if (plan.signal_at_end != 0) ::prctl(PR_SET_PDEATHSIG, plan.signal_at_end);
  // No handler of the parent may run here once signals are unblocked.
  struct sigaction action {};
  action.sa_handler = SIG_DFL;
  for (int signal = 1; signal < NSIG; ++signal) {
    struct sigaction before {};
    const bool is_ignored = ::sigaction(signal, nullptr, &before) == 0 && before.sa_handler == SIG_IGN;
    if (plan.function != nullptr && is_fault(signal)) continue;
    if (!is_ignored || plan.default_signals || signal == SIGPIPE) ::sigaction(signal, &action, nullptr);
  }
  if (plan.yields_memory) {
    const int score = ::open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
    if (score >= 0) (void)!::write(score, kOomScore, std::strlen(kOomScore));
  }
  bool ready = plan.signal_at_end == 0 || ::getppid() == plan.parent;
  for (int k = 0; k < 3; ++k) ready = ready && ::dup2(plan.streams[k], k) == k;
  ready = ready && (plan.folder == nullptr || ::chdir(plan.folder) == 0);
  ::sigprocmask(SIG_SETMASK, &plan.mask, nullptr);
  if (ready && plan.function != nullptr) call(plan);
  if (ready) ::execve(plan.program, plan.words, plan.environment);
  plan.error = errno;
  ::_exit(127);
}

/// A stack frame of its own protects the caller's registers from the child.
[[gnu::noinline]] pid_t fork_and_execute(Plan& plan) {
  const pid_t child = plan.function != nullptr ? ::fork() : ::vfork();
  if (child == 0) execute(plan);
  return child;
}

/// By a process that ends at once; it shares the memory, and only the fork is a copy of it.
[[gnu::noinline]] pid_t fork_and_give_away(Plan& plan) {
  volatile pid_t child = -1;
  const pid_t between = ::vfork();
  if (between == 0) {
    plan.parent = ::getpid();
    child = fork_and_execute(plan);
    if (child < 0) plan.error = errno;
    ::_exit(0);
  }
  while (between > 0 && ::waitpid(between, nullptr, 0) < 0 && errno == EINTR) {
  }
  if (child < 0 && plan.error != 0) errno = plan.error;
  return child;
}

/// Appends available bytes; false at end of file.
bool take(int descriptor, std::string& text, const RunOptions& options) {
  std::array<char, 65536> piece;
  const ssize_t got = ::read(descriptor, piece.data(), piece.size());
  if (got > 0) text.append(piece.data(), static_cast<std::size_t>(got));
  if (options.keeps_tail && text.size() > 2 * options.max_bytes) text.erase(0, text.size() - options.max_bytes);
  return got > 0 || (got < 0 && errno == EINTR);
}

/// Writes more of the input; false when all is written or the child closed its end.
bool give(int descriptor, std::string_view& input) {
  const ssize_t put = ::write(descriptor, input.data(), input.size());
  if (put > 0) input.remove_prefix(put);
  return !input.empty() && (put > 0 || errno == EINTR || errno == EAGAIN);
}

/// Exchanges data until the child has taken its input and closed its outputs, or must be killed. Reads available output before checking
/// limits: this process may have been suspended meanwhile.
void talk(Descriptor& in, Descriptor& out, Descriptor& errors, const RunOptions& options, double deadline_s, Finished& finished) {
  std::string_view input = options.input;
  double asked_s = get_boot_s();
  if (in.get() >= 0) ::fcntl(in.get(), F_SETFL, O_NONBLOCK);
  while (in.get() >= 0 || out.get() >= 0 || errors.get() >= 0) {
    std::array<pollfd, 3> all{{{in.get(), POLLOUT, 0}, {out.get(), POLLIN, 0}, {errors.get(), POLLIN, 0}}};
    const double wait_s = std::clamp(deadline_s - get_boot_s(), 0.0, options.may_stop ? kMayStopPollS : 1e3);
    const int ready = ::poll(all.data(), all.size(), static_cast<int>(std::lround(wait_s * 1e3)));
    if (ready < 0) {
      if (errno != EINTR) throw SystemError(fmt::format("cannot wait for a program: {}", std::strerror(errno)));
      continue;
    }
    const double late_s = get_boot_s() - deadline_s;
    finished.was_slow = ready == 0 ? late_s >= 0.0 : late_s > kOutputGraceS;
    finished.was_long = !options.keeps_tail && std::max(finished.output.size(), finished.errors.size()) > options.max_bytes;
    const bool is_asked = options.may_stop && (ready == 0 || get_boot_s() - asked_s >= kMayStopPollS);
    if (is_asked) asked_s = get_boot_s();
    finished.was_stopped = is_asked && options.may_stop(finished);
    if (finished.was_slow || finished.was_long || finished.was_stopped) return;
    if (all[0].revents != 0 && !give(in.get(), input)) in.close();
    if (all[1].revents != 0 && !take(out.get(), finished.output, options)) out.close();
    if (all[2].revents != 0 && !take(errors.get(), finished.errors, options)) errors.close();
  }
}

/// Exit status, if the process ends before the deadline.
std::optional<int> await(pid_t child, double deadline_s, const std::function<bool()>& may_stop) {
  for (;;) {
    int status = 0;
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child) return status;
    if (ended < 0 && errno != EINTR) {
      const WholeStep step;               // a handler in another thread may have reaped it
      return W_EXITCODE(kExitSystem, 0);  // reaped elsewhere: status lost
    }
    if (get_boot_s() >= deadline_s || (may_stop && may_stop())) return std::nullopt;
    const timespec pause{0, kWaitPollNs};
    ::nanosleep(&pause, nullptr);
  }
}

/// Starts a child, and kills and reaps it when run() exits by an exception.
class Reaper {
 public:
  explicit Reaper(const Command& command) {
    const WholeStep step;  // until the handler of signals knows the child
    child_ = start(command);
    note_child(child_);
  }
  ~Reaper() {
    if (child_ <= 0) return;
    forget_child(child_);
    ::kill(child_, SIGKILL);
    await(child_, get_boot_s() + kKillPatienceS, {});
  }
  Reaper(const Reaper&) = delete;
  Reaper& operator=(const Reaper&) = delete;
  pid_t get() const noexcept { return child_; }
  void release() {
    forget_child(child_);
    child_ = -1;
  }

 private:
  pid_t child_ = -1;
};

/// First executable of that name along PATH.
std::optional<fs::path> find_along_path(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::string_view rest = path != nullptr ? path : "/usr/local/bin:/usr/bin:/bin";
  std::error_code error;
  while (!rest.empty()) {
    const std::string_view folder = rest.substr(0, rest.find(':'));
    rest.remove_prefix(std::min(folder.size() + 1, rest.size()));
    if (!folder.empty() && is_program(fs::path(folder) / name)) return fs::absolute(fs::path(folder) / name, error);
  }
  return std::nullopt;
}

/// Path of a command's program; empty if not found.
std::string find_path(const std::string& word) {
  if (word.find('/') != std::string::npos) return word;
  const std::optional<fs::path> program = find_along_path(word);
  return program ? program->string() : std::string();
}

/// Installation prefix, the parent of bin and libexec.
fs::path find_prefix(const fs::path& program) {
  const fs::path folder = program.parent_path();
  return folder.parent_path().filename() == "libexec" ? folder.parent_path().parent_path() : folder.parent_path();
}

}  // namespace

fs::path find_self() {
  std::error_code error;
  fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (error) throw SystemError("/proc does not show this program; mount it");
  return self;
}

bool is_program(const fs::path& file) {
  std::error_code error;
  return fs::is_regular_file(file, error) && ::access(file.c_str(), X_OK) == 0;
}

std::optional<fs::path> find_program(const std::string& name) {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (!error) {
    for (const fs::path& folder : {self.parent_path(), find_prefix(self) / "bin"})
      if (is_program(folder / name)) return folder / name;
  }
  return find_along_path(name);
}

fs::path find_helper(const std::string& name) {
  fs::path file = find_prefix(find_self()) / kHelperFolder / name;
  std::error_code error;
  if (!fs::is_regular_file(file, error)) throw SystemError(fmt::format("{} is missing; install Carillon again", file.string()));
  return file;
}

fs::path find_data_folder(const std::string& name, std::string_view remedy) {
  fs::path folder = find_prefix(find_self()) / kDataFolder / name;
  std::error_code error;
  if (!fs::is_directory(folder, error)) throw SystemError(fmt::format("{} is missing; {}", folder.string(), remedy));
  return folder;
}

fs::path require_program(const std::string& name) {
  if (const auto program = find_program(name)) return *program;
  std::string remedy = "install it, or put its folder in PATH";
  for (const auto& [program, component] : kComponentPrograms)
    if (name == program) remedy += fmt::format("; it is the component {0}, of a build with -DCARILLON_{0}=ON", component);
  throw SystemError(fmt::format("{} is neither next to this program nor in PATH; {}", name, remedy));
}

void become(const std::vector<std::string>& words, const std::optional<std::vector<std::string>>& environment) {
  std::fflush(nullptr);
  if (environment)
    ::execve(words.at(0).c_str(), to_pointers(words).data(), to_pointers(*environment).data());
  else
    ::execv(words.at(0).c_str(), to_pointers(words).data());
  throw StartError(fmt::format("{}: cannot be started: {}", words[0], std::strerror(errno)), errno);
}

pid_t start(const Command& command) {
  // If SIGCHLD is inherited as ignored, the kernel discards the status of children.
  struct sigaction child_signal {};
  if (::sigaction(SIGCHLD, nullptr, &child_signal) == 0 && child_signal.sa_handler == SIG_IGN) ::signal(SIGCHLD, SIG_DFL);
  const auto refuse = [&](int error) {
    throw StartError(fmt::format("{}: cannot be started: {}", command.words.at(0), std::strerror(error)), error);
  };
  // Resolve PATH here: execvp() in the child would pass non-executables to a shell.
  const std::string program = command.function ? command.words.at(0) : find_path(command.words.at(0));
  if (program.empty()) refuse(ENOENT);
  const std::vector<char*> words = to_pointers(command.words);
  const std::vector<std::string> entries = command.environment ? *command.environment : make_environment();
  const std::vector<char*> environment = to_pointers(entries);
  Plan plan;
  plan.program = program.c_str();
  plan.words = words.data();
  plan.environment = environment.data();
  plan.folder = command.folder.empty() ? nullptr : command.folder.c_str();
  plan.group = command.group;
  plan.signal_at_end = command.signal_at_end;
  plan.yields_memory = command.yields_memory;
  plan.default_signals = command.default_signals;
  plan.function = command.function ? &command.function : nullptr;
  plan.parent = ::getpid();
  ::sigemptyset(&plan.mask);
  for (const int signal : command.blocked) ::sigaddset(&plan.mask, signal);
  // Duplicate to descriptors above the standard ones.
  std::array<Descriptor, 3> streams;
  const std::array<int, 3> given{command.input, command.output, command.errors};
  const Descriptor null(::open("/dev/null", O_RDWR | O_CLOEXEC));
  for (std::size_t k = 0; k < 3; ++k) {
    const int from = given[k] >= 0 ? given[k] : given[k] == kInherit ? static_cast<int>(k) : null.get();
    streams[k] = Descriptor(::fcntl(from, F_DUPFD_CLOEXEC, 3));
    if (streams[k].get() < 0 && given[k] == kInherit)
      streams[k] = Descriptor(::fcntl(null.get(), F_DUPFD_CLOEXEC, 3));  // closed in this process
    if (streams[k].get() < 0) refuse(errno);
    plan.streams[k] = streams[k].get();
  }
  std::optional<SignalPause> pause(std::in_place);
  const pid_t child = command.is_given_away ? fork_and_give_away(plan) : fork_and_execute(plan);
  const int error = child < 0 ? errno : plan.error;
  pause.reset();
  if (error == 0) return child;
  while (child > 0 && ::waitpid(child, nullptr, 0) < 0 && errno == EINTR) {
  }
  refuse(error);
  return -1;
}

Finished run(Command command, const RunOptions& options) {
  const IgnoredPipeSignal ignored;
  std::optional<Pipe> in, out, errors;
  if (!options.input.empty()) command.input = in.emplace().read.get();
  if (command.output == kCapture) command.output = out.emplace().write.get();
  if (command.errors == kCapture) command.errors = errors.emplace().write.get();
  if (command.signal_at_end == 0) command.signal_at_end = SIGKILL;
  const double deadline_s = get_boot_s() + options.patience_s;
  Reaper reaper(command);
  const pid_t child = reaper.get();
  if (options.started) options.started(child);
  Descriptor give_to, take_from, errors_from;
  if (in) give_to = std::move(in->write), in->read.close();
  if (out) take_from = std::move(out->read), out->write.close();
  if (errors) errors_from = std::move(errors->read), errors->write.close();
  Finished finished;
  talk(give_to, take_from, errors_from, options, deadline_s, finished);
  give_to.close();
  const auto may_stop = [&] { return options.may_stop && options.may_stop(finished); };
  const bool is_judged = finished.was_slow || finished.was_long || finished.was_stopped;
  std::optional<int> status = await(child, is_judged ? 0.0 : deadline_s, may_stop);  // may have ended meanwhile
  if (!status) {
    if (!is_judged) (get_boot_s() >= deadline_s ? finished.was_slow : finished.was_stopped) = true;
    ::kill(child, SIGKILL);
    status = await(child, get_boot_s() + kKillPatienceS, {}).value_or(SIGKILL);
  } else if (!finished.was_long) {
    finished.was_slow = finished.was_stopped = false;
  }
  reaper.release();
  if (options.keeps_tail)
    for (std::string* text : {&finished.output, &finished.errors})
      if (text->size() > options.max_bytes) text->erase(0, text->size() - options.max_bytes);
  finished.signal = WIFSIGNALED(*status) ? WTERMSIG(*status) : 0;
  finished.exit_code = finished.signal != 0 ? 128 + finished.signal : WEXITSTATUS(*status);
  return finished;
}

}  // namespace carillon::base
