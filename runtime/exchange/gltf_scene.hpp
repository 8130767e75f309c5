// Scenes in glTF (KHR_audio_rigid_bodies, KHR_physics_rigid_bodies, KHR_implicit_shapes) as banks and a scene file.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/json.hpp"
#include "runtime/exchange/glb.hpp"

namespace carillon::exchange {

struct GltfScene {
  base::Json scene;                   // a scene file; its banks are named without a folder
  std::vector<std::string> readings;  // of scaled nodes, a line each
  std::vector<std::string> warnings;  // a line each
  std::size_t bodies = 0, banks = 0;
};

/// Reads a scene. `sink` takes each bank with its name, in order; equal ones once. Bodies are in the frame of their node, the world has z
/// up. `name`: the file, for messages and buffers. Throws InputError that begins with it.
GltfScene read_gltf_scene(std::string_view bytes, const std::string& name, const GlbReading& reading,
                          const std::function<void(const std::string& file, const bank::Bank& bank)>& sink);

/// True for names that end in .gltf or .glb.
bool is_gltf(const std::filesystem::path& file);

inline constexpr const char* kSceneFile = "scene.json";

/// Reads a scene file and writes scene.json with its banks into an existing folder. Throws as read_gltf_scene().
GltfScene write_gltf_scene(const std::filesystem::path& file, const GlbReading& reading, const std::filesystem::path& folder);

}  // namespace carillon::exchange
