// For which bodies a contacts file was made.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "runtime/events/file.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// The bodies of a scene, whose specs have their banks, as a contacts file names them.
std::vector<events::RecordedBody> list_bodies(const Scene& scene);

/// Throws InputError, which begins with `file`, unless the bodies of a file are these, in their order, with the same surfaces. A file that
/// does not say which surfaces it was made for is compared by their numbers of triangles, with a warning.
void check_bodies(const std::filesystem::path& file, const std::vector<events::RecordedBody>& theirs,
                  const std::vector<events::RecordedBody>& ours, std::vector<std::string>& warnings);

}  // namespace carillon::scene
