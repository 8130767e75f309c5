// Container of GLB files. Internal to carillon::gltf.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace carillon::gltf {

inline constexpr std::string_view kMagic = "glTF";
inline constexpr std::uint32_t kGlbVersion = 2;
inline constexpr std::size_t kHeaderBytes = 12, kChunkBytes = 8;  // magic, version, length; length, type
inline constexpr std::uint32_t kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;

}  // namespace carillon::gltf
