// Scenes in glTF as input of carillon-render.
#pragma once

#include <memory>

#include "runtime/base/temporary.hpp"
#include "runtime/render/program.hpp"

namespace carillon::render {

/// For a scene in glTF: converts it into a temporary folder, from then on the scene of `options`. The folder must outlive the run. nullptr
/// for other scenes. Throws InputError.
std::unique_ptr<base::TemporaryFolder> convert_gltf(ProgramOptions& options);

}  // namespace carillon::render
