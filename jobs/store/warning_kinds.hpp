// Warnings of many jobs, grouped by kind.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace carillon::store {

/// Groups warnings; one kind: equal but for numbers and file names.
class WarningKinds {
 public:
  /// False: a kind added before.
  bool add(const std::string& job, const std::string& text);
  bool is_empty() const { return kinds_.empty(); }
  /// A line for each kind, the most frequent one first: "in 198 jobs, as in bar.json: TEXT"; "in bar.json: TEXT" for a single job.
  std::vector<std::string> list() const;

 private:
  struct Kind {
    std::string key, text, job;  // text and job of its first warning
    std::size_t jobs = 0;
    std::string last_job;
  };
  std::vector<Kind> kinds_;
};

}  // namespace carillon::store
