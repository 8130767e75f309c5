// The folder that a rank works in, where others may put links.
#pragma once

#include <filesystem>

namespace carillon::run {

/// Makes `name` below `root` the folder of this process, step by step: `root` may lead through links, what lies below may not. Throws
/// SystemError. Not collective.
void enter_folder(const std::filesystem::path& root, const std::filesystem::path& name);

}  // namespace carillon::run
