#include "jobs/queue/spawn.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "runtime/base/command.hpp"

namespace carillon::queue {

pid_t spawn(const std::vector<std::string>& arguments, const std::filesystem::path& log) {
  const int output = ::open(log.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
  if (output < 0) throw SystemError(fmt::format("{}: cannot write this: {}", log.string(), std::strerror(errno)));
  // What asks an attempt to stop waits until it is ready to hear it.
  base::Command command{.words = arguments,
                        .output = output,
                        .errors = output,
                        .group = base::Command::Group::session,
                        .blocked = {SIGUSR1, SIGTERM, SIGINT, SIGHUP},
                        .default_signals = true};
  try {
    const pid_t child = base::start(command);
    ::close(output);
    return child;
  } catch (...) {
    ::close(output);
    throw;
  }
}

}  // namespace carillon::queue
