// The record of a run, which is untrusted input.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "runtime/base/json.hpp"

namespace carillon::report {

/// JSON of a file or a bank; null when it is none.
base::Json parse_json(const std::string& text);

/// A member of an object; null when it is not there, or `in` is no object.
const base::Json& find(const base::Json& in, const char* key);
std::optional<double> find_number(const base::Json& in, const char* key);       // finite
std::optional<double> find_amount(const base::Json& in, const char* key);       // finite, not negative
std::optional<std::int64_t> find_count(const base::Json& in, const char* key);  // whole, not negative
std::optional<std::string> find_text(const base::Json& in, const char* key);
/// The texts of a list, each once, at most fifty; none when it is no list.
std::vector<std::string> find_texts(const base::Json& list);

/// The resolved job of a bank and its member "run", each an object or null.
struct Record {
  base::Json job, run;
  std::vector<std::string> remarks;  // why the record is not, or not only, that of the file
};

/// From the file, and what is missing there from the text of the bank. Never throws for what the file is or holds.
Record read_record(const std::filesystem::path& resolved_job, const std::string& provenance);

}  // namespace carillon::report
