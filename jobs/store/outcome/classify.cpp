// Method:     The result file of the solver takes precedence; without one (ended by a signal) the exit code and the actions of the attempt
//             give the cause.
// Source:     exit codes: docs/howto/jobs.md; of mpirun: measured with Open MPI 4.1.
#include <fmt/core.h>

#include <csignal>

#include "jobs/store/outcome/policy.hpp"
#include "runtime/base/error.hpp"

namespace carillon::outcome {
namespace {

using base::ResultKind;

constexpr int kExitNodeLost = 205;  // of mpirun
constexpr std::size_t kMaxReason = 1000;

/// One line for a table: no control characters, no final full stop, limited length.
std::string make_sentence(std::string_view line) {
  std::string text;
  for (const char letter : line.substr(0, kMaxReason)) text += static_cast<unsigned char>(letter) < 0x20 || letter == 0x7f ? ' ' : letter;
  while (line.size() > kMaxReason && !text.empty() && (static_cast<unsigned char>(text.back()) & 0x80) != 0) text.pop_back();
  while (!text.empty() && (text.back() == '.' || text.back() == ' ')) text.pop_back();
  return text;
}

FailureCause classify_signal(const Ending& ending) {
  const int signal = ending.exit_code - 128;
  const std::string who = ending.dead_rank.empty() ? "the solver" : make_sentence(ending.dead_rank);
  const char* name = sigdescr_np(signal);
  const std::string what = fmt::format("signal {} ({})", signal, name != nullptr ? name : "unknown");
  if (signal == SIGKILL && ending.was_kernel_out_of_memory)
    return {Cause::memory, fmt::format("{} was killed by {} while the kernel was out of memory", who, what), 0.0};
  for (const int own : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGSYS, SIGTRAP}) {
    if (signal == own) return {Cause::crashed, fmt::format("{} crashed by {}", who, what), 0.0};
  }
  return {Cause::killed, fmt::format("{} was killed by {}", who, what), 0.0};
}

Cause find_cause(ResultKind kind) {
  switch (kind) {
    case ResultKind::done:
      return Cause::done;
    case ResultKind::bad_input:
      return Cause::bad_input;
    case ResultKind::no_solution:
      return Cause::no_solution;
    case ResultKind::memory:
      return Cause::memory;
    case ResultKind::disk_full:
      return Cause::disk_full;
    case ResultKind::checkpointed:
      return Cause::checkpointed;
    default:
      return Cause::system;
  }
}

bool is_error(const std::optional<base::Result>& result) {
  return result && result->kind != ResultKind::done && result->kind != ResultKind::checkpointed;
}

/// From the exit code alone.
FailureCause classify_code(const Ending& ending) {
  const int code = ending.exit_code;
  if (code == kExitInput) return {Cause::bad_input, "the solver refused its input; see its log", 0.0};
  if (code == kExitSolve) return {Cause::no_solution, "the solver found no solution; see its log", 0.0};
  if (code == kExitSystem) return {Cause::system, "the solver could not run; see its log", 0.0};
  if (code == kExitNodeLost) return {Cause::node_lost, "lost contact with a host of the job", 0.0};
  if (code > 128 && code < 128 + NSIG) return classify_signal(ending);
  return {Cause::node_lost,
          ending.dead_rank.empty() ? fmt::format("the solver ended with exit code {}{}", code, ending.result ? "" : " and no result")
                                   : make_sentence(ending.dead_rank + " ended early"),
          0.0};
}

/// Advice on a memory limit set by the user.
std::string describe_limit(double need_gb, double limit_gb) {
  return fmt::format(
      "\"memory_gb\" of the job is {:g}, and it needs at least {:.2g}: carillon validate predicts the need; raise it in \"resources\" of "
      "the job or by carillon retry --memory-gb",
      limit_gb, need_gb);
}

}  // namespace

FailureCause classify(const Ending& ending) {
  const int code = ending.exit_code;
  const bool has_error = is_error(ending.result);
  if (code == 0) return {Cause::done, "", 0.0};
  // Actions of this attempt explain the exit code, unless the solver reported an error itself.
  if (!has_error && ending.held_gb > 0.0)
    return {Cause::memory_limit,
            fmt::format("it held {:.2f} GB of memory and was ended; {}", ending.held_gb,
                        describe_limit(ending.held_gb, ending.memory_limit_gb)),
            ending.held_gb};
  if (!has_error && ending.was_hung)
    return {Cause::hung, fmt::format("hung: no output and no CPU time for {:.0f} s; killed", ending.hang_s), 0.0};
  if (!has_error && ending.was_out_of_time) {
    const char* saved = code == kExitCheckpointed ? "saved, and resumes from there"
                        : ending.has_saved        ? "resumes from the last checkpoint"
                                                  : "nothing was saved";
    return {Cause::time_limit, fmt::format("time limit reached; {}", saved), 0.0};
  }
  if (!has_error && ending.was_asked_to_stop) return {Cause::stopped, code == kExitCheckpointed ? "stopped and saved" : "stopped", 0.0};
  if (code == kExitCheckpointed) return {Cause::checkpointed, "saved and stopped, as a signal asked", 0.0};
  const FailureCause cause =
      has_error ? FailureCause{find_cause(ending.result->kind), make_sentence(ending.result->message), 1e-9 * ending.result->need_bytes}
                : classify_code(ending);
  if (cause.cause == Cause::memory && ending.memory_limit_gb > 0.0 && cause.memory_need_gb > ending.memory_limit_gb)
    return {Cause::memory_limit, fmt::format("{}; {}", cause.reason, describe_limit(cause.memory_need_gb, ending.memory_limit_gb)),
            cause.memory_need_gb};
  const bool explains_itself = cause.cause == Cause::disk_full || cause.cause == Cause::memory || cause.cause == Cause::no_solution;
  if (ending.is_disk_full && !explains_itself) return {Cause::disk_full, fmt::format("the disk or quota is full ({})", cause.reason), 0.0};
  return cause;
}

}  // namespace carillon::outcome
