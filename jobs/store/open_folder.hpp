// Folders by descriptor. Several people may write to a store, and any of them may put a link where a folder was, at any moment. What is
// opened here stays the folder that was opened, whatever its name leads to later.
#pragma once

#include <sys/stat.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::store {

/// Owns the descriptor of one folder. All it does is relative to that descriptor and follows no link, so that it stays within the folder
/// that was opened, whatever becomes of its name.
class OpenFolder {
 public:
  /// A folder that the user named: its own name may lead through links. SystemError when it cannot be opened.
  static OpenFolder open(const std::filesystem::path& folder);
  /// A folder in this one. None when there is nothing of that name. SystemError when it is a link or no folder.
  std::optional<OpenFolder> find(const std::string& name) const;
  /// The same, made (0777 and umask) when there is nothing.
  OpenFolder make(const std::string& name) const;
  OpenFolder make_private(const std::string& name) const;  // must be new; 0700

  OpenFolder(OpenFolder&& other) noexcept;
  OpenFolder& operator=(OpenFolder&& other) noexcept;
  ~OpenFolder();

  int get() const { return descriptor_; }
  /// For people.
  const std::filesystem::path& name() const { return name_; }
  /// Leads to this folder and no other while it is open, in this process: /proc/self/fd/N.
  std::filesystem::path path() const;
  /// The same for other processes of this user on this machine.
  std::filesystem::path shared_path() const;

  /// What is there, without following a link; none when there is nothing.
  std::optional<struct stat> look_at(const std::string& name) const;
  /// Names in it, sorted, without "." and "..".
  std::vector<std::string> list() const;
  /// Removes what has this name, with all that is in it, whatever its rights. Follows no link. SystemError when something stays.
  void remove(const std::string& name) const;
  /// fsync. SystemError when the disk refuses.
  void sync() const;

 private:
  OpenFolder(int descriptor, std::filesystem::path name) : descriptor_(descriptor), name_(std::move(name)) {}
  int descriptor_ = -1;
  std::filesystem::path name_;
};

/// `text` with name() for path().
std::string show_names(const OpenFolder& folder, std::string text);
/// Throws an error of the same kind with these names in its message.
[[noreturn]] void throw_with_names(const OpenFolder& folder, const SystemError& error);

}  // namespace carillon::store
