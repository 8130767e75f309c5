// The programs of this installation, started one after the other.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace carillon::process {

/// Runs programs in one folder; what one of them refuses is thrown with its own words.
class Programs {
 public:
  /// folder: where they work, and where files of results go. is_quiet: their progress is not shown.
  Programs(std::filesystem::path folder, bool is_quiet) : folder_(std::move(folder)), is_quiet_(is_quiet) {}

  /// The standard output of a program of this installation. `has_result`: it takes --result. `shows`: its progress goes to standard error.
  /// Throws InputError, SolveError, SystemError.
  std::string run(const std::string& program, std::vector<std::string> words, bool has_result, bool shows = false) const;

 private:
  std::filesystem::path folder_;
  bool is_quiet_;
};

}  // namespace carillon::process
