// Files that another program wrote, and files that must appear whole or not at all.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// Whether this value of errno is that of a disk, or of a user's share of it, that takes no more.
bool is_full_error(int error);

/// The folder that a file is in: "." where its name has none.
std::filesystem::path find_folder(const std::filesystem::path& file);

/// The bytes of a regular file. Throws InputError when there is none, when it is a folder, a pipe or a device (never waits on one), when it
/// cannot be read, or when it holds more than `max_bytes`. `what` says in messages what was expected ("job file").
std::string read_file(const std::filesystem::path& file, std::string_view what, std::uint64_t max_bytes,
                      std::string_view remedy = "check that this is the right file");

/// The bytes of a regular file of any length, in pieces of at most `piece_bytes`, in order. Throws as read_file does.
void read_pieces(const std::filesystem::path& file, std::string_view what, std::size_t piece_bytes,
                 const std::function<void(std::string_view)>& take);

/// Writes the bytes to a temporary file next to `file`, fsyncs, renames it to `file` and fsyncs the folder: readers see the old content
/// or the new. The temporary file has no name until it is whole, where the file system can do that (not on NFS): a process that is ended in
/// the middle leaves nothing. Throws SystemError when the disk refuses; nothing is left behind then.
void write_file(const std::filesystem::path& file, std::string_view bytes);

/// The same for content that comes in pieces:
///
///   WholeFile file("stiffness.mtx");
///   while (more) file.append(piece);
///   file.commit();
///
/// One that goes without commit() leaves nothing behind. All throw SystemError when the disk refuses.
class WholeFile {
 public:
  explicit WholeFile(std::filesystem::path file);
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  void append(std::string_view bytes);
  /// The name is there, and the old content gone, when it returns.
  void commit();

 private:
  [[noreturn]] void refuse(int error);

  std::filesystem::path file_, temporary_;
  int descriptor_ = -1;
  bool is_nameless_ = false;  // the temporary file has no name yet
};

/// A folder that appears whole or not at all: it is filled under another name next to its place, and renamed by commit().
class WholeFolder {
 public:
  /// Throws SystemError when the disk refuses.
  explicit WholeFolder(std::filesystem::path place);
  ~WholeFolder();
  WholeFolder(const WholeFolder&) = delete;
  WholeFolder& operator=(const WholeFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// What stands at its place is removed. Throws SystemError.
  void commit();

 private:
  std::filesystem::path place_, path_;
  std::vector<std::filesystem::path> made_;  // folders above it that were not there, innermost first: they go with it
};

/// The extension with its point, in lower case: ".obj" of "Cup.OBJ".
std::string find_extension(const std::filesystem::path& file);

/// Throws InputError unless `file` can be written: its folder exists (or can be made) and takes files, and `file` itself is no folder or
/// device. Meant for before long work. `what` names the output in messages ("bank").
void check_writable(const std::filesystem::path& file, std::string_view what);

}  // namespace carillon::base
