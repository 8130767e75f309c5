// Faults of banks and of the records next to them, against bank.sum and against their own content.
#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>

#include <cerrno>
#include <map>
#include <string_view>

#include "jobs/store/bank_sum.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/order.hpp"
#include "jobs/store/seal.hpp"
#include "jobs/store/store.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/base/error.hpp"

namespace carillon::store {
namespace {

/// The first file of a simulation that is missing or, but for a quick look, has other bytes than those published.
std::optional<std::string> find_file_fault(const OpenFolder& folder, const BankSum& sum, Look look) {
  for (const Output& output : kOutputs) {
    const auto known = sum.records.find(output.file);
    if (known == sum.records.end()) continue;
    const auto info = folder.look_at(output.file);
    if (!info) return fmt::format("its {} is missing", output.file);
    if (!S_ISREG(info->st_mode)) return fmt::format("its {} is no regular file", output.file);
    if (look != Look::quick && hash_record(folder, output.file) != known->second)
      return fmt::format("its {} is damaged: its bytes are no longer those that were computed", output.file);
  }
  return std::nullopt;
}

/// First fault of a bank: content, job (`id`), sum over all bytes. Gaps in the records of a summed bank are allowed.
std::optional<std::string> find_content_fault(const OpenFolder& folder, const Id& id, bool has_sum) {
  try {
    const bool is_simulation = std::string_view(find_main_file(folder)) == kRecordFile;
    const std::string provenance = is_simulation ? "" : bank::read_bank(folder.path() / kBankFile).provenance;
    std::optional<Request> request;
    try {
      request = read_request(folder.path());
    } catch (const InputError&) {
    }
    if (request && (request->id != id.text() || calc_id(*request) != id)) request.reset();
    if (!request) return has_sum ? std::nullopt : std::optional("its request.json is not what was submitted");
    if (is_simulation) return find_output_fault(folder.path(), *request);
    return provenance.empty() ? std::nullopt : find_origin_fault(provenance, *request);
  } catch (const InputError& error) {
    return show_names(folder, error.what());
  }
}

}  // namespace

std::optional<std::string> Store::find_bank_fault(const Id& id, Look look) const {
  try {
    const auto shard = find_shard("banks", id);
    const auto folder = shard ? shard->find(id.text()) : std::nullopt;
    if (!folder) return "there is no bank";
    const char* main = find_main_file(*folder);
    const File file{open_regular(*folder, main)};
    if (file.value < 0 && (errno == EACCES || errno == EPERM)) return std::nullopt;  // unreadable, not damaged
    if (file.value < 0 && errno == ENOENT) return "its bank is missing";
    struct stat info {};
    if (file.value < 0 || ::fstat(file.value, &info) != 0) return "its bank is no regular file";
    if (info.st_size == 0) return "its bank is empty";
    const auto sum = read_sum(*folder);
    if (!sum) return look == Look::quick ? std::nullopt : find_content_fault(*folder, id, false);  // of an earlier version
    if (sum->id.empty()) return "its bank.sum is damaged";
    if (sum->id != id.text()) return "its folder is that of another bank";
    if (info.st_size < sum->bytes) return fmt::format("its bank is cut: {} bytes of {}", info.st_size, sum->bytes);
    if (info.st_size != sum->bytes) return fmt::format("its bank has {} bytes instead of {}", info.st_size, sum->bytes);
    if (hash_head(file.value) != sum->head) return "its bank is another one than was computed, or its seal is damaged";
    if (main == std::string_view(kRecordFile))
      if (auto fault = find_file_fault(*folder, *sum, look)) return fault;
    if (look == Look::quick && find_written_ns(info) == sum->written_ns) return std::nullopt;
    if (hash_file(fmt::format("/proc/self/fd/{}", file.value), "bank").text() != sum->sha256) {
      // Later looks read the whole file, as its time differs.
      const File own{::openat(folder->get(), main, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC)};
      if (own.value >= 0) (void)!::futimens(own.value, nullptr);
      return "its bank is damaged: its bytes are no longer those that were computed";
    }
    return look == Look::content ? find_content_fault(*folder, id, true) : std::nullopt;
  } catch (const SystemError& error) {
    return error.what();
  } catch (const InputError& error) {
    return error.what();
  }
}

std::optional<std::string> Store::find_record_change(const Id& id) const {
  const OpenFolder folder = open_bank(id);
  const auto sum = read_sum(folder);
  for (const auto& [name, sha256] : sum ? sum->records : std::map<std::string, std::string>()) {
    if (!is_record(name)) continue;
    const auto info = folder.look_at(name);
    if (!info) return fmt::format("its {} is missing", name);
    if (!S_ISREG(info->st_mode)) return fmt::format("its {} is no regular file", name);
    if (hash_record(folder, name.c_str()) != sha256)
      return fmt::format("its {} is {}", name, info->st_size == 0 ? "empty" : "not what was published");
  }
  return std::nullopt;
}

}  // namespace carillon::store
