// Temporary folders that do not outlive their process.
//
// A folder has a file that the process keeps locked. What a killed process left is recognised by that file without a lock, and removed by
// the next that makes a folder of that name there. SIGINT, SIGTERM and SIGHUP, where nothing else handles them, remove the folders of the
// process and end the programs that it waits for, before they end it.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>

namespace carillon::base {

/// Makes the folder PARENT/BEGINxxxxxx. Throws SystemError where it cannot be made.
std::filesystem::path make_temporary_folder(const std::filesystem::path& parent, const std::string& begin);
/// Removes it with all in it.
void remove_temporary_folder(const std::filesystem::path& folder) noexcept;
/// It is no temporary folder any more.
void keep_temporary_folder(const std::filesystem::path& folder) noexcept;

/// One of them, removed at the end.
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

/// A program that this process waits for, until it is forgotten.
void note_child(pid_t child) noexcept;
void forget_child(pid_t child) noexcept;

/// Ends those programs (SIGTERM, later SIGKILL) and removes all temporary folders of this process. Async-signal-safe: for handlers that end
/// the process.
void end_children_and_temporaries() noexcept;

}  // namespace carillon::base
