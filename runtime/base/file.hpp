// Reading of untrusted files; atomic writing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// True for errno values of a full disk or quota.
bool is_full_error(int error);

/// Parent folder; "." if the name has none.
std::filesystem::path find_folder(const std::filesystem::path& file);

/// Contents of a regular file. Throws InputError if missing, not a regular file (never blocks on pipes), unreadable, or longer than
/// `max_bytes`. `what` names the expected file in messages ("job file").
std::string read_file(const std::filesystem::path& file, std::string_view what, std::uint64_t max_bytes,
                      std::string_view remedy = "check that this is the right file");

/// Contents of a regular file of any length, in order, in pieces of at most `piece_bytes`. Throws as read_file does.
void read_pieces(const std::filesystem::path& file, std::string_view what, std::size_t piece_bytes,
                 const std::function<void(std::string_view)>& take);

/// Atomic write: temporary file in the same folder, fsync, rename, fsync of the folder. The temporary file is nameless until complete
/// where the file system supports it (not NFS), so that a killed process leaves nothing behind. Throws SystemError and cleans up.
void write_file(const std::filesystem::path& file, std::string_view bytes);

/// Atomic write in pieces:
///
///   WholeFile file("stiffness.mtx");
///   while (more) file.append(piece);
///   file.commit();
///
/// Without commit() nothing is left behind. All members throw SystemError on I/O errors.
class WholeFile {
 public:
  explicit WholeFile(std::filesystem::path file);
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  void append(std::string_view bytes);
  /// Replaces bytes that were appended; they must exist.
  void overwrite(std::uint64_t at, std::string_view bytes);
  /// On return the name refers to the new content.
  void commit();

 private:
  [[noreturn]] void refuse(int error);

  std::filesystem::path file_, temporary_;
  int descriptor_ = -1;
  bool is_nameless_ = false;  // the temporary file has no name yet
};

/// Atomic folder: filled under a temporary name in the same parent, renamed by commit().
class WholeFolder {
 public:
  /// Throws SystemError.
  explicit WholeFolder(std::filesystem::path place);
  ~WholeFolder();
  WholeFolder(const WholeFolder&) = delete;
  WholeFolder& operator=(const WholeFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Replaces an existing folder of that name. Throws SystemError.
  void commit();

 private:
  std::filesystem::path place_, path_;
  std::vector<std::filesystem::path> made_;  // created parents, innermost first; removed without commit()
};

/// Absolute path of a folder to replace (WholeFolder). Foreign entries (not `is_ours`): InputError with the name `what`.
std::filesystem::path find_replaceable(const std::filesystem::path& folder,
                                       const std::function<bool(const std::filesystem::path&)>& is_ours, std::string_view what);

/// Extension in lower case with its point: ".obj" for "Cup.OBJ".
std::string find_extension(const std::filesystem::path& file);

/// Throws InputError unless `file` can be written: its folder exists or can be created and is writable, and `file` is not a folder or
/// device. Called before long computations. `what` names the output in messages ("bank").
void check_writable(const std::filesystem::path& file, std::string_view what);

}  // namespace carillon::base
