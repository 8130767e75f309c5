// Programs of this installation, started one after the other, whose refusals are errors of the caller.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "runtime/base/temporary.hpp"

namespace carillon::process {

/// While it lives, the signals that ask a program to end (SIGINT, SIGTERM, SIGHUP) are noted. When it goes, a signal that came does what it
/// does by default: this process ends by it. One at a time.
class SignalWatch {
 public:
  SignalWatch();
  ~SignalWatch();
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  /// 0: none came.
  static int get_signal();
};

/// Runs programs in a temporary folder, which the destructor removes; an error of a program is thrown with its message.
class Programs {
 public:
  /// is_quiet: their progress is not shown. Throws SystemError where no folder can be made.
  explicit Programs(bool is_quiet);

  /// The standard output of a program of this installation. Files among the words are absolute. `has_result`: it takes --result. `shows`:
  /// its progress goes to standard error. It is killed once SignalWatch has a signal, and gone with all that it started when this returns.
  /// Throws InputError, SolveError, SystemError.
  std::string run(const std::string& program, std::vector<std::string> words, bool has_result, bool shows = false);
  /// Notes and warnings of the last program and of its children, one sentence each.
  const std::vector<std::string>& get_notes() const { return notes_; }

 private:
  base::TemporaryFolder folder_;
  std::vector<std::string> notes_;
  bool is_quiet_;
};

}  // namespace carillon::process
