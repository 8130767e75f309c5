// carillon submit: jobs into the store and the registry. What is in the store already is not asked for again.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "jobs/cli/follow.hpp"
#include "jobs/cli/gather.hpp"
#include "jobs/cli/options.hpp"
#include "jobs/cli/shared.hpp"
#include "jobs/cli/slurm.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

constexpr std::size_t kMostShown = 20;

struct Options {
  std::vector<std::string> words;
  ResourceOptions resources;
  bool wait = false, run = false, keep_going = false;
};

/// One line of the answer.
struct Answer {
  const Source* source = nullptr;
  std::optional<registry::Job> job;  // none: its source has an error
  bool is_new = false;               // this call made it
};

/// A row that was there: cancelled and lost ones are wanted again, and what was asked for explicitly counts from now on.
void renew(Shared& shared, const Options& options, const Source& source, bool was_made) {
  shared.registry().update(store::require_id(source.request.id, "request"), [&](registry::Job& job) {
    if (job.state == registry::State::running || (job.state == registry::State::done && !was_made)) return false;
    const bool is_wanted = job.state == registry::State::done || is_submitted_again(job, !was_made);
    if (is_wanted) {
      job.state = registry::State::queued;
      job.reason.clear();
      job.cancel_wanted = false;
      job.failures = 0;
    }
    return options.resources.apply(job) || is_wanted;
  });
}

std::vector<Answer> enter(Shared& shared, const Options& options, const std::vector<Source>& sources) {
  shared.registry();  // brought up to date before there are new folders
  const store::Lock lock = shared.store().lock_shared();
  std::vector<registry::Submission> submissions;
  std::vector<store::Asked> asked;
  for (const Source& source : sources) {
    if (!source.error.empty()) continue;
    asked.push_back({&source.job, &source.request});
    submissions.push_back({source.job_file, source.request});
  }
  const std::vector<bool> was_made = store::prepare_work(shared.store(), asked);
  const std::vector<bool> was_inserted = shared.registry().submit(submissions);
  std::vector<Answer> answers;
  std::size_t at = 0;
  for (const Source& source : sources) {
    Answer& answer = answers.emplace_back();
    answer.source = &source;
    if (!source.error.empty()) continue;
    const std::size_t index = at++;
    if (!was_inserted[index]) renew(shared, options, source, was_made[index]);
    answer.is_new = was_made[index];
    answer.job = shared.registry().find(store::require_id(source.request.id, "request"));
  }
  return answers;
}

void print_errors(const std::vector<Source>& sources) {
  std::size_t count = 0;
  for (const Source& source : sources) {
    if (!source.error.empty() && ++count <= kMostShown) fmt::print(stderr, "carillon: {}\n", show_message(source.error));
  }
  if (count > kMostShown) fmt::print(stderr, "carillon: ... and {} more\n", count - kMostShown);
}

/// What the solver warned of: with the lines of the job file that was submitted, where its numbers are meant.
std::vector<std::string> find_own_warnings(Shared& shared, const Answer& answer) {
  std::vector<std::string> warnings = find_warnings(shared, *answer.job, answer.source->job_file);
  std::vector<std::string> own = answer.source->job.warnings;
  for (std::string& warning : warnings) {
    if (!warning.starts_with(answer.source->job_file + ": ")) continue;
    const std::string text = warning.substr(answer.source->job_file.size());
    const auto fits = std::find_if(own.begin(), own.end(), [&](const std::string& line) { return line.ends_with(text); });
    if (fits == own.end()) continue;
    warning = store::to_text(*fits);
    own.erase(fits);
  }
  return warnings;
}

Json::Value describe_answers(Shared& shared, const std::vector<Answer>& answers) {
  Json::Value root;
  root["store"] = to_json(shared.store().root().string());
  root["jobs"] = Json::arrayValue;
  root["errors"] = Json::arrayValue;
  for (const Answer& answer : answers) {
    Json::Value entry;
    if (answer.job) {
      entry = describe(shared, *answer.job);
      entry["warnings"] = to_json(find_own_warnings(shared, answer));
    }
    entry["job_file"] = to_json(answer.source->job_file);
    if (answer.job) {
      entry["new"] = answer.is_new;
      root["jobs"].append(entry);
    } else {
      entry["error"] = to_json(answer.source->error);
      root["errors"].append(entry);
    }
  }
  return root;
}

void print_warnings(Shared& shared, const std::vector<Answer>& answers) {
  std::size_t shown = 0;
  for (const Answer& answer : answers) {
    if (!answer.job) continue;
    for (const std::string& warning : find_own_warnings(shared, answer)) {
      if (++shown > kMostShown) return;
      fmt::print(stderr, "carillon: {}: warning: {}\n", show(answer.job->name), show_message(warning));
    }
  }
}

void print_lines(Shared& shared, const std::vector<Answer>& answers) {
  std::map<std::string, std::size_t> counts;
  std::size_t shown = 0, total = 0;
  for (const Answer& answer : answers) {
    if (!answer.job) continue;
    const registry::Job& job = *answer.job;
    const std::string state = to_text(job.state) + (answer.is_new                        ? ""
                                                    : job.state == registry::State::done ? ", nothing to do"
                                                                                         : ", known");
    ++counts[state];
    if (++total <= kMostShown || job.state == registry::State::failed) {
      ++shown;
      fmt::print("{}  {:<22} {}\n", job.id.short_text(), state, show(answer.source->job_file));
      if (job.state == registry::State::failed)
        fmt::print("              it failed before: {}; carillon retry {} tries again\n", show_message(find_reason(shared, job)),
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

bool is_open(const registry::Job& job) {
  return job.state == registry::State::queued || job.state == registry::State::waiting || job.state == registry::State::running;
}

/// To Slurm, and what became of it into the answers.
void hand_over(Shared& shared, std::vector<Answer>& answers) {
  follow_slurm(shared);
  hand_over_to_slurm(shared);
  for (Answer& answer : answers) {
    if (answer.job) answer.job = shared.registry().find(answer.job->id);
  }
}

int run_submit(Shared& shared, const Options& options) {
  const std::string engine = options.resources.engine.empty() ? shared.profile().engine : options.resources.engine;
  std::vector<Source> sources = gather(options.words, read_solver_version());
  bool is_bad = false, is_good = false;
  for (Source& source : sources) {
    options.resources.apply(source.request);
    source.request.engine = engine;
    (source.error.empty() ? is_good : is_bad) = true;
  }
  if (is_bad && !shared.json) print_errors(sources);
  std::vector<Answer> answers;
  if (!is_bad || (options.keep_going && is_good))
    answers = enter(shared, options, sources);
  else
    for (const Source& source : sources) {
      if (!source.error.empty()) answers.push_back({&source, {}, false});
    }
  if (is_bad && !(options.keep_going && is_good) && !shared.json) {
    if (sources.size() > 1) fmt::print(stderr, "carillon: nothing was submitted; --keep-going submits the others\n");
    return kExitInput;
  }
  std::vector<store::Id> ids;
  for (const Answer& answer : answers) {
    if (answer.job) ids.push_back(answer.job->id);
  }
  const bool follows = options.wait || options.run;
  const bool is_for_slurm =
      std::any_of(answers.begin(), answers.end(), [](const Answer& answer) { return answer.job && answer.job->engine == "slurm"; });
  if (is_for_slurm) hand_over(shared, answers);
  shared.hands_over = is_for_slurm && follows;
  if (!shared.json) print_lines(shared, answers);
  if (!follows && shared.json) print_json(describe_answers(shared, answers));
  if (is_bad) std::fflush(stdout);
  int code = is_bad ? kExitInput : 0;
  if (follows && !ids.empty()) {
    const int end = options.run && !is_for_slurm ? run_until_done(shared, ids) : follow(shared, ids, false);
    if (code == 0) code = end;
    for (Answer& answer : answers) {
      if (answer.job) answer.job = shared.registry().find(answer.job->id);
    }
    if (shared.json)
      print_json(describe_answers(shared, answers));
    else if (!options.run || is_for_slurm)  // the queue has told them
      print_warnings(shared, answers);
  } else {
    if (!shared.json) print_warnings(shared, answers);
    for (const Answer& answer : answers) {
      if (code == 0 && answer.job && !is_open(*answer.job) && answer.job->state != registry::State::done) code = kExitSolve;
    }
  }
  return code;
}

}  // namespace

void add_submit(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("submit",
                                         "Asks for banks. JOB.json is a job, a folder stands for its *.json, any other file is a manifest: "
                                         "one job file a line, or one job as JSON on one\n"
                                         "line; \"-\" reads a manifest from standard input. What is in the store already is not computed "
                                         "again. All jobs are read before any is submitted.");
  command->add_option("JOB", options->words, "Job files, folders, manifests")->required();
  options->resources.add(*command);
  command->add_flag("--keep-going", options->keep_going, "Submit the others when some jobs cannot be used (exit code 2 all the same)");
  command->add_flag("--wait", options->wait, "Wait until they have ended; somebody has to run the queue (carillon run, or Slurm)");
  command->add_flag("--run", options->run, "Work through the queue here until they have ended");
  command->callback([&shared, &run, options] { run = [&shared, options] { return run_submit(shared, *options); }; });
}

}  // namespace carillon::cli
