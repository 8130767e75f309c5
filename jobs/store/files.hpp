// Durable files and folders, and the error messages of the disk.
#pragma once

#include <exception>
#include <filesystem>
#include <string>
#include <vector>

namespace carillon::store {

/// fsync. SystemError when the disk refuses.
void sync_file(const std::filesystem::path& file);
void sync_folder(const std::filesystem::path& folder);

/// fsync of a folder and everything below it. `seal`: files become 0444 and inner folders 0555; the folder itself stays writable, which
/// rename() requires. SystemError when the disk refuses, and for anything but files and folders.
void sync_tree(const std::filesystem::path& folder, bool seal);

/// Makes a file 0444 and syncs it. A file of another user is replaced by a copy. SystemError when the disk refuses.
void seal_file(const std::filesystem::path& file);

/// Creates one folder unless it exists. SystemError when the disk refuses.
void make_folder(const std::filesystem::path& folder);

/// Names in a folder, sorted; empty if the folder is missing or unreadable.
std::vector<std::string> list_names(const std::filesystem::path& folder);

/// Removes a file, or a folder with its content (read-only folders too). Follows no link. SystemError if anything remains.
void remove_tree(const std::filesystem::path& path);

/// Throws SystemError "path: cannot VERB: reason; remedy" with the remedy for errno.
[[noreturn]] void throw_errno(const std::filesystem::path& path, const std::string& verb, int error);

/// Appends to a file, which is created if necessary. False on failure.
bool append_text(const std::filesystem::path& file, const std::string& text);

/// Remedy for base::is_full_error(), as the end of a message.
inline constexpr const char* kFullAdvice = "the disk or quota is full: make room on it (carillon gc lists what could go) and try again";

/// True when less than 1 MB is free on the file system of `folder`.
bool is_disk_full(const std::filesystem::path& folder);
/// The same, or `error` says so: the free part of a quota cannot be queried.
bool is_disk_full(const std::filesystem::path& folder, const std::exception& error);

}  // namespace carillon::store
