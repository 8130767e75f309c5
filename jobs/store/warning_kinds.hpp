// Warnings of many jobs as few lines.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace carillon::store {

/// Warnings that differ in numbers and names of files alone are of one kind.
class WarningKinds {
 public:
  /// False: one of its kind was added before.
  bool add(const std::string& job, const std::string& text);
  bool is_empty() const { return kinds_.empty(); }
  /// A line for each kind, the most frequent one first: "in 198 jobs, as in bar.json: TEXT"; "in bar.json: TEXT" where it is the only one.
  std::vector<std::string> list() const;

 private:
  struct Kind {
    std::string key, text, job;  // text and job of the first
    std::size_t jobs = 0;
    std::string last_job;
  };
  std::vector<Kind> kinds_;
};

}  // namespace carillon::store
