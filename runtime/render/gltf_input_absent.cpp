// Scenes in glTF in a build without the component EXCHANGE.
#include "runtime/base/component.hpp"
#include "runtime/base/file.hpp"
#include "runtime/render/gltf_input.hpp"

namespace carillon::render {

std::unique_ptr<base::TemporaryFolder> convert_gltf(ProgramOptions& options) {
  const std::string ending = base::find_extension(options.scene);
  if (ending == ".gltf" || ending == ".glb") base::refuse_missing(options.scene.string(), "EXCHANGE");
  return nullptr;
}

}  // namespace carillon::render
