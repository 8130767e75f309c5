// Method:     Slurm's commands are run without a shell, with output formats that are stable since Slurm 20. Their JSON is not used:
//             scontrol of 22.05 has none, and squeue --json prints all fields of all jobs.
// Source:     squeue(1), scontrol(1), sacct(1), sbatch(1) of Slurm 22.05.
#include "jobs/queue/slurm/client.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <set>

#include "jobs/queue/slurm/command.hpp"

namespace carillon::slurm {
namespace {

constexpr std::size_t kMaxAtOnce = 500;  // jobs per command line

std::vector<std::string_view> split(std::string_view text, char at) {
  std::vector<std::string_view> parts;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(at), text.size());
    parts.push_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return parts;
}

std::string strip(std::string_view text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.remove_suffix(1);
  std::string line(text);
  std::replace(line.begin(), line.end(), '\n', ';');
  return line;
}

/// True for the errors of a missing, busy or restarting controller.
bool is_unreachable(const Finished& finished) {
  constexpr std::array<std::string_view, 12> kPhrases{"nable to contact slurm controller",
                                                      "Connection refused",
                                                      "Connection timed out",
                                                      "Socket timed out",
                                                      "Zero Bytes were transmitted",
                                                      "ommunication connection failure",
                                                      "onnect failure",
                                                      "not responding",
                                                      "temporarily unable",
                                                      "Resource temporarily unavailable",
                                                      "in standby mode",
                                                      "rotocol authentication error"};
  return finished.was_slow || finished.was_long || std::any_of(kPhrases.begin(), kPhrases.end(), [&](std::string_view phrase) {
           return finished.errors.find(phrase) != std::string::npos;
         });
}

bool is_unknown_job(const Finished& finished) {
  // The second, on standard output, for a task of an array that was cancelled while pending.
  return finished.errors.find("nvalid job id") != std::string::npos || finished.output.ends_with(" not found\n");
}

/// Runs a command of Slurm. Unreachable if it is missing or gets no answer.
Finished ask(const std::vector<std::string>& words, std::string_view input = {}) {
  Finished finished = run_command(words, input);
  if (finished.exit_code == 127)
    throw Unreachable(fmt::format("{} is not in PATH; install slurm-client, or load the site's module", words[0]));
  if (finished.exit_code != 0 && is_unreachable(finished))
    throw Unreachable(fmt::format("Slurm does not answer ({}: {})", words[0],
                                  finished.was_slow   ? "no answer for a minute"
                                  : finished.was_long ? "too much output"
                                                      : strip(finished.errors)));
  return finished;
}

[[noreturn]] void refuse(const std::vector<std::string>& words, const Finished& finished) {
  throw SystemError(fmt::format("Slurm refuses ({}): {}", words[0], strip(finished.errors.empty() ? finished.output : finished.errors)));
}

int parse_int(std::string_view text) {
  int value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// The value of the first " Key=" of a line, up to the next space.
std::string_view find_value(std::string_view line, std::string_view key) {
  std::size_t at = 0;
  while ((at = line.find(key, at)) != std::string_view::npos) {
    if ((at == 0 || line[at - 1] == ' ') && line.substr(at + key.size()).starts_with('=')) {
      const std::string_view rest = line.substr(at + key.size() + 1);
      return rest.substr(0, rest.find_first_of(" \n"));
    }
    at += key.size();
  }
  return {};
}

/// Parses "0:9", exit code and signal.
void take_exit_code(std::string_view text, SlurmStatus& seen) {
  const std::size_t colon = text.find(':');
  seen.exit_code = parse_int(text.substr(0, colon));
  if (colon != std::string_view::npos) seen.signal = parse_int(text.substr(colon + 1));
}

/// The status of a job from accounting; none without accounting.
std::optional<SlurmStatus> find_in_accounting(const std::string& job) {
  const Finished finished =
      run_command({"sacct", "--noheader", "--parsable2", "--allocations", "--jobs=" + job, "--format=State,ExitCode"});
  const std::vector<std::string_view> lines = split(finished.output, '\n');
  if (finished.exit_code != 0 || lines.empty()) return std::nullopt;
  const std::vector<std::string_view> fields = split(lines.back(), '|');
  if (fields.size() < 2) return std::nullopt;
  SlurmStatus seen;
  seen.state = std::string(fields[0].substr(0, fields[0].find(' ')));  // "CANCELLED by 1000"
  seen.phase = find_phase(seen.state);
  take_exit_code(fields[1], seen);
  return seen;
}

}  // namespace

std::string find_array(const std::string& job) { return job.substr(0, job.find('_')); }
std::string find_task(const std::string& job) { return job.substr(0, job.find('.')); }
bool is_packed(const std::string& job) { return job.find('.') != std::string::npos; }

SlurmPhase find_phase(std::string_view state) {
  for (const std::string_view known :
       {"PENDING", "CONFIGURING", "REQUEUED", "REQUEUE_FED", "REQUEUE_HOLD", "RESV_DEL_HOLD", "SPECIAL_EXIT"}) {
    if (state == known) return SlurmPhase::waits;
  }
  for (const std::string_view known : {"RUNNING", "COMPLETING", "SUSPENDED", "STOPPED", "SIGNALING", "STAGE_OUT", "RESIZING"}) {
    if (state == known) return SlurmPhase::runs;
  }
  return SlurmPhase::ended;
}

std::map<std::string, SlurmStatus> parse_list(std::string_view text) {
  std::map<std::string, SlurmStatus> jobs;
  for (const std::string_view line : split(text, '\n')) {
    const std::vector<std::string_view> fields = split(line, '|');
    if (fields.size() < 2 || fields[0].empty()) continue;
    SlurmStatus seen;
    seen.state = fields[1];
    seen.phase = find_phase(seen.state);
    if (fields.size() > 2) seen.reason = fields[2];
    jobs[std::string(fields[0])] = seen;
  }
  return jobs;
}

std::optional<Machine> parse_nodes(std::string_view text, std::string_view partition) {
  constexpr double kMemoryShare = 0.95;                             // usable share of a node
  std::map<std::pair<int, int>, std::set<std::string_view>> alike;  // by cores and MiB
  for (const std::string_view line : split(text, '\n')) {
    const std::vector<std::string_view> fields = split(line, '|');
    if (fields.size() < 6) continue;
    const bool is_default = fields[1].ends_with('*');
    const std::string_view name = is_default ? fields[1].substr(0, fields[1].size() - 1) : fields[1];
    const bool is_wanted = partition.empty() ? is_default : name == partition;
    const bool is_up =
        fields[5].starts_with("idle") || fields[5].starts_with("alloc") || fields[5].starts_with("mix") || fields[5].starts_with("comp");
    const int cores = parse_int(fields[2]) * parse_int(fields[3]);
    if (is_wanted && is_up && cores > 0) alike[{cores, parse_int(fields[4])}].insert(fields[0]);
  }
  std::optional<Machine> most;
  for (const auto& [kind, names] : alike) {
    const auto nodes = static_cast<int>(names.size());
    if (!most || nodes * kind.first > most->nodes * most->cores) most = Machine{nodes, kind.first, kMemoryShare * kind.second * 1048576e-9};
  }
  return most;
}

std::optional<SlurmStatus> parse_show(std::string_view line) {
  SlurmStatus seen;
  seen.state = find_value(line, "JobState");
  if (seen.state.empty()) return std::nullopt;
  seen.phase = find_phase(seen.state);
  seen.reason = find_value(line, "Reason");
  seen.restarts = parse_int(find_value(line, "Restarts"));
  take_exit_code(find_value(line, "ExitCode"), seen);
  return seen;
}

std::string SlurmClient::submit(const Batch& batch) const {
  const std::vector<std::string> words = make_sbatch(batch, settings_);
  const Finished finished = ask(words, make_script(batch, settings_));
  const std::string number = strip(finished.output.substr(0, finished.output.find_first_of(";\n")));  // "123;cluster"
  if (finished.exit_code != 0 || number.empty() || number.find_first_not_of("0123456789") != std::string::npos) refuse(words, finished);
  return number;
}

std::map<std::string, SlurmStatus> SlurmClient::list(const std::vector<std::string>& jobs) const {
  std::set<std::string> numbers;
  for (const std::string& job : jobs) numbers.insert(find_array(job));
  std::map<std::string, SlurmStatus> all;
  for (auto at = numbers.begin(); at != numbers.end();) {
    std::string names;
    for (std::size_t count = 0; count < kMaxAtOnce && at != numbers.end(); ++count, ++at) names += (names.empty() ? "" : ",") + *at;
    const std::vector<std::string> words{"squeue", "--noheader", "--array", "--states=all", "--format=%i|%T|%r", "--jobs=" + names};
    const Finished finished = ask(words);
    if (finished.exit_code != 0 && !is_unknown_job(finished)) refuse(words, finished);
    all.merge(parse_list(finished.output));
  }
  return all;
}

std::optional<SlurmStatus> SlurmClient::find_end(const std::string& job) const {
  const std::vector<std::string> words{"scontrol", "--oneliner", "show", "job", job};
  const Finished finished = ask(words);
  if (finished.exit_code != 0 && !is_unknown_job(finished)) refuse(words, finished);
  if (finished.exit_code == 0) {
    if (const auto seen = parse_show(finished.output)) return seen;
  }
  return find_in_accounting(job);
}

std::optional<std::string> SlurmClient::find_by_title(const std::string& title, const std::string& batch) const {
  const std::vector<std::string> words{"squeue", "--noheader", "--states=all", "--format=%F|%k", "--name=" + title};
  const Finished finished = ask(words);
  if (finished.exit_code != 0) refuse(words, finished);
  for (const std::string_view line : split(finished.output, '\n')) {
    if (line.find(batch) != std::string_view::npos) return strip(line.substr(0, line.find('|')));
  }
  return std::nullopt;
}

void SlurmClient::cancel(const std::vector<std::string>& jobs) const {
  for (std::size_t at = 0; at < jobs.size(); at += kMaxAtOnce) {
    std::vector<std::string> words{"scancel", "--quiet"};
    words.insert(words.end(), jobs.begin() + static_cast<std::ptrdiff_t>(at),
                 jobs.begin() + static_cast<std::ptrdiff_t>(std::min(at + kMaxAtOnce, jobs.size())));
    const Finished finished = ask(words);
    if (finished.exit_code != 0 && !is_unknown_job(finished)) refuse(words, finished);
  }
}

bool SlurmClient::is_running(const std::string& job) const {
  const Finished finished = ask({"squeue", "--noheader", "--format=%T", "--jobs=" + job});
  return finished.exit_code == 0 && strip(finished.output) == "RUNNING";
}

void SlurmClient::requeue(const std::string& job, double delay_s) const {
  const std::vector<std::string> words{"scontrol", "requeue", job};
  const Finished finished = ask(words);
  if (finished.exit_code != 0) refuse(words, finished);
  if (delay_s > 0.0)
    ask({"scontrol", "update", "JobId=" + job, fmt::format("StartTime=now+{}", static_cast<long long>(std::ceil(delay_s)))});
}

std::optional<Machine> SlurmClient::find_machine() const {
  const Finished finished = ask({"sinfo", "--noheader", "--Node", "--format=%N|%P|%X|%Y|%m|%T"});
  std::optional<Machine> machine = parse_nodes(finished.output, settings_.partition);
  if (settings_.pack_cores > 0 && !machine) machine.emplace();
  if (!machine) return machine;
  if (settings_.pack_cores > 0) {
    // Several tasks per node.
    machine->nodes *= std::max(1, machine->cores / settings_.pack_cores);
    machine->memory_gb *= std::min(1.0, static_cast<double>(settings_.pack_cores) / machine->cores);
    machine->cores = settings_.pack_cores;
  }
  if (settings_.pack_nodes > 0) machine->nodes = settings_.pack_nodes;
  if (settings_.max_running > 0) machine->nodes = std::min(machine->nodes, settings_.max_running);
  return machine;
}

int SlurmClient::find_max_tasks() const {
  const Finished finished = ask({"scontrol", "show", "config"});
  int max = settings_.max_in_array;
  for (const std::string_view line : split(finished.output, '\n')) {
    if (!line.starts_with("MaxArraySize")) continue;
    const std::size_t equal = line.find("= ");
    if (equal != std::string_view::npos) max = std::min(max, parse_int(line.substr(equal + 2)) - 1);
  }
  return std::max(max, 1);
}

}  // namespace carillon::slurm
