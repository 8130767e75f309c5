// Working directory of a rank, safe against links made by others.
#pragma once

#include <filesystem>

namespace carillon::run {

/// Changes to `name` below `root` component by component: `root` may contain links, `name` may not. Throws SystemError. Not collective.
void enter_folder(const std::filesystem::path& root, const std::filesystem::path& name);

}  // namespace carillon::run
