#include "jobs/store/bank_sum.hpp"

#include <fmt/core.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <vector>

#include "jobs/store/files.hpp"
#include "jobs/store/order.hpp"
#include "jobs/store/store.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kHeadBytes = 4096;
constexpr std::size_t kMaxSumBytes = 4000;
constexpr const char* kSumWord = "carillon-bank-sum-1";

std::vector<const char*> list_records() {
  std::vector<const char*> names{kJobFile, kRequestFile, kOutcomeFile};
  for (const Output& output : kOutputs) names.push_back(output.file);
  return names;
}

std::string read_head(const fs::path& file, std::size_t max) {
  std::string head(max, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(head.data(), static_cast<std::streamsize>(max));
  head.resize(static_cast<std::size_t>(stream.gcount()));
  return head;
}

}  // namespace

bool is_record(const std::string& name) {
  const std::vector<const char*> records = list_records();
  return std::find(records.begin(), records.end(), name) != records.end();
}

const char* find_main_file(const fs::path& folder) {
  std::error_code error;
  return !fs::exists(folder / kBankFile, error) && fs::exists(folder / kRecordFile, error) ? kRecordFile : kBankFile;
}

std::string hash_head(const fs::path& file) { return hash_text(read_head(file, kHeadBytes)).text(); }

long long find_written_ns(const fs::path& file) {
  struct stat info {};
  return ::stat(file.c_str(), &info) == 0 ? info.st_mtim.tv_sec * 1'000'000'000LL + info.st_mtim.tv_nsec : 0;
}

std::string hash_record(const fs::path& file) {
  try {
    return hash_file(file, "record").text();
  } catch (const InputError&) {
    return "";
  }
}

BankSum calc_sum(const fs::path& folder, const Id& id) {
  const fs::path main = folder / find_main_file(folder);
  std::error_code error;
  const auto bytes = static_cast<long long>(fs::file_size(main, error));
  if (error) throw_errno(main, "read", error.value());
  return {id.text(), hash_file(main, "bank").text(), hash_head(main), bytes, find_written_ns(main), {}};
}

std::optional<BankSum> read_sum(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_regular_file(folder / kSumFile, error)) return std::nullopt;
  std::istringstream stream(read_head(folder / kSumFile, kMaxSumBytes));
  std::string word;
  BankSum sum;
  if (!(stream >> word >> sum.id >> sum.sha256 >> sum.head >> sum.bytes >> sum.written_ns) || word != kSumWord || !parse_id(sum.id))
    return BankSum{};
  for (std::string name, sha256; stream >> name >> sha256;) sum.records[name] = sha256;
  return sum;
}

void write_sum(const fs::path& folder, const BankSum& sum) {
  std::string text = fmt::format("{} {} {} {} {} {}\n", kSumWord, sum.id, sum.sha256, sum.head, sum.bytes, sum.written_ns);
  for (const char* name : list_records()) {
    if (const std::string sha256 = hash_record(folder / name); !sha256.empty()) text += fmt::format("{} {}\n", name, sha256);
  }
  base::write_file(folder / kSumFile, text);
  seal_file(folder / kSumFile);
}

}  // namespace carillon::store
