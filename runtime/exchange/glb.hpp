// Banks as GLB files: the surface as a mesh, modes in the draft extension KHR_audio_rigid_bodies, all other arrays as extras, for lossless
// import. docs/howto/export.md describes the file.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/material/material.hpp"

namespace carillon::exchange {

inline constexpr const char* kExtension = "KHR_audio_rigid_bodies";

struct GlbOptions {
  std::string name = "body";  // name of mesh, node and model
  bool is_z_up = false;       // rotates the node so that the body's z axis is up (y in glTF)
};

/// Writes the file to `sink` in pieces, in order. Modes by descending audibility, at their playing frequencies (corrected if available).
/// Over-damped modes, which the extension cannot represent, are among the extras. Throws InputError for a bank without modes, and above the
/// 4 GiB limit of GLB.
void write_glb(const bank::Bank& bank, const GlbOptions& options, const std::function<void(std::string_view)>& sink);

struct GlbReading {
  std::optional<std::size_t> model{};            // index of the model, if several
  bool ignores_extras = false;                   // read the extension only
  const material::Material* material = nullptr;  // for models without a material
};

/// Imports a GLB or glTF file `name`, with separate buffers in the same folder. From write_glb(): the same bank, bit by bit. From another
/// program: surface, frequencies, decays and shapes (16 bits) of the extension, and its mass properties, else those of the surface filled
/// with the material. For a scaled node, the density of the material decides to which size modes and mass belong, noted in `notes`. Throws
/// InputError that begins with the name for damaged, modified and incomplete files.
bank::Bank parse_glb(std::string_view bytes, const std::string& name, const GlbReading& reading = {},
                     std::vector<std::string>* notes = nullptr);

}  // namespace carillon::exchange
