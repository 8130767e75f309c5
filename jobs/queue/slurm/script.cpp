// Method:     The templates deploy/slurm/job.sh and task.sh with @NAME@ replaced, paths in single quotes; options of sbatch as command line
//             arguments, without a shell.
// Source:     POSIX 2.2.2; sbatch(1), "filename pattern".
#include "jobs/queue/slurm/script.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "runtime/base/error.hpp"

namespace carillon::slurm {
namespace {

namespace fs = std::filesystem;

/// Single pass from left to right: replaced text is not scanned again.
std::string fill(std::string_view text, const std::vector<std::pair<std::string_view, std::string>>& values) {
  std::string result;
  while (!text.empty()) {
    const std::size_t at = std::min(text.find('@'), text.size());
    result += text.substr(0, at);
    text.remove_prefix(at);
    const auto fits = [&](const auto& value) { return text.starts_with(value.first); };
    const auto value = std::find_if(values.begin(), values.end(), fits);
    if (value != values.end()) {
      result += value->second;
      text.remove_prefix(value->first.size());
    } else if (!text.empty()) {
      result += text.front();
      text.remove_prefix(1);
    }
  }
  return result;
}

/// Escapes % in file names of sbatch. InputError for a backslash, which disables patterns.
std::string escape_pattern(const std::string& path) {
  std::string result;
  for (const char c : path) {
    if (c == '\\') throw InputError(fmt::format("{}: Slurm does not allow a backslash in the output path; choose another store", path));
    result += c;
    if (c == '%') result += c;
  }
  return result;
}

long long round_up(double value) { return static_cast<long long>(std::ceil(value)); }

/// At most half of the time limit.
long long calc_signal_s(const Batch& batch, const queue::SlurmSettings& settings) {
  const double max_s = batch.time_limit_s > 0.0 ? batch.time_limit_s / 2.0 : settings.signal_before_s;
  return std::max(1LL, round_up(std::min(settings.signal_before_s, max_s)));
}

}  // namespace

std::string quote_word(std::string_view word) {
  std::string result = "'";
  for (const char c : word) {
    if (c == '\n' || c == '\r' || c == '\0')
      throw InputError(fmt::format("'{}': newlines are not allowed in paths of a job script; choose another path", word));
    if (c == '\'')
      result += "'\\''";
    else
      result += c;
  }
  return result + "'";
}

std::string make_script(const Batch& batch, const queue::SlurmSettings& settings) {
  std::string prologue, folders, options;
  for (const std::string& line : settings.prologue) prologue += line + "\n";
  for (const std::string& word : settings.mpirun_options) options += " --mpirun-option=" + quote_word(word);
  if (settings.has_pictures) options += " --pictures";
  for (const std::string& folder : batch.folders) folders += (folders.empty() ? "" : " ") + quote_word(folder);
  return fill(batch.tasks > 0 ? kTaskScript : kJobScript, {{"@PROLOGUE@\n", prologue},
                                                           {"@FOLDERS@", folders},
                                                           {"@PROGRAM@", quote_word(batch.program.string())},
                                                           {"@STORE@", quote_word(batch.root.string())},
                                                           {"@BATCH@", quote_word(batch.name)},
                                                           {"@WORK@", quote_word((batch.root / "work").string())},
                                                           {"@RANKS@", std::to_string(batch.ranks)},
                                                           {"@MEMORY_GB@", fmt::format("{}", batch.memory_gb)},
                                                           {"@LAUNCHER@", settings.launcher},
                                                           {"@OPTIONS@", options}});
}

std::vector<std::string> make_sbatch(const Batch& batch, const queue::SlurmSettings& settings) {
  std::vector<std::string> words{"sbatch"};
  words.insert(words.end(), settings.options.begin(), settings.options.end());
  const auto add = [&](std::string word) { words.push_back(std::move(word)); };
  if (!settings.partition.empty()) add("--partition=" + settings.partition);
  if (!settings.account.empty()) add("--account=" + settings.account);
  if (!settings.qos.empty()) add("--qos=" + settings.qos);
  add("--parsable");
  add("--requeue");
  add("--open-mode=append");
  add(fmt::format("--signal=B:USR1@{}", calc_signal_s(batch, settings)));
  add("--job-name=" + batch.title);
  add("--comment=" + batch.comment + " " + batch.name);
  add("--chdir=" + batch.root.string());
  const bool is_packed = batch.tasks > 0, is_array = is_packed || batch.folders.size() > 1;
  add("--output=" + escape_pattern((batch.root / "slurm" / batch.name).string()) + (is_array ? "/%a.out" : "/0.out"));
  if (is_array) {
    const std::string limit = settings.max_running > 0 ? fmt::format("%{}", settings.max_running) : "";
    add(fmt::format("--array=0-{}{}", (is_packed ? batch.tasks : batch.folders.size()) - 1, limit));
  }
  if (is_packed) add("--nodes=1");
  add(fmt::format("--ntasks={}", batch.ranks));
  add("--cpus-per-task=1");
  // Per core: the ranks may be on several nodes.
  if (batch.memory_gb > 0.0) add(fmt::format("--mem-per-cpu={}M", round_up(batch.memory_gb * 1e9 / 1048576.0 / batch.ranks)));
  if (batch.time_limit_s > 0.0) add(fmt::format("--time={}", round_up(batch.time_limit_s / 60.0)));
  return words;
}

fs::path make_output_file(const fs::path& root, const std::string& batch, int task) {
  return root / "slurm" / batch / fmt::format("{}.out", task);
}

}  // namespace carillon::slurm
