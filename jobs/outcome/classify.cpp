// Method:     The exit code, what we did to the program, and the words of its own last error line give the cause; the sentence is that line
//             where there is one.
// Source:     exit codes: docs/howto/when-jobs-die.md; those of mpirun: Open MPI 4.1, tried one by one.
// Deviations: none.
#include <fmt/core.h>

#include <cctype>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstring>

#include "jobs/outcome/policy.hpp"

namespace carillon::outcome {
namespace {

constexpr int kExitCheckpointed = 85, kExitNodeLost = 205;
constexpr std::size_t kMostReason = 1000;

bool holds(std::string_view text, std::string_view word) { return text.find(word) != std::string_view::npos; }

/// The rest of the last line after `mark`; empty when there is none.
std::string_view find_last_after(std::string_view log, std::string_view mark) {
  const std::size_t at = log.rfind(mark);
  if (at == std::string_view::npos) return {};
  const std::string_view rest = log.substr(at + mark.size());
  return rest.substr(0, rest.find('\n'));
}

/// One line fit for a table: no control characters, no full stop at its end, not too long.
std::string make_sentence(std::string_view line) {
  std::string text;
  for (const char letter : line.substr(0, kMostReason)) text += static_cast<unsigned char>(letter) < 0x20 || letter == 0x7f ? ' ' : letter;
  while (line.size() > kMostReason && !text.empty() && (static_cast<unsigned char>(text.back()) & 0x80) != 0) text.pop_back();
  while (!text.empty() && (text.back() == '.' || text.back() == ' ')) text.pop_back();
  return text;
}

/// X of "needs X GB" and "needs about X GB"; 0 when it is not there.
double find_need_gb(std::string_view line) {
  std::size_t at = line.find("needs ");
  for (; at != std::string_view::npos; at = line.find("needs ", at + 1)) {
    std::string_view rest = line.substr(at + 6);
    if (rest.starts_with("about ")) rest.remove_prefix(6);
    double value = 0.0;
    const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
    if (error != std::errc() || !std::isfinite(value) || value < 0.0) continue;
    const std::string_view unit = rest.substr(static_cast<std::size_t>(end - rest.data()));
    if (unit.starts_with(" GB") && (unit.size() == 3 || std::isalnum(static_cast<unsigned char>(unit[3])) == 0)) return value;
  }
  return 0.0;
}

/// What mpirun says of a rank that a signal ended: "rank 1 on node3"; empty when it says nothing.
std::string find_dead_rank(std::string_view log) {
  const std::string_view line = find_last_after(log, "mpirun noticed that process ");
  const std::size_t pid = line.find(" with PID "), node = line.find(" on node ");
  if (pid == std::string_view::npos || node == std::string_view::npos) return {};
  const std::string_view host = line.substr(node + 9);
  return fmt::format("{} on {}", line.substr(0, pid), host.substr(0, host.find(' ')));
}

Verdict classify_signal(const Ending& ending) {
  const int signal = ending.exit_code - 128;
  const std::string rank = find_dead_rank(ending.log);
  const std::string who = rank.empty() ? "the solver" : make_sentence(rank);
  const char* name = sigdescr_np(signal);
  const std::string what = fmt::format("signal {} ({})", signal, name != nullptr ? name : "unknown");
  if (signal == SIGKILL && ending.was_kernel_out_of_memory)
    return {Cause::memory, fmt::format("{} was killed by {} while the kernel was out of memory", who, what), 0.0};
  for (const int own : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGSYS, SIGTRAP}) {
    if (signal == own) return {Cause::crashed, fmt::format("{} crashed by {}", who, what), 0.0};
  }
  return {Cause::killed, fmt::format("{} was killed by {}", who, what), 0.0};
}

/// Exit code 4: the program says why, in words.
Verdict classify_system(std::string_view error) {
  if (holds(error, "No space left on device") || holds(error, "Disk quota exceeded")) return {Cause::disk_full, make_sentence(error), 0.0};
  const double need_gb = find_need_gb(error);
  if (need_gb > 0.0 || holds(error, "ut of memory") || holds(error, "Cannot allocate memory"))
    return {Cause::memory, make_sentence(error), need_gb};
  return {Cause::system, make_sentence(error), 0.0};
}

}  // namespace

Verdict classify(const Ending& ending) {
  const int code = ending.exit_code;
  const std::string_view error = find_last_after(ending.log, "carillon-precompute: error: ");
  const auto say = [&](std::string_view otherwise) { return make_sentence(error.empty() ? otherwise : error); };
  if (code == 0) return {Cause::done, "", 0.0};
  // What we did ourselves explains whatever code follows from it; an error that the program names does not come from a signal.
  if (error.empty() && ending.was_hung)
    return {Cause::hung, fmt::format("hung: no progress and no work for {:.0f} s, and was killed", ending.hang_s), 0.0};
  if (error.empty() && ending.was_out_of_time) {
    const bool is_saved = code == kExitCheckpointed;
    return {Cause::time_limit, fmt::format("time limit reached; {}", is_saved ? "saved, and resumes from there" : "nothing was saved"),
            0.0};
  }
  if (error.empty() && ending.was_asked_to_stop) return {Cause::stopped, code == kExitCheckpointed ? "stopped and saved" : "stopped", 0.0};
  if (code == 2 && !ending.is_disk_full) return {Cause::bad_input, say("the program refused its input without a word"), 0.0};
  if (code == 3) return {Cause::no_solution, say("the program found no solution and did not say why"), 0.0};
  if (code == kExitCheckpointed) return {Cause::checkpointed, "saved and stopped, as a signal asked", 0.0};
  Verdict verdict;
  if (code == 4 && !error.empty()) {
    verdict = classify_system(error);
  } else if (code == kExitNodeLost) {
    verdict = {Cause::node_lost, "contact with a machine of the job was lost", 0.0};
  } else if (code > 128 && code < 128 + NSIG) {
    verdict = classify_signal(ending);
  } else if (!error.empty()) {
    verdict = {Cause::system, make_sentence(error), 0.0};
  } else {
    const std::string rank = find_dead_rank(ending.log);
    verdict = {Cause::node_lost,
               rank.empty() ? fmt::format("the solver ended with exit code {} and no error of its own", code)
                            : make_sentence(rank + " ended before its time"),
               0.0};
  }
  if (ending.is_disk_full && verdict.cause != Cause::disk_full && verdict.cause != Cause::memory)
    return {Cause::disk_full, fmt::format("the disk or quota is full ({})", verdict.reason), 0.0};
  return verdict;
}

}  // namespace carillon::outcome
