// Temporary folders, removed with their process.
//
// The process locks a file in each folder. Folders of killed processes have an unlocked file; the next process that makes a folder of the
// same prefix there removes them. SIGINT, SIGTERM and SIGHUP, unless ignored or handled elsewhere, end the children and remove the folders
// before the process ends.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>

#include "runtime/base/signal_pause.hpp"

namespace carillon::base {

/// A step that no signal interrupts, may be nested: signals of this thread are blocked, and end_children_and_temporaries() of
/// another thread waits for the end of the step, at most 3 s. In a process that is ending the constructor does not return.
class WholeStep {
 public:
  WholeStep();
  ~WholeStep();
  WholeStep(const WholeStep&) = delete;
  WholeStep& operator=(const WholeStep&) = delete;

 private:
  SignalPause pause_;
};

/// Creates PARENT/BEGINxxxxxx. Throws SystemError.
std::filesystem::path make_temporary_folder(const std::filesystem::path& parent, const std::string& begin);
/// Removes the folder and its contents.
void remove_temporary_folder(const std::filesystem::path& folder) noexcept;
/// Makes the folder permanent, at its path or where it has been moved.
void keep_temporary_folder(const std::filesystem::path& folder, const std::filesystem::path& moved_to = {}) noexcept;

/// A temporary folder, removed by the destructor.
class TemporaryFolder {
 public:
  /// In $TMPDIR, else /tmp; or in `parent`.
  explicit TemporaryFolder(const std::string& begin);
  TemporaryFolder(const std::filesystem::path& parent, const std::string& begin) : path_(make_temporary_folder(parent, begin)) {}
  ~TemporaryFolder() { remove_temporary_folder(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Registers children for end_children_and_temporaries(); in the WholeStep that starts the child.
void note_child(pid_t child) noexcept;
void forget_child(pid_t child) noexcept;

/// Ends the children (SIGTERM, later SIGKILL) and removes all temporary folders of this process. Async-signal-safe.
void end_children_and_temporaries() noexcept;

}  // namespace carillon::base
