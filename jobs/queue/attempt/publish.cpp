// Method:     Hard links (else copies) into a new folder, published by one rename. Killed before the rename: the work is unchanged, and the
//             next attempt publishes its bank without a solve. Killed after it: the job is done, and gc removes the work.
// Source:     rename(2), link(2), fallocate(2).
#include "jobs/queue/attempt/publish.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <system_error>
#include <vector>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/order.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/base/file.hpp"

namespace carillon::attempt {
namespace {

namespace fs = std::filesystem;

constexpr const char* kReserveFile = "reserve";
constexpr off_t kReserveBytes = 64 << 10;

/// False if there is no such file.
bool take_copy(const fs::path& from, const fs::path& to) {
  std::error_code error;
  return fs::is_regular_file(from, error) && fs::copy_file(from, to);
}

void link_or_copy(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::create_hard_link(from, to, error);
  if (error) take_copy(from, to);
}

/// Writes the report; a failure is logged and does not fail the attempt.
void write_report(const fs::path& folder, report::Options& wanted) {
  try {
    if (const std::optional<store::Request> request = store::read_request(folder)) wanted.title = store::find_input_name(*request);
    report::write_report(folder / store::kBankFile, folder / store::kJobFile, folder, wanted);
  } catch (const std::exception& error) {
    fmt::print(stderr, "carillon attempt: no report was written: {}\n", error.what());
  }
}

}  // namespace

std::optional<std::string> find_bank_fault(const fs::path& work, const store::Request& request, bool& has_bank) {
  const bool is_simulation = request.input_kind == store::InputKind::simulation;
  const fs::path file = work / (is_simulation ? store::kRecordFile : store::kBankFile);
  std::error_code error;
  const fs::file_status status = fs::symlink_status(file, error);
  has_bank = fs::exists(status);
  if (!has_bank) return is_simulation ? "there is no record" : "there is no bank";
  if (is_simulation) return store::find_output_fault(work, request);
  if (!fs::is_regular_file(status)) return "the bank is not a regular file";
  try {
    return store::find_origin_fault(bank::read_bank(file).provenance, request);
  } catch (const InputError& fault) {
    return fault.what();
  }
}

std::optional<std::string> find_record_fault(const store::Store& store, const store::Id& id) {
  try {
    if (std::optional<std::string> change = store.find_record_change(id)) return change;
    const fs::path folder = store.bank_folder(id);
    if (std::optional<std::string> fault = store::find_resolved_fault(folder, id)) return fault;
    if (!fs::exists(folder / store::kOutcomeFile)) return "its outcome.json is missing";
    const std::optional<outcome::Outcome> outcome = outcome::read_outcome(folder);
    if (!outcome) return "its outcome.json is empty, truncated or damaged";
    if (outcome->cause != outcome::Cause::done) return "its outcome.json belongs to another attempt";
    return std::nullopt;
  } catch (const SystemError& error) {
    return error.what();
  }
}

bool repair_records(const store::Store& store, const store::Request& request) {
  const store::Id id = store::calc_id(request);
  if (request.input_kind == store::InputKind::simulation) return false;  // the simulation is repeated
  const store::Temporary temporary = store.make_temporary();
  std::string record;
  try {
    record = bank::read_bank(store.bank_folder(id) / store::kBankFile).provenance;
  } catch (const InputError&) {
    return false;
  }
  if (store::find_origin_fault(record, request)) return false;
  base::write_file(temporary / store::kJobFile, record + "\n");
  store::write_request(temporary.path(), request);
  outcome::Outcome outcome;  // the details of the attempt are lost
  outcome.cause = outcome::Cause::done;
  outcome.percent = 100.0;
  outcome::write_outcome(temporary.path(), outcome);
  store.replace_records(id, temporary);
  return true;
}

void publish(const store::Store& store, const store::Id& id, const fs::path& work, const outcome::Outcome& outcome,
             report::Options wanted) {
  store::Temporary temporary = store.make_temporary();
  const fs::path& folder = temporary.path();
  const std::optional<store::Request> request = store::read_request(work);
  const bool is_simulation = request && request->input_kind == store::InputKind::simulation;
  std::vector<std::string> results{store::kBankFile};
  if (is_simulation) results = store::list_outputs(request->job);
  for (const std::string& name : results) link_or_copy(work / name, folder / name);
  // The resolved job, written by the solver with the value of every key, can be run again as a job.
  if (!take_copy(work / (std::string(store::kBankFile) + ".resolved.json"), folder / store::kJobFile))
    take_copy(work / store::kJobFile, folder / store::kJobFile);
  take_copy(work / store::kRequestFile, folder / store::kRequestFile);
  take_copy(work / store::kLogFile, folder / store::kLogFile);
  if (!is_simulation) write_report(folder, wanted);
  outcome::write_outcome(folder, outcome);
  store.publish(id, temporary);
}

void make_reserve(const fs::path& work) {
  remove_reserve(work);
  const int file = ::open((work / kReserveFile).c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0) return;
  (void)::posix_fallocate(file, 0, kReserveBytes);
  ::close(file);
}

void remove_reserve(const fs::path& work) { ::unlink((work / kReserveFile).c_str()); }

}  // namespace carillon::attempt
