// Warnings of many jobs, grouped by kind.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace carillon::store {

/// Groups warnings that differ only in numbers and file names.
class WarningKinds {
 public:
  /// False: a known kind.
  bool add(const std::string& job, const std::string& text);
  bool is_empty() const { return kinds_.empty(); }
  /// One line per kind, most frequent first: "in 198 jobs, as in bar.json: TEXT", or "in bar.json: TEXT".
  std::vector<std::string> list() const;

 private:
  struct Kind {
    std::string key, text, job;  // text and job of the first warning
    std::size_t jobs = 0;
    std::string last_job;
  };
  std::vector<Kind> kinds_;
};

}  // namespace carillon::store
