// Source:     Linux prctl(2) (PR_SET_CHILD_SUBREAPER), unix(7) (SOCK_SEQPACKET keeps messages apart).
#include "jobs/queue/worker_client.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <utility>

#include "jobs/queue/attempt/launch.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/error.hpp"

namespace carillon::queue {
namespace {

constexpr int kPatienceMs = 30'000;            // MPI and PETSc start in 0.1 s
constexpr std::size_t kTitleBytes = 16 << 10;  // of the command line of an attempt

}  // namespace

std::optional<pid_t> WorkerClient::start(const std::filesystem::path& log, const std::vector<std::string>& words) {
  if (std::exchange(is_first_, false)) return std::nullopt;
  std::string message = log.string() + '\0';
  for (const std::string& word : words) message += word + '\0';
  if (message.size() > kTitleBytes || is_unusable_) return std::nullopt;
  const bool has_worker = socket_.get() >= 0;
  if (has_worker) {
    if (const std::optional<pid_t> attempt = ask(message)) return attempt;
  }
  is_unusable_ = !make_worker();
  if (is_unusable_) return std::nullopt;
  const std::optional<pid_t> attempt = ask(message);
  is_unusable_ = !attempt;
  return attempt;
}

bool WorkerClient::make_worker() {
  std::array<int, 2> ends{};
  if (::prctl(PR_SET_CHILD_SUBREAPER, 1) != 0) return false;  // attempts become children of this process
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) return false;
  socket_ = base::Descriptor(ends[0]);
  const base::Descriptor other(ends[1]);
  try {
    const attempt::Launch launch = attempt::make_worker_launch(kTitleBytes);
    worker_ = base::start({.words = launch.arguments,
                           .environment = launch.environment,
                           .input = other.get(),
                           .group = base::Command::Group::session,
                           .default_signals = true});
  } catch (const SystemError&) {  // reported by the next attempt
    socket_.close();
    return false;
  }
  return true;
}

std::optional<pid_t> WorkerClient::ask(const std::string& message) {
  pid_t attempt = 0;
  std::array<char, 32> answer{};
  pollfd worker{socket_.get(), POLLIN, 0};
  if (::send(socket_.get(), message.data(), message.size(), MSG_NOSIGNAL) > 0) {
    int ready = 0;
    do ready = ::poll(&worker, 1, kPatienceMs);
    while (ready < 0 && errno == EINTR);
    const ssize_t got = ready > 0 ? ::recv(socket_.get(), answer.data(), answer.size(), 0) : 0;
    if (got > 0) std::from_chars(answer.data(), answer.data() + got, attempt);
    if (ready == 0) ::kill(worker_, SIGKILL);
  }
  if (attempt > 0) return attempt;
  socket_.close();
  return std::nullopt;
}

}  // namespace carillon::queue
