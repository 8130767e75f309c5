// Method:     posix_spawn with a new session.
// Source:     POSIX.1-2008; POSIX_SPAWN_SETSID: glibc 2.26. Deviations: none.
#include "jobs/queue/spawn.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <spawn.h>

#include <cstring>

extern "C" char** environ;

namespace carillon::queue {

pid_t spawn(const std::vector<std::string>& arguments, const std::filesystem::path& log) {
  std::vector<char*> words;
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  ::posix_spawn_file_actions_init(&files);
  ::posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&files, 1, log.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_NOFOLLOW | O_NONBLOCK, 0666);
  ::posix_spawn_file_actions_adddup2(&files, 1, 2);
  ::posix_spawnattr_init(&attributes);
  // What asks an attempt to stop waits until it is ready to hear it.
  sigset_t later, all;
  ::sigemptyset(&later);
  for (const int signal : {SIGUSR1, SIGTERM, SIGINT, SIGHUP}) ::sigaddset(&later, signal);
  ::sigfillset(&all);
  ::posix_spawnattr_setsigmask(&attributes, &later);
  ::posix_spawnattr_setsigdefault(&attributes, &all);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  pid_t pid = -1;
  const int error = ::posix_spawn(&pid, words[0], &files, &attributes, words.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&files);
  if (error != 0) throw SystemError(fmt::format("{}: cannot be started: {}", arguments[0], std::strerror(error)));
  return pid;
}

}  // namespace carillon::queue
