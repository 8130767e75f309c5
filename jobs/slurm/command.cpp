// Method:     fork and exec with three pipes, and poll() on them until the program has closed its outputs or its time is over; then
// waitpid()
//             without blocking, as a program may go on without outputs, and one that waits for a dead disk cannot even be killed.
// Source:     POSIX; Linux prctl(2).
// Deviations: none.
#include "jobs/slurm/command.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <optional>

#include "runtime/config/error.hpp"

namespace carillon::slurm {
namespace {

constexpr long kStepNs = 2'000'000;
constexpr double kKillPatienceS = 5.0;

class Pipe {
 public:
  Pipe() {
    if (::pipe2(ends_.data(), O_CLOEXEC) != 0) throw SystemError(fmt::format("cannot make a pipe: {}", std::strerror(errno)));
  }
  ~Pipe() {
    close(0);
    close(1);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  int end(std::size_t which) const { return ends_[which]; }
  void close(std::size_t which) {
    if (ends_[which] >= 0) ::close(ends_[which]);
    ends_[which] = -1;
  }

 private:
  std::array<int, 2> ends_{-1, -1};
};

/// A program that takes no input is no reason to die.
class Quiet {
 public:
  Quiet() {
    struct sigaction ignore {};
    ignore.sa_handler = SIG_IGN;
    ::sigaction(SIGPIPE, &ignore, &before_);
  }
  ~Quiet() { ::sigaction(SIGPIPE, &before_, nullptr); }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  struct sigaction before_ {};
};

double find_seconds() {
  timespec time{};
  ::clock_gettime(CLOCK_BOOTTIME, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// In the child. Never returns.
[[noreturn]] void become(const std::vector<char*>& words, const std::array<int, 3>& streams, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  sigset_t none;
  ::sigemptyset(&none);
  ::signal(SIGPIPE, SIG_DFL);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  if (::getppid() == parent && ::dup2(streams[0], 0) == 0 && ::dup2(streams[1], 1) == 1 && ::dup2(streams[2], 2) == 2)
    ::execvp(words[0], words.data());
  ::_exit(127);
}

/// Appends what is there; false at the end.
bool take(int descriptor, std::string& text) {
  std::array<char, 65536> piece;
  const ssize_t got = ::read(descriptor, piece.data(), piece.size());
  if (got > 0) text.append(piece.data(), static_cast<std::size_t>(got));
  return got > 0 || (got < 0 && errno == EINTR);
}

/// Gives some more of the input; false when all is given, or nobody takes it.
bool give(int descriptor, std::string_view& input) {
  const ssize_t put = ::write(descriptor, input.data(), input.size());
  if (put > 0) input.remove_prefix(static_cast<std::size_t>(put));
  return !input.empty() && (put > 0 || errno == EINTR || errno == EAGAIN);
}

/// Until the program has closed both its outputs, or printed too much, or its time is over.
void talk(Pipe& in, Pipe& out, Pipe& err, std::string_view input, double deadline_s, std::size_t most_bytes, Finished& finished) {
  ::fcntl(in.end(1), F_SETFL, O_NONBLOCK);
  if (input.empty()) in.close(1);
  while (out.end(0) >= 0 || err.end(0) >= 0) {
    const double left_s = deadline_s - find_seconds();
    finished.was_slow = left_s <= 0.0;
    finished.was_long = std::max(finished.output.size(), finished.errors.size()) > most_bytes;
    if (finished.was_slow || finished.was_long) return;
    std::array<pollfd, 3> all{{{in.end(1), POLLOUT, 0}, {out.end(0), POLLIN, 0}, {err.end(0), POLLIN, 0}}};
    if (::poll(all.data(), all.size(), static_cast<int>(std::min(left_s * 1e3 + 1.0, 1e6))) < 0) {
      finished.was_slow = errno != EINTR;
      if (finished.was_slow) return;
      continue;
    }
    if (all[0].revents != 0 && !give(in.end(1), input)) in.close(1);
    if (all[1].revents != 0 && !take(out.end(0), finished.output)) out.close(0);
    if (all[2].revents != 0 && !take(err.end(0), finished.errors)) err.close(0);
  }
}

/// Its status when it ends before the deadline.
std::optional<int> await(pid_t child, double deadline_s) {
  for (;;) {
    int status = 0;
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child) return status;
    if (ended < 0 && errno != EINTR) return 0;
    if (find_seconds() >= deadline_s) return std::nullopt;
    const timespec time{0, kStepNs};
    ::nanosleep(&time, nullptr);
  }
}

}  // namespace

Finished run_command(const std::vector<std::string>& words, std::string_view input, double patience_s, std::size_t most_bytes) {
  std::vector<char*> pointers;
  for (const std::string& word : words) pointers.push_back(const_cast<char*>(word.c_str()));
  pointers.push_back(nullptr);
  Pipe in, out, err;
  const Quiet quiet;
  const double deadline_s = find_seconds() + patience_s;
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) throw SystemError(fmt::format("{} cannot be started: {}", words[0], std::strerror(errno)));
  if (child == 0) become(pointers, {in.end(0), out.end(1), err.end(1)}, parent);
  in.close(0);
  out.close(1);
  err.close(1);
  Finished finished;
  talk(in, out, err, input, deadline_s, most_bytes, finished);
  std::optional<int> status;
  if (!finished.was_slow && !finished.was_long) status = await(child, deadline_s);
  if (!status) {
    finished.was_slow = !finished.was_long;
    ::kill(child, SIGKILL);
    status = await(child, find_seconds() + kKillPatienceS).value_or(SIGKILL);
  }
  finished.exit_code = WIFEXITED(*status) ? WEXITSTATUS(*status) : 128 + WTERMSIG(*status);
  return finished;
}

}  // namespace carillon::slurm
