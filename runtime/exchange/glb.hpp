// Banks as GLB files: the surface as a mesh, modes in the draft extension KHR_audio_rigid_bodies, all other arrays as extras, for lossless
// import. docs/howto/export.md describes the file.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/exchange/gltf/file.hpp"
#include "runtime/exchange/gltf/nodes.hpp"
#include "runtime/material/material.hpp"

namespace carillon::exchange {

inline constexpr const char* kExtension = "KHR_audio_rigid_bodies";
inline constexpr const char* kPhysicsExtension = "KHR_physics_rigid_bodies";

inline constexpr std::uint64_t kMaxGlbBytes = 1ULL << 32;  // of a file that is read

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
  std::optional<bool> scales_frequencies{};      // of a scaled node; empty: by the masses (scale_rule.hpp)
};

/// A node with a model: its scale, and the rigid-body data that KHR_physics_rigid_bodies gives it, in the space of the node.
struct Placement {
  double scale = 1.0;
  std::optional<double> mass_kg{};
  std::optional<Vec3> centre_m{};                        // unscaled, as positions
  std::optional<std::array<double, 9>> inertia_kg_m2{};  // (3, 3) about the centre, axes of the node
};

struct ModelBank {
  bank::Bank bank;
  std::string reading;  // of the scale, in words; empty without scale
  std::vector<std::string> warnings;
};

/// Bank of model `number` at a node. Mass and centre are those of the node, else of the model, else of its surface; the moments those of
/// the surface if they contradict it. Throws InputError as parse_glb().
ModelBank read_model(gltf::File& file, std::size_t number, const Placement& placement, const GlbReading& reading);

/// The motion of a node, for Placement. `motion`: as in KHR_physics_rigid_bodies. A mass of 0, which means infinity, is left out.
Placement read_motion(base::Object& motion);

/// Scale of a node in the world. Throws InputError with its path for one that modes cannot have.
double require_scale(gltf::Graph& graph, std::size_t node);

/// Imports a GLB or glTF file `name`, with separate buffers in the same folder. From write_glb(): the same bank, bit by bit. From another
/// program: surface, frequencies, decays and shapes (16 bits) of the extension, at the first node with the model (read_model()). Throws
/// InputError that begins with the name for damaged, modified and incomplete files.
bank::Bank parse_glb(std::string_view bytes, const std::string& name, const GlbReading& reading = {},
                     std::vector<std::string>* notes = nullptr);

}  // namespace carillon::exchange
