// Radiation of the modes of a GLB file: the extension CARILLON_multipoles of a modal model. docs/gltf-multipoles.md defines it.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/json.hpp"
#include "runtime/exchange/gltf/file.hpp"
#include "runtime/exchange/gltf/writer.hpp"

namespace carillon::exchange {

inline constexpr const char* kMultipoles = "CARILLON_multipoles";

/// The extension's object for the modes `modes` (indices in the bank), whose accessors are added to `writer`. Coefficients, decays and
/// errors as float; shapes of the modes in air only if the air couples modes. The bank must have multipoles.
base::Json describe_multipoles(const bank::Bank& bank, const std::vector<std::size_t>& modes, gltf::Writer& writer);

/// Radiation of a modal model in a file.
struct GlbMultipoles {
  bank::Multipoles multipoles;          // modes in the order of the model, at its frequencies; without added mass
  std::optional<gltf::Numbers> shapes;  // (M, P) rows of three, mode by mode: shapes of modes coupled by the air, which replace the model's
};

/// Modal model that the radiation belongs to.
struct GlbModes {
  std::span<const double> freq_hz, decay_per_s;  // (M) damped frequencies; whole decays
  std::size_t points = 0;                        // P
};

/// Reads the extension of `model`; nullopt if it has none. Throws InputError with file, line and JSON path for wrong sizes, indices out of
/// range, orders above bank::kMaxOrder, and numbers that are not finite.
std::optional<GlbMultipoles> read_multipoles(gltf::File& file, base::Object& model, const GlbModes& modes);

/// True if `read` is what describe_multipoles() writes for these modes of a bank with `own`, up to rounding.
bool are_multipoles_of(const GlbMultipoles& read, const bank::Multipoles& own, const std::vector<std::size_t>& modes);

}  // namespace carillon::exchange
