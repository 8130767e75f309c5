// Method:     fork and exec with three pipes, and poll() on them until the program has ended or its time is over.
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

#include "runtime/config/error.hpp"

namespace carillon::slurm {
namespace {

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

/// True when the program closed both its outputs in time.
bool talk(Pipe& in, Pipe& out, Pipe& err, std::string_view input, double deadline_s, Finished& finished) {
  ::fcntl(in.end(1), F_SETFL, O_NONBLOCK);
  if (input.empty()) in.close(1);
  while (out.end(0) >= 0 || err.end(0) >= 0) {
    const double left_s = deadline_s - find_seconds();
    if (left_s <= 0.0) return false;
    std::array<pollfd, 3> all{{{in.end(1), POLLOUT, 0}, {out.end(0), POLLIN, 0}, {err.end(0), POLLIN, 0}}};
    if (::poll(all.data(), all.size(), static_cast<int>(std::min(left_s * 1e3 + 1.0, 1e6))) < 0 && errno != EINTR) return false;
    if (all[0].revents != 0 && !give(in.end(1), input)) in.close(1);
    if (all[1].revents != 0 && !take(out.end(0), finished.output)) out.close(0);
    if (all[2].revents != 0 && !take(err.end(0), finished.errors)) err.close(0);
  }
  return true;
}

}  // namespace

Finished run_command(const std::vector<std::string>& words, std::string_view input, double patience_s) {
  std::vector<char*> pointers;
  for (const std::string& word : words) pointers.push_back(const_cast<char*>(word.c_str()));
  pointers.push_back(nullptr);
  Pipe in, out, err;
  struct sigaction ignore {
  }, before{};
  ignore.sa_handler = SIG_IGN;
  ::sigaction(SIGPIPE, &ignore, &before);  // a program that takes no input is no reason to die
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child == 0) become(pointers, {in.end(0), out.end(1), err.end(1)}, parent);
  Finished finished;
  if (child > 0) {
    in.close(0);
    out.close(1);
    err.close(1);
    finished.was_slow = !talk(in, out, err, input, find_seconds() + patience_s, finished);
    if (finished.was_slow) ::kill(child, SIGKILL);
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
    finished.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  const int error = errno;
  ::sigaction(SIGPIPE, &before, nullptr);
  if (child < 0) throw SystemError(fmt::format("{} cannot be started: {}", words[0], std::strerror(error)));
  return finished;
}

}  // namespace carillon::slurm
