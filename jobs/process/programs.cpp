#include "jobs/process/programs.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <optional>

#include "runtime/base/command.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/result.hpp"

namespace carillon::process {
namespace {

/// The last line of what a program said of itself, without its name: "carillon-mesh: cup.obj: ..." or "carillon-precompute: error: ...".
std::string find_message(const std::string& errors, const std::string& program) {
  const std::string mark = program + ": ";
  const std::size_t at = errors.rfind(mark);
  if (at == std::string::npos) return "";
  std::string message = errors.substr(at + mark.size());
  message = message.substr(0, message.find('\n'));
  return message.starts_with("error: ") ? message.substr(7) : message;
}

/// What an exit code says without a result.
base::ResultKind find_kind(int exit_code) {
  if (exit_code == kExitInput) return base::ResultKind::bad_input;
  if (exit_code == kExitSolve) return base::ResultKind::no_solution;
  return base::ResultKind::system;
}

}  // namespace

std::string Programs::run(const std::string& program, std::vector<std::string> words, bool has_result, bool shows) const {
  const std::filesystem::path result_file = folder_ / ".result.json";
  std::error_code error;
  std::filesystem::remove(result_file, error);
  base::Command command;
  command.words = {base::require_program(program).string()};
  command.words.insert(command.words.end(), words.begin(), words.end());
  if (has_result) command.words.insert(command.words.end(), {"--result", result_file.string()});
  command.folder = folder_;
  command.output = shows && !is_quiet_ ? STDERR_FILENO : base::kCapture;
  command.errors = base::kCapture;
  const base::Finished finished = base::run(command);
  const std::optional<base::Result> said = has_result ? base::read_result(result_file) : std::nullopt;
  std::filesystem::remove(result_file, error);
  if (finished.exit_code == 0) return finished.output;
  base::Result result = said.value_or(base::Result{.kind = find_kind(finished.exit_code)});
  if (result.message.empty()) result.message = find_message(finished.errors, program);
  if (result.message.empty())
    result.message = finished.signal != 0 ? fmt::format("{} was ended by signal {}", program, finished.signal)
                                          : fmt::format("{} ended with exit code {} and said nothing", program, finished.exit_code);
  base::throw_error(result);
}

}  // namespace carillon::process
