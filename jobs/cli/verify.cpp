// carillon verify: checks and repairs banks, records, inputs and folders of work.
#include <fmt/core.h>
#include <unistd.h>

#include <map>
#include <set>

#include "jobs/cli/commands.hpp"
#include "jobs/queue/attempt/publish.hpp"
#include "jobs/queue/repair.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/process/process.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

struct Finding {
  std::string kind;  // "bank", "record", "work", "input"
  store::Id id;      // of the job
  std::string fault;
  std::string repair;  // what was done, or why it failed; empty: not tried
  bool is_repaired = false;
};

/// Progress on a terminal.
class Progress {
 public:
  Progress(std::size_t total, bool quiet) : total_(total), is_shown_(!quiet && ::isatty(STDERR_FILENO) == 1) {}
  ~Progress() {
    if (is_shown_ && done_ > 0) fmt::print(stderr, "\r\033[K");
  }
  void advance() {
    if (is_shown_) fmt::print(stderr, "\r\033[Kverifying {} of {}", ++done_, total_);
  }

 private:
  std::size_t total_, done_ = 0;
  bool is_shown_;
};

bool is_worked_on(const store::Store& store, const store::Id& id) { return process::Lock::is_held(store.work_folder(id) / "lock"); }

void check_job(Shared& shared, const store::Id& id, std::map<std::string, std::optional<std::string>>& inputs,
               std::vector<Finding>& findings) {
  const store::Store& store = shared.store();
  if (store.has_bank_folder(id)) {
    if (const auto fault = store.find_bank_fault(id, store::Look::content))
      findings.push_back({"bank", id, *fault, "", false});
    else if (const auto record = attempt::find_record_fault(store, id))
      findings.push_back({"record", id, *record, "", false});
  }
  if (!store.has_bank_folder(id) && !store.has_work(id)) findings.push_back({"bank", id, "its bank is missing", "", false});
  if (store.has_work(id) && !is_worked_on(store, id)) {
    if (const auto fault = store::find_job_fault(store, id)) findings.push_back({"work", id, *fault, "", false});
  }
  const auto request = queue::find_request(store, shared.registry(), id);
  for (const store::Input& input : request ? store::list_inputs(*request) : std::vector<store::Input>()) {
    const auto [entry, is_new] = inputs.try_emplace(input.sha256 + "." + input.format);
    if (is_new) entry->second = store::find_input_fault(store, input);
    // A valid bank does not need its input, which gc may have removed.
    const bool is_gone = entry->second && entry->second->ends_with("is missing");
    if (entry->second && is_new && !(is_gone && store.has_bank(id))) findings.push_back({"input", id, *entry->second, "", false});
  }
}

/// Requeues a job, or writes the fault to its row.
void repair(Shared& shared, Finding& finding) {
  const auto refusal = queue::restore(shared.store(), shared.registry(), finding.id);
  shared.registry().update(finding.id, [&](registry::Job& row) {
    if (row.state == registry::JobState::running || row.state == registry::JobState::cancelled) return false;
    row.state = refusal ? registry::JobState::failed : registry::JobState::queued;
    row.reason = refusal ? finding.fault + "; " + *refusal : "";
    row.failures = 0;
    return true;
  });
  finding.is_repaired = !refusal;
  finding.repair = refusal ? *refusal : "requeued; carillon run computes it";
}

/// Rebuilds records from the bank if possible, else requeues the job.
void repair_record(Shared& shared, Finding& finding) {
  const auto request = queue::find_request(shared.store(), shared.registry(), finding.id);
  if (!request || !attempt::repair_records(shared.store(), *request)) return repair(shared, finding);
  finding.is_repaired = true;
  finding.repair = "rebuilt from the bank and the submission";
}

/// Copies an input again; does not change the state of the job.
void repair_input(Shared& shared, Finding& finding) {
  const auto request = queue::find_request(shared.store(), shared.registry(), finding.id);
  finding.is_repaired = request && store::restore_input(shared.store(), *request);
  finding.repair = finding.is_repaired ? "copied again from its original path"
                                       : "the original file has been removed or changed; submit a job with that file again";
}

}  // namespace

int run_verify(Shared& shared, const VerifyOptions& options) {
  shared.only_reads = !options.repairs;
  shared.settle();
  const store::Store& store = shared.store();
  std::set<store::Id> ids;
  for (const registry::Job& job : find_jobs(shared, options.words)) ids.insert(job.id);
  if (options.words.empty()) {
    for (const store::Id& id : store.list_banks()) ids.insert(id);
    for (const store::Id& id : store.list_work()) ids.insert(id);
    for (const registry::Job& job : shared.registry().list({registry::JobState::done})) ids.insert(job.id);
    // Jobs that were done and whose folder is missing.
    for (const registry::Job& job : shared.registry().list({registry::JobState::failed})) {
      if (!store.has_work(job.id)) ids.insert(job.id);
    }
  }
  std::optional<store::Lock> lock;
  if (options.repairs) lock.emplace(store.lock_shared());  // gc waits
  std::vector<Finding> findings;
  std::map<std::string, std::optional<std::string>> inputs;
  {
    Progress progress(ids.size(), shared.json);
    for (const store::Id& id : ids) {
      check_job(shared, id, inputs, findings);
      progress.advance();
    }
  }
  bool is_whole = true;
  base::Json root;
  root.set("store", to_json(store.root().string())).set("checked", ids.size()).set("damaged", base::Json::array());
  for (Finding& finding : findings) {
    if (options.repairs) {
      finding.kind == "input"    ? repair_input(shared, finding)
      : finding.kind == "record" ? repair_record(shared, finding)
                                 : repair(shared, finding);
    }
    is_whole = is_whole && finding.is_repaired;
    base::Json entry;
    entry.set("kind", finding.kind).set("id", finding.id.text()).set("fault", to_json(finding.fault)).set("repaired", finding.is_repaired);
    entry.set("repair", finding.repair.empty() ? base::Json() : to_json(finding.repair));
    root["damaged"].append(entry);
    if (shared.json) continue;
    fmt::print("{}  {:<6}  {}\n", finding.id.short_text(), finding.kind, show_message(finding.fault));
    if (!finding.repair.empty()) fmt::print("                      {}\n", show_message(finding.repair));
  }
  if (shared.json)
    print_json(root);
  else
    fmt::print("{} job{} verified, {} fault{}{}\n", ids.size(), ids.size() == 1 ? "" : "s", findings.size(),
               findings.size() == 1 ? "" : "s", findings.empty() || options.repairs ? "" : "; carillon verify --repair repairs them");
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  return is_whole ? 0 : kExitSolve;
}

}  // namespace carillon::cli
