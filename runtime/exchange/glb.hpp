// A bank as a GLB file: the surface as a mesh, its modes as the draft extension KHR_audio_rigid_bodies, and what that cannot say as extras,
// so that the same bank can be made of it again. docs/howto/export.md describes the file.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "runtime/bank/bank.hpp"
#include "runtime/material/material.hpp"

namespace carillon::exchange {

inline constexpr const char* kExtension = "KHR_audio_rigid_bodies";

struct GlbOptions {
  std::string name = "body";  // of mesh, node and model
  bool is_z_up = false;       // the node is turned so that the body's z points up, y in glTF; its own frame stays
};

/// Hands the file on in pieces, in order. Modes by falling audibility, at the frequencies that are played (corrected ones, where there are
/// any). Modes that do not swing (over-damped) have no place in the extension and are among the extras.
/// Throws InputError for a bank without modes, and for more than the 4 GiB that GLB can say.
void write_glb(const bank::Bank& bank, const GlbOptions& options, const std::function<void(std::string_view)>& sink);

struct GlbReading {
  std::optional<std::size_t> model{};            // its number, of a file of several
  bool ignores_extras = false;                   // as of another program: what the extension itself says
  const material::Material* material = nullptr;  // of a model that names none
};

/// The bank of a GLB file; `name` is that of the file. Of one that write_glb() made it is the same bank, to the bit. Of another program's
/// it is what the extension says: its surface, frequencies, decays and shapes (16 bits), mass properties, or those of the surface filled
/// with the material. Throws InputError that begins with the name for what is damaged, was changed, or lacks what a bank needs.
bank::Bank parse_glb(std::string_view bytes, const std::string& name, const GlbReading& reading = {});

}  // namespace carillon::exchange
