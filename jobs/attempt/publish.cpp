// Method:     Hard links (copies, where there are none) into a new folder, which gets its name in one rename. Killed before: the work is as
// it
//             was, and the bank in it is published by the next attempt without a solve. Killed after: done, and the work is only left over.
// Source:     rename(2), link(2), fallocate(2).
// Deviations: none.
#include "jobs/attempt/publish.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <system_error>

#include "jobs/attempt/attempt.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::attempt {
namespace {

namespace fs = std::filesystem;

constexpr const char* kReserveFile = "reserve";
constexpr off_t kReserveBytes = 64 << 10;
constexpr double kFullBytes = 1 << 20;

/// A missing file is passed over.
void link_or_copy(const fs::path& from, const fs::path& to) {
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(from, error))) return;
  fs::create_hard_link(from, to, error);
  if (error) fs::copy_file(from, to, error);
  if (error) throw SystemError(fmt::format("{}: cannot copy this to {}: {}", from.string(), to.string(), error.message()));
}

/// A page about the bank. A bank is no worse without.
void write_report(const fs::path& folder, report::Options& wanted) {
  try {
    if (const std::optional<store::Request> request = store::read_request(folder)) wanted.title = store::find_input_name(*request);
    report::write_report(folder / store::kBankFile, folder / store::kJobFile, folder, wanted);
  } catch (const std::exception& error) {
    fmt::print(stderr, "carillon attempt: no report was made: {}\n", error.what());
  }
}

}  // namespace

std::optional<std::string> find_bank_fault(const fs::path& work, bool& has_bank) {
  const fs::path file = work / store::kBankFile;
  std::error_code error;
  has_bank = fs::exists(fs::symlink_status(file, error));
  if (!has_bank) return "there is no bank";
  try {
    (void)bank::read_bank(file);
    return std::nullopt;
  } catch (const InputError& fault) {
    return fault.what();
  }
}

void publish(const store::Store& store, const store::Id& id, const outcome::Outcome& outcome, report::Options wanted) {
  const fs::path work = store.work_folder(id);
  const fs::path folder = store.make_temporary();
  try {
    link_or_copy(work / store::kBankFile, folder / store::kBankFile);
    // The solver writes the job with every value that it used beside the bank; it runs again as a job.
    const fs::path resolved = work / (std::string(store::kBankFile) + ".resolved.json");
    std::error_code error;
    link_or_copy(fs::exists(resolved, error) ? resolved : work / store::kJobFile, folder / store::kJobFile);
    link_or_copy(work / "request.json", folder / "request.json");
    link_or_copy(work / store::kLogFile, folder / store::kLogFile);
    write_report(folder, wanted);
    outcome::write_outcome(folder, outcome);
    store.publish(id, folder);
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
    throw;
  }
}

void make_reserve(const fs::path& work) {
  const int file = ::open((work / kReserveFile).c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) return;
  (void)::posix_fallocate(file, 0, kReserveBytes);
  ::close(file);
}

void remove_reserve(const fs::path& work) { ::unlink((work / kReserveFile).c_str()); }

bool is_disk_full(const fs::path& folder) {
  struct statvfs info {};
  if (::statvfs(folder.c_str(), &info) != 0) return false;
  return static_cast<double>(info.f_bavail) * static_cast<double>(info.f_frsize) < kFullBytes;
}

}  // namespace carillon::attempt
