// Files and folders that have to be on the disk, and sentences about those that are not.
#pragma once

#include <exception>
#include <filesystem>
#include <string>
#include <string_view>

namespace carillon::store {

/// fsync. SystemError when the disk refuses.
void sync_file(const std::filesystem::path& file);
void sync_folder(const std::filesystem::path& folder);

/// Makes one folder unless it is there. SystemError when the disk refuses.
void make_folder(const std::filesystem::path& folder);

/// Throws SystemError "path: cannot VERB: reason; correction" with the correction that fits errno.
[[noreturn]] void throw_errno(const std::filesystem::path& path, const std::string& verb, int error);

/// Appends to a regular file, which is made unless it is there; follows no link and waits for no pipe. False when that cannot be.
bool append_text(const std::filesystem::path& file, const std::string& text);

/// What to do on base::is_full_error(), as the end of a message.
inline constexpr const char* kFullAdvice = "the disk or quota is full: make room on it (carillon gc lists what could go) and try again";

/// Whether hardly a byte is free on the file system of `folder`.
bool is_disk_full(const std::filesystem::path& folder);
/// The same, or `error` says so: how full a quota is cannot be asked.
bool is_disk_full(const std::filesystem::path& folder, const std::exception& error);

}  // namespace carillon::store
