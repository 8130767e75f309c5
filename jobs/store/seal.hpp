// Files on their way into the store, by descriptor: synced, and read-only where they are results.
#pragma once

#include <unistd.h>

#include <string>

#include "jobs/store/open_folder.hpp"

namespace carillon::store {

/// A file by descriptor, closed at the end.
struct File {
  int value = -1;
  ~File() {
    if (value >= 0) ::close(value);
  }
};

/// A regular file in a folder; its value is below 0, and errno set, when it cannot be opened. Never waits, follows no link.
int open_regular(const OpenFolder& folder, const char* name);

/// Makes a file read-only and syncs it. A file of another user of the store, or with further names, is replaced by a copy first: no file
/// elsewhere changes its rights. SystemError when the disk refuses.
void seal_file(const OpenFolder& folder, const std::string& name);

/// Syncs the folder and all in it; with `seal`, makes files and inner folders read-only. The folder itself stays writable: only then may
/// it be renamed. SystemError when the disk refuses, and for a link.
void sync_tree(const OpenFolder& folder, bool seal);

}  // namespace carillon::store
