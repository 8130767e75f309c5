// Compatibility of a contacts file with the bodies of a scene.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "runtime/events/file.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// Bodies of a scene, whose specs have their banks, as written to a contacts file.
std::vector<events::RecordedBody> list_bodies(const Scene& scene);

/// Throws InputError "FILE: ..." unless the bodies of the file are these, in this order, with the same surfaces. Files without surface data
/// are compared by numbers of triangles, with a warning.
void check_bodies(const std::filesystem::path& file, const std::vector<events::RecordedBody>& theirs,
                  const std::vector<events::RecordedBody>& ours, std::vector<std::string>& warnings);

}  // namespace carillon::scene
