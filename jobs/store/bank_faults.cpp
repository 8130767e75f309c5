// Faults of banks and of the records next to them, against bank.sum and against their own content.
#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <map>
#include <string_view>

#include "jobs/store/bank_sum.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/order.hpp"
#include "jobs/store/store.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/base/error.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

/// The first file of a simulation that is missing or (unless the look is quick) differs from the published one.
std::optional<std::string> find_file_fault(const fs::path& folder, const BankSum& sum, Look look) {
  for (const Output& output : kOutputs) {
    const auto known = sum.records.find(output.file);
    if (known == sum.records.end()) continue;
    std::error_code error;
    if (!fs::is_regular_file(folder / output.file, error)) return fmt::format("its {} is missing", output.file);
    if (look != Look::quick && hash_record(folder / output.file) != known->second)
      return fmt::format("its {} is damaged: its bytes have changed since publication", output.file);
  }
  return std::nullopt;
}

/// Reads the bank and compares its job with `id`. With a bank.sum, missing records are no fault.
std::optional<std::string> find_content_fault(const fs::path& folder, const Id& id, bool has_sum) {
  try {
    const bool is_simulation = std::string_view(find_main_file(folder)) == kRecordFile;
    const std::string provenance = is_simulation ? "" : bank::read_bank(folder / kBankFile).provenance;
    std::optional<Request> request;
    try {
      request = read_request(folder);
    } catch (const InputError&) {
    }
    if (request && (request->id != id.text() || calc_id(*request) != id)) request.reset();
    if (!request) return has_sum ? std::nullopt : std::optional("its request.json is not what was submitted");
    if (is_simulation) return find_output_fault(folder, *request);
    return provenance.empty() ? std::nullopt : find_origin_fault(provenance, *request);
  } catch (const InputError& error) {
    return error.what();
  }
}

}  // namespace

std::optional<std::string> Store::find_bank_fault(const Id& id, Look look) const {
  const fs::path folder = bank_folder(id);
  if (!has_bank_folder(id)) return "there is no bank";
  const std::string_view main = find_main_file(folder);
  const fs::path file = folder / main;
  struct stat info {};
  if (::stat(file.c_str(), &info) != 0) return errno == EACCES ? std::nullopt : std::optional("its bank is missing");
  if (!S_ISREG(info.st_mode)) return "its bank is not a regular file";
  if (::access(file.c_str(), R_OK) != 0) return std::nullopt;  // unreadable for this user, not damaged
  if (info.st_size == 0) return "its bank is empty";
  try {
    const auto sum = read_sum(folder);
    if (!sum) return look == Look::quick ? std::nullopt : find_content_fault(folder, id, false);
    if (sum->id.empty()) return "its bank.sum is damaged";
    if (sum->id != id.text()) return "its folder holds another bank";
    if (info.st_size < sum->bytes) return fmt::format("its bank is truncated: {} bytes of {}", info.st_size, sum->bytes);
    if (info.st_size != sum->bytes) return fmt::format("its bank has {} bytes instead of {}", info.st_size, sum->bytes);
    if (hash_head(file) != sum->head) return "its bank is not the published one, or its header is damaged";
    if (main == kRecordFile)
      if (auto fault = find_file_fault(folder, *sum, look)) return fault;
    if (look == Look::quick && find_written_ns(file) == sum->written_ns) return std::nullopt;
    if (hash_file(file, "bank").text() != sum->sha256) {
      (void)!::utimensat(AT_FDCWD, file.c_str(), nullptr, 0);  // a new time: every later look reads the whole file
      return "its bank is damaged: its bytes have changed since publication";
    }
    return look == Look::content ? find_content_fault(folder, id, true) : std::nullopt;
  } catch (const SystemError& error) {
    return error.what();
  } catch (const InputError& error) {
    return error.what();
  }
}

std::optional<std::string> Store::find_record_change(const Id& id) const {
  const fs::path folder = bank_folder(id);
  const auto sum = read_sum(folder);
  for (const auto& [name, sha256] : sum ? sum->records : std::map<std::string, std::string>()) {
    if (!is_record(name)) continue;
    std::error_code error;
    if (!fs::is_regular_file(folder / name, error)) return fmt::format("its {} is missing", name);
    if (hash_record(folder / name) != sha256)
      return fmt::format("its {} is {}", name, fs::file_size(folder / name, error) == 0 ? "empty" : "not the published one");
  }
  return std::nullopt;
}

}  // namespace carillon::store
