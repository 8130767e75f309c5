// Method:     Hard links (copies, where there are none) into a new folder, which gets its name in one rename. Killed before: the work is
//             as it was, and the next attempt publishes its bank without a solve. Killed after: done, and the work is only left over.
// Source:     rename(2), link(2), fallocate(2).
// Deviations: none.
#include "jobs/queue/attempt/publish.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/open_folder.hpp"
#include "jobs/store/order.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"

namespace carillon::attempt {
namespace {

namespace fs = std::filesystem;

constexpr const char* kReserveFile = "reserve";
constexpr off_t kReserveBytes = 64 << 10;

/// Copies a regular file; follows no link, waits for no pipe. False when there is none.
bool take_copy(const fs::path& from, const fs::path& to) {
  const base::Descriptor file(::open(from.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat info {};
  if (file.get() < 0 || ::fstat(file.get(), &info) != 0 || !S_ISREG(info.st_mode)) return false;
  base::WholeFile whole(to);
  std::string piece(1 << 20, '\0');
  for (;;) {
    const ssize_t got = ::read(file.get(), piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw_system_error(errno, fmt::format("{}: cannot read this: {}", from.string(), std::strerror(errno)));
    if (got == 0) break;
    whole.append(std::string_view(piece.data(), static_cast<std::size_t>(got)));
  }
  whole.commit();
  return true;
}

/// The same by another name for the same file, where that can be.
void link_or_copy(const fs::path& from, const fs::path& to) {
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(from, error))) return;
  fs::create_hard_link(from, to, error);
  if (!error && fs::is_regular_file(fs::symlink_status(to, error))) return;
  fs::remove(to, error);
  take_copy(from, to);
}

/// A page about the bank. A bank is no worse without. Programs that draw need a path that they can open too.
void write_report(const fs::path& folder, report::Options& wanted) {
  try {
    if (const std::optional<store::Request> request = store::read_request(folder)) wanted.title = store::find_input_name(*request);
    report::write_report(folder / store::kBankFile, folder / store::kJobFile, folder, wanted);
  } catch (const std::exception& error) {
    fmt::print(stderr, "carillon attempt: no report was made: {}\n", error.what());
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
  if (!fs::is_regular_file(status)) return "what lies in place of the bank is no regular file";
  try {
    return store::find_origin_fault(bank::read_bank(file).provenance, request);
  } catch (const InputError& fault) {
    return fault.what();
  }
}

std::optional<std::string> find_record_fault(const store::Store& store, const store::Id& id) {
  try {
    if (std::optional<std::string> change = store.find_record_change(id)) return change;
    const store::OpenFolder folder = store.open_bank(id);
    if (std::optional<std::string> fault = store::find_resolved_fault(folder.path(), id)) return fault;
    if (!folder.look_at(store::kOutcomeFile)) return "its outcome.json is missing";
    const std::optional<outcome::Outcome> outcome = outcome::read_outcome(folder.path());
    if (!outcome) return "its outcome.json is empty, cut or damaged";
    if (outcome->cause != outcome::Cause::done) return "its outcome.json is that of another attempt";
    return std::nullopt;
  } catch (const SystemError& error) {
    return error.what();
  }
}

bool repair_records(const store::Store& store, const store::Request& request) {
  const store::Id id = store::calc_id(request);
  const store::OpenFolder folder = store.open_bank(id);
  const store::Temporary temporary = store.make_temporary();
  if (request.input_kind == store::InputKind::simulation) return false;  // it is carried out again
  std::string record;
  try {
    record = bank::read_bank(folder.path() / store::kBankFile).provenance;
  } catch (const InputError&) {
    return false;
  }
  if (store::find_origin_fault(record, request)) return false;
  base::write_file(temporary / store::kJobFile, record + "\n");
  store::write_request(temporary.path(), request);
  outcome::Outcome outcome;  // how the attempt went is lost with its record; that it was done is not
  outcome.cause = outcome::Cause::done;
  outcome.percent = 100.0;
  outcome::write_outcome(temporary.path(), outcome);
  store.replace_records(id, temporary);
  return true;
}

void publish(const store::Store& store, const store::Id& id, const fs::path& work, const outcome::Outcome& outcome,
             report::Options wanted) {
  const store::Temporary temporary = store.make_temporary();
  const fs::path folder = temporary.content().shared_path();
  try {
    const std::optional<store::Request> request = store::read_request(work);
    const bool is_simulation = request && request->input_kind == store::InputKind::simulation;
    std::vector<std::string> results{store::kBankFile};
    if (is_simulation) results = store::list_outputs(request->job);
    for (const std::string& name : results) link_or_copy(work / name, folder / name);
    // The solver writes the job with every value that it used next to the bank; it runs again as a job.
    if (!take_copy(work / (std::string(store::kBankFile) + ".resolved.json"), folder / store::kJobFile))
      take_copy(work / store::kJobFile, folder / store::kJobFile);
    take_copy(work / store::kRequestFile, folder / store::kRequestFile);
    take_copy(work / store::kLogFile, folder / store::kLogFile);
    if (!is_simulation) write_report(folder, wanted);
    outcome::write_outcome(folder, outcome);
    store.publish(id, temporary);
  } catch (const SystemError& error) {
    store::throw_with_names(temporary.content(), error);
  }
}

void clear_way(const fs::path& work, const std::string& name) {
  struct stat info {};
  const fs::path file = work / name;
  if (::lstat(file.c_str(), &info) != 0 || (S_ISREG(info.st_mode) && info.st_nlink == 1)) return;
  if (!S_ISDIR(info.st_mode)) {
    ::unlink(file.c_str());
  } else {
    store::OpenFolder::open(work).remove(name);
  }
}

void make_reserve(const fs::path& work) {
  remove_reserve(work);
  const int file = ::open((work / kReserveFile).c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) return;
  (void)::posix_fallocate(file, 0, kReserveBytes);
  ::close(file);
}

void remove_reserve(const fs::path& work) { ::unlink((work / kReserveFile).c_str()); }

}  // namespace carillon::attempt
