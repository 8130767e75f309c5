#include <string>

#include "runtime/bank/write.hpp"
#include "runtime/base/file.hpp"
#include "runtime/exchange/gltf_scene.hpp"

namespace carillon::exchange {

bool is_gltf(const std::filesystem::path& file) {
  const std::string ending = base::find_extension(file);
  return ending == ".gltf" || ending == ".glb";
}

GltfScene write_gltf_scene(const std::filesystem::path& file, const GlbReading& reading, const std::filesystem::path& folder) {
  const std::string bytes = base::read_file(file, "glTF scene", kMaxGlbBytes);
  GltfScene made = read_gltf_scene(bytes, file.string(), reading,
                                   [&](const std::string& name, const bank::Bank& bank) { bank::write_bank(bank, folder / name); });
  base::write_file(folder / kSceneFile, made.scene.text());
  return made;
}

}  // namespace carillon::exchange
