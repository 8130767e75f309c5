// carillon explain: whether a job would run, and its differences from the last submission of the job file.
#include <fmt/core.h>

#include <algorithm>
#include <map>

#include "jobs/cli/commands.hpp"
#include "jobs/cli/gather.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"

namespace carillon::cli {
namespace {

/// A changed part of the id.
struct Change {
  std::string part;    // "mesh", "surface", "solver", "job"
  std::string key;     // of the job: "material.density_kg_m3"; else empty
  std::string before;  // JSON; empty: none
  std::string after;
};

void flatten(const base::Json& value, const std::string& name, std::map<std::string, std::string>& leaves) {
  if (value.is_object() && !value.empty()) {
    for (const std::string& key : value.keys()) flatten(value[key], name.empty() ? key : name + "." + key, leaves);
    return;
  }
  leaves[name] = value.sorted_text({.is_ascii = false});
}

std::map<std::string, std::string> read_leaves(const std::string& job) {
  std::map<std::string, std::string> leaves;
  if (const auto root = base::Json::parse(job)) flatten(*root, "", leaves);
  return leaves;
}

/// Input files of a simulation, in the order of its bodies.
void add_input_changes(const std::vector<store::Input>& before, const std::vector<store::Input>& after, std::vector<Change>& changes) {
  for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i)
    if (before[i].sha256 != after[i].sha256)
      changes.push_back(
          {to_text(after[i].kind), after[i].file, "SHA-256 " + before[i].sha256.substr(0, 12), "SHA-256 " + after[i].sha256.substr(0, 12)});
}

std::vector<Change> find_changes(const store::Request& before, const store::Request& after) {
  std::vector<Change> changes;
  if (before.input_kind != after.input_kind)
    changes.push_back({"input", "", to_text(before.input_kind), to_text(after.input_kind)});
  else if (after.input_kind == store::InputKind::simulation)
    add_input_changes(before.inputs, after.inputs, changes);
  else if (before.input_sha256 != after.input_sha256)
    changes.push_back(
        {to_text(after.input_kind), "", "SHA-256 " + before.input_sha256.substr(0, 12), "SHA-256 " + after.input_sha256.substr(0, 12)});
  else if (before.input_format != after.input_format)
    changes.push_back({to_text(after.input_kind), "", "format " + before.input_format, "format " + after.input_format});
  if (before.solver != after.solver) changes.push_back({"solver", "", before.solver, after.solver});
  const auto old_leaves = read_leaves(before.job), new_leaves = read_leaves(after.job);
  for (const auto& [key, value] : old_leaves) {
    const auto found = new_leaves.find(key);
    if (found == new_leaves.end())
      changes.push_back({"job", key, value, ""});
    else if (found->second != value)
      changes.push_back({"job", key, value, found->second});
  }
  for (const auto& [key, value] : new_leaves) {
    if (old_leaves.count(key) == 0) changes.push_back({"job", key, "", value});
  }
  return changes;
}

std::string format_change(const Change& change, const store::Request& request) {
  const std::string before = change.before.empty() ? "missing" : show(change.before),
                    after = change.after.empty() ? "missing" : show(change.after);
  if (change.part == "job") return fmt::format("{}: was {}, is {}", show(change.key), before, after);
  if (change.part == "solver") return fmt::format("solver: was {}, is {}", before, after);
  if (change.part == "input") return fmt::format("input: was a {}, is a {}", before, after);
  const std::string& file = change.key.empty() ? request.input_file : change.key;
  return fmt::format("{} {}: content was {}, is {}", change.part, show(file), before, after);
}

/// Effect of a submission, as a word for programs and a line for display.
struct Explanation {
  std::string word;  // "done", "running", "queued", "waiting", "failed", "cancelled", "new"
  std::string line;
  bool would_run = false;
};

/// Location of the results, for display.
std::string describe_results(const store::Store& store, const store::Id& id) {
  const auto results = list_results(store, id);
  if (const auto bank = results.find("bank"); bank != results.end()) return "its bank is " + show(bank->second.string(), 4000);
  return "its files are in " + show(store.bank_folder(id).string(), 4000);
}

Explanation explain(Shared& shared, const store::Id& id, const std::optional<registry::Job>& job) {
  if (shared.store().has_bank(id)) return {"done", fmt::format("nothing would run: {}", describe_results(shared.store(), id)), false};
  if (shared.store().has_bank_folder(id) && !(job && is_open(job->state)))
    return {"failed",
            fmt::format("it would run: {}; carillon submit, or retry, computes it again",
                        show_message(shared.store().find_bank_fault(id, store::Look::quick).value_or("its bank is damaged"))),
            true};
  if (!job) return {"new", "it would run: the store has no bank for these inputs", true};
  const std::string state = to_text(job->state), reason = show_message(find_reason(shared, *job));
  if (job->state == registry::JobState::cancelled) return {state, "it would run: it was cancelled; carillon submit requeues it", true};
  if (is_submitted_again(*job, shared.store().has_work(id)))
    return {state, fmt::format("it would run: it failed before it ran, {}; carillon submit requeues it", reason), true};
  if (job->state == registry::JobState::failed)
    return {state, fmt::format("nothing would run: it failed, {}; carillon retry {} tries again", reason, id.short_text()), false};
  return {state, fmt::format("nothing new would run: it is already {}", state), false};
}

/// JSON of one job; null in text mode.
base::Json explain_one(Shared& shared, const Source& source) {
  if (!source.error.empty()) throw InputError(source.error);
  const store::Id id = store::require_id(source.request.id, source.job_file);
  const auto job = shared.registry().find(id);
  const auto last = shared.registry().find_last_submission(source.job_file);
  const Explanation explanation = explain(shared, id, job);
  const std::vector<Change> changes = last ? find_changes(last->request, source.request) : std::vector<Change>();
  if (shared.json) {
    base::Json root;
    root.set("id", id.text()).set("job_file", to_json(source.job_file)).set("state", explanation.word);
    root.set("would_run", explanation.would_run).set("why", to_json(explanation.line));
    root.set("last_id", last ? base::Json(last->request.id) : base::Json()).set("changes", base::Json::array());
    for (const Change& change : changes) {
      base::Json entry;
      entry.set("part", change.part).set("key", change.key.empty() ? base::Json() : to_json(change.key));
      entry.set("before", change.before.empty() ? base::Json() : to_json(change.before));
      entry.set("after", change.after.empty() ? base::Json() : to_json(change.after));
      root["changes"].append(entry);
    }
    root["bank"] = base::Json();
    if (const auto results = list_results(shared.store(), id); explanation.word == "done" && results.count("bank") > 0)
      root["bank"] = to_json(results.at("bank").string());
    return root;
  }
  fmt::print("{}  {}\n{}\n", id.short_text(), show(source.job_file), explanation.line);
  if (!last)
    fmt::print("this job file has not been submitted to this store\n");
  else if (changes.empty())
    fmt::print("no changes since the last submission of this job file\n");
  else
    fmt::print("changes since the last submission of this job file (as {}):\n", last->request.id.substr(0, 12));
  for (const Change& change : changes) fmt::print("  {}\n", format_change(change, source.request));
  return {};
}

}  // namespace

int run_explain(Shared& shared, const ExplainOptions& options) {
  shared.only_reads = true;
  const std::string solver = read_solver_version();
  const std::vector<Source> sources = gather({options.word}, solver);
  shared.settle();
  base::Json root;
  for (const Source& source : sources) root["jobs"].append(explain_one(shared, source));
  if (shared.json) print_json(sources.size() == 1 ? root["jobs"][0] : root);
  return 0;
}

}  // namespace carillon::cli
