// Classification of modes by their surface shapes (bending, torsion, nodal diameters ...).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

enum class MotionKind : std::uint8_t {
  kUnknown,         // other, or mixed
  kBending,         // long body, along the thinner side of its section; square or round section: any direction
  kLateralBending,  // along the wider side
  kTorsion,         // about the long axis, or about the axis of a round body
  kLongitudinal,    // along the long axis
  kBreathing,       // uniform expansion of the outer surface
  kDiameters,       // round body
  kPlateBending,    // flat body, out of plane
  kInPlane,         // flat body
};

struct ModeKind {
  MotionKind motion = MotionKind::kUnknown;
  // Nodes of a long body, nodal lines across the length of a flat one, nodal diameters of a round one; nullopt: unknown.
  std::optional<int> nodes = {};
  std::optional<int> lines = {};  // flat body: nodal lines along its length
};

/// Kinds of the first `count` modes. Cost: one pass over their shapes. Thread-safe.
std::vector<ModeKind> find_kinds(const Bank& bank, std::size_t count = SIZE_MAX);

/// "bending, 2 nodes", "plate bending, 2 x 1 lines", "3 diameters", "breathing"; "-" for kUnknown.
std::string describe(const ModeKind& kind);

}  // namespace carillon::bank
