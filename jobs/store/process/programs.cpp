#include "jobs/store/process/programs.hpp"

#include <fmt/core.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <optional>
#include <sstream>
#include <string_view>

#include "jobs/store/process/process.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/environment.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/result.hpp"

namespace carillon::process {
namespace {

/// The last line "carillon-mesh: cup.obj: ..." or "carillon-precompute: error: ..." of a program, without its name; else the last line.
std::string find_message(const std::string& errors, const std::string& program) {
  const std::string mark = program + ": ";
  const std::size_t at = errors.rfind(mark);
  if (at == std::string::npos) {
    const std::size_t end = errors.find_last_not_of(" \n-") + 1;
    const std::string text = errors.substr(0, end);
    return text.empty() ? "" : program + " ended: " + text.substr(text.rfind('\n') + 1);
  }
  std::string message = errors.substr(at + mark.size());
  message = message.substr(0, message.find('\n'));
  return message.starts_with("error: ") ? message.substr(7) : message;
}

/// The texts after "carillon-mesh: note: " and "carillon: warning: ".
std::vector<std::string> find_notes(const std::string& errors) {
  std::vector<std::string> notes;
  std::istringstream lines(errors);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t word = line.find(": ");
    if (!line.starts_with("carillon") || word == std::string::npos) continue;
    for (const std::string_view kind : {": note: ", ": warning: "}) {
      if (line.compare(word, kind.size(), kind) != 0) continue;
      std::string note = line.substr(word + kind.size());
      if (std::find(notes.begin(), notes.end(), note) == notes.end()) notes.push_back(std::move(note));
    }
  }
  return notes;
}

constexpr double kDaemonGraceS = 10.0;  // Open MPI's daemon needs about 0.05 s for its session folder on an idle machine
constexpr double kEndPatienceS = 5.0;
/// Environment entry of started programs and their children.
constexpr std::string_view kMark = "CARILLON_PROGRAMS=";

/// The kind of an exit code without a result file.
base::ResultKind find_kind(int exit_code) {
  if (exit_code == kExitInput) return base::ResultKind::bad_input;
  if (exit_code == kExitSolve) return base::ResultKind::no_solution;
  return base::ResultKind::system;
}

volatile std::sig_atomic_t noted_signal = 0;
constexpr std::array kSignals{SIGINT, SIGTERM, SIGHUP};
std::array<struct sigaction, kSignals.size()> earlier_actions;

}  // namespace

SignalWatch::SignalWatch() {
  noted_signal = 0;
  for (std::size_t k = 0; k < kSignals.size(); ++k) {
    ::sigaction(kSignals[k], nullptr, &earlier_actions[k]);
    if (earlier_actions[k].sa_handler == SIG_IGN) continue;  // nohup
    struct sigaction action {};
    action.sa_handler = [](int signal) { noted_signal = signal; };
    ::sigaction(kSignals[k], &action, nullptr);
  }
}

SignalWatch::~SignalWatch() {
  for (std::size_t k = 0; k < kSignals.size(); ++k) ::sigaction(kSignals[k], &earlier_actions[k], nullptr);
  if (noted_signal != 0) ::raise(noted_signal);
}

int SignalWatch::get_signal() { return noted_signal; }

Programs::Programs(bool is_quiet) : folder_("carillon-"), is_quiet_(is_quiet) {}

std::string Programs::run(const std::string& program, std::vector<std::string> words, bool has_result, bool shows) {
  const std::filesystem::path result_file = folder_.path() / "result.json";
  std::error_code error;
  std::filesystem::remove(result_file, error);
  base::Command command;
  command.words = {base::require_program(program).string()};
  command.words.insert(command.words.end(), words.begin(), words.end());
  if (has_result) command.words.insert(command.words.end(), {"--result", result_file.string()});
  command.folder = folder_.path();
  const std::string mark = std::string(kMark) + folder_.path().string();
  command.environment = base::make_lone_environment();
  std::erase_if(*command.environment, [](const std::string& entry) { return entry.starts_with(kMark); });
  command.environment->push_back(mark);
  command.signal_at_end = SIGTERM;  // the program removes its temporary folders
  command.output = shows && !is_quiet_ ? STDERR_FILENO : base::kCapture;
  command.errors = base::kCapture;
  const base::Finished finished = base::run(command, {.may_stop = [](const base::Finished&) { return SignalWatch::get_signal() != 0; }});
  if (SignalWatch::get_signal() != 0) {
    // Open MPI's daemon outlives a killed program until it has removed its session folder.
    end_with_environment(mark, kEndPatienceS, kDaemonGraceS);
    throw SystemError(fmt::format("ended by signal {}", SignalWatch::get_signal()));
  }
  notes_ = find_notes(finished.errors);
  if (finished.exit_code == 0) return finished.output;
  const std::optional<base::Result> said = has_result ? base::read_result(result_file) : std::nullopt;
  base::Result result = said.value_or(base::Result{.kind = find_kind(finished.exit_code)});
  if (result.message.empty()) result.message = find_message(finished.errors, program);
  if (result.message.empty())
    result.message = finished.signal != 0 ? fmt::format("{} was ended by signal {}", program, finished.signal)
                                          : fmt::format("{} ended with exit code {} and no message", program, finished.exit_code);
  base::throw_error(result);
}

}  // namespace carillon::process
