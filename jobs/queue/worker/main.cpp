// carillon-worker: one start of MPI, PETSc and SLEPc for the one-rank attempts of a `carillon run`. Each attempt is a fork, its solver a
// fork of that: crashes are isolated.
// Method:     Standard input is a socket: a request is the words of `carillon attempt`, the reply the process number of the attempt. A
//             short-lived intermediate process forks it, so the queue, a subreaper, becomes its parent. MPI is an isolated singleton;
//             forks end without MPI_Finalize.
// Source:     Linux prctl(2) (PR_SET_CHILD_SUBREAPER), unix(7), fork(2).
#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdlib>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/worker/title.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/run/program.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file_limit.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/result.hpp"
#include "runtime/material/table.hpp"

namespace {

using namespace carillon;

constexpr int kIdleMs = 10'000;  // then it ends: memory, and the files of a new installation
constexpr std::size_t kMaxMessage = 1 << 16;

/// Descriptors of the libraries stay open in forks.
void keep_descriptors() {
  for (const int descriptor : base::list_descriptors())
    if (descriptor > STDERR_FILENO) ::fcntl(descriptor, F_SETFD, 0);
}

std::vector<std::string> split(std::string_view message) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at < message.size(); at = message.find('\0', at) + 1) words.emplace_back(message.substr(at).data());
  return words;
}

/// In a fork: one attempt.
int carry_out(const petsc::Session& session, const worker::Title& title, const std::vector<std::string>& words) {
  base::report_file_limit();
  title.show("carillon", words);
  try {
    CLI::App app;
    attempt::Options options;
    attempt::add_options(app, options);
    app.parse(std::vector<std::string>(words.rbegin(), words.rend() - 2));  // backwards, without {program, "attempt"}
    options.solver = [&](const std::vector<std::string>& solver_words) {
      title.show_token(options.token);
      title.show("carillon-precom", solver_words);
      return run::run_program(session, solver_words);
    };
    return attempt::run_attempt(options);
  } catch (...) {
    const base::Result result = base::describe_error(std::current_exception(), "out of memory; close other programs");
    fmt::print(stderr, "carillon: {}\n", base::show_message(result.message));
    return base::get_exit_code(result.kind);
  }
}

/// Until the queue ends, or has no attempts to start for a while.
void serve(const petsc::Session& session, const worker::Title& title) {
  std::vector<char> message(kMaxMessage);
  for (;;) {
    pollfd queue{STDIN_FILENO, POLLIN, 0};
    const int ready = ::poll(&queue, 1, kIdleMs);
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return;
    const ssize_t got = ::recv(STDIN_FILENO, message.data(), message.size() - 1, 0);
    if (got <= 0) return;
    message[static_cast<std::size_t>(got)] = '\0';
    const std::vector<std::string> words = split({message.data(), static_cast<std::size_t>(got)});
    std::string answer = "0";
    const base::Descriptor output(::open(words.at(0).c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666));
    const auto work = [&] { return carry_out(session, title, {words.begin() + 1, words.end()}); };
    try {
      if (output.get() >= 0)
        answer = std::to_string(base::start({.words = words,
                                             .output = output.get(),
                                             .errors = output.get(),
                                             .group = base::Command::Group::session,
                                             .blocked = {SIGUSR1, SIGTERM, SIGINT, SIGHUP},
                                             .default_signals = true,
                                             .function = work,
                                             .is_given_away = true}));
    } catch (const SystemError&) {  // the queue starts it otherwise
    }
    if (::send(STDIN_FILENO, answer.data(), answer.size(), MSG_NOSIGNAL) < 0) return;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const worker::Title title(argc, argv);
  try {
    title.show("carillon-worker", {"carillon-worker"});
    ::unsetenv("LD_BIND_NOW");  // of the launcher
    const petsc::Session session(argc, argv);
    run::prepare_forks();
    (void)material::MaterialTable::get_built_in();
    keep_descriptors();
    serve(session, title);
    ::_exit(0);  // nothing is left to end
  } catch (const std::exception&) {
    return kExitSystem;
  }
}
