// bank.sum: size, time and hashes of a published bank and of the records next to it.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "jobs/store/id.hpp"

namespace carillon::store {

/// One line, then a line for each record with its name and SHA-256.
struct BankSum {
  std::string id, sha256, head;  // head: SHA-256 of the first 4096 bytes
  long long bytes = 0, written_ns = 0;
  std::map<std::string, std::string> records;
};

/// True for the files with a line in bank.sum: the records of a job and the files of a simulation.
bool is_record(const std::string& name);

/// The main file of a folder of banks/: the bank, or the record of a simulation (which is written last).
const char* find_main_file(const std::filesystem::path& folder);

/// SHA-256 of the first 4096 bytes, which hold the hash of the rest of a bank.
std::string hash_head(const std::filesystem::path& file);
/// Time of the last write; 0 for a missing file.
long long find_written_ns(const std::filesystem::path& file);
/// SHA-256 of a regular file; empty if it cannot be read.
std::string hash_record(const std::filesystem::path& file);

/// The sum of the bank in a folder, without its records. SystemError if it cannot be read.
BankSum calc_sum(const std::filesystem::path& folder, const Id& id);
/// None without bank.sum; empty id if bank.sum is damaged.
std::optional<BankSum> read_sum(const std::filesystem::path& folder);
/// Writes bank.sum, read-only, with the records that are in the folder. SystemError when the disk refuses.
void write_sum(const std::filesystem::path& folder, const BankSum& sum);

}  // namespace carillon::store
