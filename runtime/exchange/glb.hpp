// A bank as a GLB file: the surface as a mesh, its modes as the draft extension KHR_audio_rigid_bodies, and all other arrays as extras, so
// that the same bank can be read back. docs/howto/export.md describes the file.
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
  std::string name = "body";  // of mesh, node and model
  bool is_z_up = false;       // the node is turned so that the body's z points up, y in glTF; its own frame stays
};

/// Writes the file to the sink in pieces, in order. Modes by falling audibility, at the frequencies that are played (corrected ones, where
/// there are any). Over-damped modes have no place in the extension and are among the extras.
/// Throws InputError for a bank without modes, and for more than the 4 GiB that GLB can hold.
void write_glb(const bank::Bank& bank, const GlbOptions& options, const std::function<void(std::string_view)>& sink);

struct GlbReading {
  std::optional<std::size_t> model{};            // its number, of a file of several
  bool ignores_extras = false;                   // read as a file of another program: the extension alone
  const material::Material* material = nullptr;  // of a model that names none
};

/// The bank of a GLB or glTF file `name`, with separate buffers in the same folder. From a file of write_glb(): the same bank, bit for bit.
/// From another program's: surface, frequencies, decays and shapes (16 bits) of the extension, and its mass properties, else those of the
/// surface filled with the material. For a node with a scale, the density of the material decides on the size that modes and mass belong
/// to, with a sentence in `notes`. Throws InputError that begins with the name for damaged, changed and incomplete files.
bank::Bank parse_glb(std::string_view bytes, const std::string& name, const GlbReading& reading = {},
                     std::vector<std::string>* notes = nullptr);

}  // namespace carillon::exchange
