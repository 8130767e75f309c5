// The record of a run: untrusted input.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "runtime/base/json.hpp"

namespace carillon::report {

/// Null for invalid JSON.
base::Json parse_json(const std::string& text);

/// A member of an object; null if missing, or if `in` is not an object.
const base::Json& find(const base::Json& in, const char* key);
std::optional<std::string> find_text(const base::Json& in, const char* key);

/// The resolved job of a bank and its member "run", each an object or null.
struct Record {
  base::Json job, run;
  std::vector<std::string> remarks;  // about missing or damaged parts
};

/// From the file, else from the provenance of the bank. Never throws for the content of the file.
Record read_record(const std::filesystem::path& resolved_job, const std::string& provenance);

}  // namespace carillon::report
