// Files and folders that have to be on the disk, and sentences about those that are not.
#pragma once

#include <filesystem>
#include <string>

namespace carillon::store {

/// fsync. SystemError when the disk refuses.
void sync_file(const std::filesystem::path& file);
void sync_folder(const std::filesystem::path& folder);
/// All that was written to the file system of `folder` so far (syncfs).
void sync_file_system(const std::filesystem::path& folder);

/// Makes one folder unless it is there. SystemError when the disk refuses.
void make_folder(const std::filesystem::path& folder);

/// Throws SystemError "path: cannot VERB: reason; mend" with the mend that fits errno.
[[noreturn]] void throw_errno(const std::filesystem::path& path, const std::string& verb, int error);

/// Removes a folder with all that is in it, folders made read-only by us among it. Follows no links. SystemError when something stays.
void remove_tree(const std::filesystem::path& folder);

}  // namespace carillon::store
