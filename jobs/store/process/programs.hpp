// Runs programs of this installation; their errors become exceptions.
#pragma once

#include <string>
#include <vector>

#include "runtime/base/temporary.hpp"

namespace carillon::process {

/// Records SIGINT, SIGTERM and SIGHUP during its lifetime. The destructor raises a recorded signal again with its default action. One
/// instance at a time.
class SignalWatch {
 public:
  SignalWatch();
  ~SignalWatch();
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  /// 0: none.
  static int get_signal();
};

/// Runs programs in a temporary folder, which the destructor removes.
class Programs {
 public:
  /// `is_quiet`: their progress is not shown. SystemError if the folder cannot be created.
  explicit Programs(bool is_quiet);

  /// Returns the standard output. Paths in `words` must be absolute. `has_result`: the program accepts --result. `shows`: its progress goes
  /// to standard error. Ended with all its children when SignalWatch has a signal. InputError, SolveError, SystemError with the message of
  /// the program.
  std::string run(const std::string& program, std::vector<std::string> words, bool has_result, bool shows = false);
  /// Notes and warnings of the last program and its children, one sentence each.
  const std::vector<std::string>& get_notes() const { return notes_; }

 private:
  base::TemporaryFolder folder_;
  std::vector<std::string> notes_;
  bool is_quiet_;
};

}  // namespace carillon::process
