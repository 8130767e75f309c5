// bank.sum: size, time and hashes of a bank and of the records next to it, as they were published.
#pragma once

#include <sys/stat.h>

#include <map>
#include <optional>
#include <string>

#include "jobs/store/id.hpp"
#include "jobs/store/open_folder.hpp"

namespace carillon::store {

/// One line, then a line for each record, with its name and SHA-256.
struct BankSum {
  std::string id, sha256, head;  // head: SHA-256 of the first bytes
  long long bytes = 0, written_ns = 0;
  std::map<std::string, std::string> records;
};

/// A record of every job or a file of a simulation: one of those with a line in bank.sum.
bool is_record(const std::string& name);

/// The file that a folder of banks/ is there for: the bank, or the record of a simulation, which is written last.
const char* find_main_file(const OpenFolder& folder);

/// SHA-256 of the first bytes of a bank; they hold the hash of the rest.
std::string hash_head(int file);
/// Time of the last write.
long long find_written_ns(const struct stat& info);
/// SHA-256 of a regular file in a folder; empty when there is none that can be read.
std::string hash_record(const OpenFolder& folder, const char* name);

/// Of the bank in a folder, without its records. SystemError when it cannot be read.
BankSum calc_sum(const OpenFolder& folder, const Id& id);
/// None without a regular file of that name; with an empty id when it is damaged itself.
std::optional<BankSum> read_sum(const OpenFolder& folder);
/// With the records as they are in the folder, read-only. SystemError when the disk refuses.
void write_sum(const OpenFolder& folder, const BankSum& sum);

}  // namespace carillon::store
