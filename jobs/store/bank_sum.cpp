#include "jobs/store/bank_sum.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <sstream>
#include <vector>

#include "jobs/store/files.hpp"
#include "jobs/store/order.hpp"
#include "jobs/store/seal.hpp"
#include "jobs/store/store.hpp"
#include "runtime/base/file.hpp"

namespace carillon::store {
namespace {

constexpr std::size_t kSealBytes = 4096;  // the seal of a bank
constexpr std::size_t kMaxSumBytes = 4000;
constexpr const char* kSumWord = "carillon-bank-sum-1";

std::vector<const char*> list_records() {
  std::vector<const char*> names{kJobFile, kRequestFile, kOutcomeFile};
  for (const Output& output : kOutputs) names.push_back(output.file);
  return names;
}

std::string read_head(int file, std::size_t max) {
  std::string head(max, '\0');
  const ssize_t got = ::pread(file, head.data(), head.size(), 0);
  head.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  return head;
}

}  // namespace

bool is_record(const std::string& name) {
  const std::vector<const char*> records = list_records();
  return std::find(records.begin(), records.end(), name) != records.end();
}

const char* find_main_file(const OpenFolder& folder) {
  return !folder.look_at(kBankFile) && folder.look_at(kRecordFile) ? kRecordFile : kBankFile;
}

std::string hash_head(int file) { return hash_text(read_head(file, kSealBytes)).text(); }

long long find_written_ns(const struct stat& info) { return info.st_mtim.tv_sec * 1'000'000'000LL + info.st_mtim.tv_nsec; }

std::string hash_record(const OpenFolder& folder, const char* name) {
  const File file{open_regular(folder, name)};
  return file.value < 0 ? "" : hash_file(fmt::format("/proc/self/fd/{}", file.value), "record").text();
}

BankSum calc_sum(const OpenFolder& folder, const Id& id) {
  const char* main = find_main_file(folder);
  const File bank{open_regular(folder, main)};
  struct stat info {};
  if (bank.value < 0 || ::fstat(bank.value, &info) != 0) throw_errno(folder.name() / main, "read", errno);
  return {id.text(),
          hash_file(folder.path() / main, "bank").text(),
          hash_head(bank.value),
          static_cast<long long>(info.st_size),
          find_written_ns(info),
          {}};
}

std::optional<BankSum> read_sum(const OpenFolder& folder) {
  const File file{open_regular(folder, kSumFile)};
  if (file.value < 0) return std::nullopt;
  std::istringstream stream(read_head(file.value, kMaxSumBytes));
  std::string word;
  BankSum sum;
  if (!(stream >> word >> sum.id >> sum.sha256 >> sum.head >> sum.bytes >> sum.written_ns) || word != kSumWord || !parse_id(sum.id))
    return BankSum{};  // damaged itself: fits nothing
  for (std::string name, sha256; stream >> name >> sha256;) sum.records[name] = sha256;
  return sum;
}

void write_sum(const OpenFolder& folder, const BankSum& sum) {
  std::string text = fmt::format("{} {} {} {} {} {}\n", kSumWord, sum.id, sum.sha256, sum.head, sum.bytes, sum.written_ns);
  for (const char* name : list_records()) {
    if (const std::string sha256 = hash_record(folder, name); !sha256.empty()) text += fmt::format("{} {}\n", name, sha256);
  }
  base::write_file(folder.path() / kSumFile, text);
  seal_file(folder, kSumFile);
}

}  // namespace carillon::store
