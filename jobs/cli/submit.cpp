// carillon submit: adds jobs to store and registry.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "jobs/cli/commands.hpp"
#include "jobs/cli/follow.hpp"
#include "jobs/cli/gather.hpp"
#include "jobs/cli/slurm.hpp"
#include "jobs/store/warning_kinds.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

constexpr std::size_t kMaxShown = 20;

/// One line of the result.
struct SubmitResult {
  const Source* source = nullptr;
  std::optional<registry::Job> job;  // none: its source has an error
  bool is_new = false;               // created by this call
};

/// Updates an existing row: requeues cancelled and lost jobs, applies explicit resource requests.
void renew(Shared& shared, const SubmitOptions& options, const Source& source, bool was_made) {
  shared.registry().update(store::require_id(source.request.id, "request"), [&](registry::Job& job) {
    if (job.state == registry::JobState::running || (job.state == registry::JobState::done && !was_made)) return false;
    const bool is_wanted = job.state == registry::JobState::done || is_submitted_again(job, !was_made);
    if (is_wanted) {
      job.state = registry::JobState::queued;
      job.reason.clear();
      job.cancel_wanted = false;
      job.failures = 0;
    }
    const double memory_gb = source.request.resources.memory_gb;  // of the job file or the command line
    const bool is_other = memory_gb > 0.0 && memory_gb != job.resources.memory_gb;
    if (is_other) job.resources.memory_gb = memory_gb;
    return options.resources.apply(job) || is_wanted || is_other;
  });
}

std::vector<SubmitResult> enter(Shared& shared, const SubmitOptions& options, const std::vector<Source>& sources) {
  shared.registry();  // reconciled before new folders exist
  const store::Lock lock = shared.store().lock_shared();
  std::vector<registry::Submission> submissions;
  std::vector<store::Asked> asked;
  for (const Source& source : sources) {
    if (!source.error.empty()) continue;
    asked.push_back({&source.order, &source.request});
    submissions.push_back({source.job_file, source.request});
  }
  const std::vector<bool> was_made = store::prepare_work(shared.store(), asked);
  const std::vector<bool> was_inserted = shared.registry().submit(submissions);
  std::vector<SubmitResult> results;
  std::size_t at = 0;
  for (const Source& source : sources) {
    SubmitResult& result = results.emplace_back();
    result.source = &source;
    if (!source.error.empty()) continue;
    const std::size_t index = at++;
    if (!was_inserted[index]) renew(shared, options, source, was_made[index]);
    result.is_new = was_made[index];
    result.job = shared.registry().find(store::require_id(source.request.id, "request"));
  }
  return results;
}

void print_errors(const std::vector<Source>& sources) {
  std::size_t count = 0;
  for (const Source& source : sources) {
    if (!source.error.empty() && ++count <= kMaxShown) fmt::print(stderr, "carillon: {}\n", show_message(source.error));
  }
  if (count > kMaxShown) fmt::print(stderr, "carillon: ... and {} more\n", count - kMaxShown);
}

/// Warnings of the solver, with line numbers of the submitted job file.
std::vector<std::string> find_own_warnings(Shared& shared, const SubmitResult& result) {
  std::vector<std::string> warnings = find_warnings(shared, *result.job, result.source->job_file);
  std::vector<std::string> own = result.source->order.warnings();
  for (std::string& warning : warnings) {
    if (!warning.starts_with(result.source->job_file + ": ")) continue;
    const std::string text = warning.substr(result.source->job_file.size());
    const auto fits = std::find_if(own.begin(), own.end(), [&](const std::string& line) { return line.ends_with(text); });
    if (fits == own.end()) continue;
    warning = store::to_text(*fits);
    own.erase(fits);
  }
  return warnings;
}

base::Json describe_results(Shared& shared, const std::vector<SubmitResult>& results) {
  base::Json root;
  root.set("store", to_json(shared.store().root().string())).set("jobs", base::Json::array()).set("errors", base::Json::array());
  for (const SubmitResult& result : results) {
    base::Json entry;
    if (result.job) {
      entry = describe(shared, *result.job);
      entry["warnings"] = to_json(find_own_warnings(shared, result));
    }
    entry["job_file"] = to_json(result.source->job_file);
    if (result.job) {
      entry["new"] = result.is_new;
      root["jobs"].append(entry);
    } else {
      entry["error"] = to_json(result.source->error);
      root["errors"].append(entry);
    }
  }
  return root;
}

void print_warnings(Shared& shared, const std::vector<SubmitResult>& results) {
  store::WarningKinds kinds;
  for (const SubmitResult& result : results) {
    if (!result.job) continue;
    for (const std::string& warning : find_own_warnings(shared, result)) {
      if (results.size() > 1)
        kinds.add(show(result.job->name), show_message(warning));
      else
        fmt::print(stderr, "carillon: {}: warning: {}\n", show(result.job->name), show_message(warning));
    }
  }
  for (const std::string& line : kinds.list()) fmt::print(stderr, "carillon: warning {}\n", line);
}

void print_lines(Shared& shared, const std::vector<SubmitResult>& results) {
  std::map<std::string, std::size_t> counts;
  std::size_t shown = 0, total = 0;
  for (const SubmitResult& result : results) {
    if (!result.job) continue;
    const registry::Job& job = *result.job;
    const std::string state = to_text(job.state) + (result.is_new                           ? ""
                                                    : job.state == registry::JobState::done ? ", nothing to do"
                                                                                            : ", known");
    ++counts[state];
    if (++total <= kMaxShown || job.state == registry::JobState::failed) {
      ++shown;
      fmt::print("{}  {:<22} {}\n", job.id.short_text(), state, show(result.source->job_file));
      if (job.state == registry::JobState::failed)
        fmt::print("              it failed before: {}; carillon retry {} requeues it\n", show_message(find_reason(shared, job)),
                   job.id.short_text());
    }
  }
  if (shown < total) fmt::print("... and {} more\n", total - shown);
  if (total > 1) {
    std::string sum;
    for (const auto& [state, count] : counts) sum += fmt::format("{}{} {}", sum.empty() ? "" : "; ", count, state);
    fmt::print("{} jobs: {}\n", total, sum);
  }
}

/// Submits to Slurm and updates the results.
void hand_over(Shared& shared, std::vector<SubmitResult>& results) {
  follow_slurm(shared);
  hand_over_to_slurm(shared);
  for (SubmitResult& result : results) {
    if (result.job) result.job = shared.registry().find(result.job->id);
  }
}

}  // namespace

int run_submit(Shared& shared, const SubmitOptions& options) {
  const store::JobEngine engine = store::find_engine(options.resources.engine).value_or(shared.profile().engine);
  if (engine == store::JobEngine::slurm) check_slurm();
  std::vector<Source> sources = gather(options.words, read_solver_version());
  bool is_bad = false, is_good = false;
  for (Source& source : sources) {
    options.resources.apply(source.request);
    source.request.engine = engine;
    (source.error.empty() ? is_good : is_bad) = true;
  }
  if (is_bad && !shared.json) print_errors(sources);
  std::vector<SubmitResult> results;
  if (!is_bad || (options.keep_going && is_good))
    results = enter(shared, options, sources);
  else
    for (const Source& source : sources) {
      if (!source.error.empty()) results.push_back({&source, {}, false});
    }
  if (is_bad && !(options.keep_going && is_good) && !shared.json) {
    if (sources.size() > 1) fmt::print(stderr, "carillon: nothing was submitted; --keep-going submits the others\n");
    return kExitInput;
  }
  std::vector<store::Id> ids;
  for (const SubmitResult& result : results) {
    if (result.job) ids.push_back(result.job->id);
  }
  const bool follows = options.wait || options.run;
  const bool is_for_slurm = std::any_of(results.begin(), results.end(), [](const SubmitResult& result) {
    return result.job && result.job->engine == store::JobEngine::slurm;
  });
  if (is_for_slurm) hand_over(shared, results);
  shared.hands_over = is_for_slurm && follows;
  if (!shared.json && !options.is_quiet) print_lines(shared, results);
  if (!follows && shared.json) print_json(describe_results(shared, results));
  if (is_bad) std::fflush(stdout);
  int code = is_bad ? kExitInput : 0;
  if (follows && !ids.empty()) {
    const int end =
        options.run && !is_for_slurm ? run_until_done(shared, ids, options.has_pictures, options.is_quiet) : follow(shared, ids, false);
    if (code == 0) code = end;
    for (SubmitResult& result : results) {
      if (result.job) result.job = shared.registry().find(result.job->id);
    }
    if (shared.json)
      print_json(describe_results(shared, results));
    else if (!options.run || is_for_slurm || options.is_quiet)  // already printed by the queue
      print_warnings(shared, results);
  } else {
    if (!shared.json) print_warnings(shared, results);
    for (const SubmitResult& result : results) {
      if (code == 0 && result.job && !is_open(result.job->state) && result.job->state != registry::JobState::done) code = kExitSolve;
    }
  }
  return code;
}

}  // namespace carillon::cli
