// Method:     The outcome of the last attempt takes precedence; then the state of Slurm, which covers nodes and limits; then the output of
//             slurmstepd.
// Source:     squeue(1), "JOB STATE CODES" of Slurm 22.05; messages of slurmstepd.
#include <fmt/core.h>

#include <algorithm>

#include "jobs/queue/slurm/engine.hpp"

namespace carillon::slurm {
namespace {

using outcome::Cause;

/// The last non-empty line, without the prefix of slurmstepd.
std::string find_last_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  const std::size_t start = text.rfind('\n');
  std::string line = start == std::string::npos ? text : text.substr(start + 1);
  for (const char* head : {"slurmstepd: error: ", "slurmstepd: ", "error: "}) {
    if (line.starts_with(head)) line.erase(0, std::string(head).size());
  }
  line.erase(std::remove(line.begin(), line.end(), '*'), line.end());
  line.erase(0, std::min(line.find_first_not_of(' '), line.size()));
  return line.substr(0, line.find_last_not_of(" .") + 1);
}

bool is_out_of_memory(const std::optional<SlurmStatus>& seen, const std::string& output) {
  return (seen && seen->state == "OUT_OF_MEMORY") || output.find("exceeded memory limit") != std::string::npos ||
         output.find("exceeded job memory limit") != std::string::npos || output.find("oom-kill") != std::string::npos;
}

/// Without an outcome of the attempt.
std::pair<Cause, std::string> find_cause(const std::optional<SlurmStatus>& seen, const std::string& output) {
  const std::string last = find_last_line(output), said = last.empty() ? "" : ": " + last;
  if (is_out_of_memory(seen, output)) return {Cause::memory, "Slurm ended it for exceeding its memory" + said};
  if (!seen) return {Cause::killed, "Slurm no longer knows the job, and it left no outcome" + said};
  if (seen->state == "TIMEOUT" || seen->state == "DEADLINE") return {Cause::time_limit, "Slurm ended it at its time limit"};
  if (seen->state == "NODE_FAIL" || seen->state == "BOOT_FAIL") return {Cause::node_lost, "Slurm lost its node"};
  if (seen->state == "PREEMPTED") return {Cause::stopped, "preempted by a job of higher priority"};
  if (seen->state == "COMPLETED") return {Cause::killed, "the Slurm job completed without a bank; check the prologue of the script" + said};
  if (seen->exit_code == 126 || seen->exit_code == 127) return {Cause::no_program, "carillon could not be started on the node" + said};
  if (seen->exit_code == 75) return {Cause::killed, "another attempt was still running in its folder"};
  if (seen->signal > 0)
    return {Cause::killed, fmt::format("killed by signal {} (Slurm: {}, {}){}", seen->signal, seen->state, seen->reason, said)};
  return {Cause::killed,
          fmt::format("the Slurm job ended with exit code {} (Slurm: {}, {}){}", seen->exit_code, seen->state, seen->reason, said)};
}

}  // namespace

SlurmOutcome judge(const store::Store& store, const store::Id& id, const SubmittedJob& submitted, const std::optional<SlurmStatus>& seen) {
  const std::filesystem::path work = store.work_folder(id);
  const std::string output = read_output(store.root(), submitted);
  const std::optional<outcome::Attempt> attempt = outcome::read_attempt(work);
  const std::optional<outcome::Outcome> left = outcome::read_outcome(work);
  const bool has_begun = attempt && attempt->token != submitted.before;
  SlurmOutcome judgement;
  judgement.is_cancelled = seen && seen->state.starts_with("CANCELLED");
  if (has_begun && left && left->token == attempt->token) {
    judgement.outcome = *left;
    const bool is_vague = left->cause == Cause::killed || left->cause == Cause::crashed || left->cause == Cause::stopped;
    if (is_vague && is_out_of_memory(seen, output)) std::tie(judgement.outcome.cause, judgement.outcome.reason) = find_cause(seen, output);
    if (left->cause == Cause::stopped && seen && seen->state == "TIMEOUT") judgement.outcome.cause = Cause::time_limit;
    return judgement;
  }
  judgement.outcome = outcome::make_killed(has_begun ? attempt->token : "");
  std::tie(judgement.outcome.cause, judgement.outcome.reason) = find_cause(seen, output);
  return judgement;
}

}  // namespace carillon::slurm
