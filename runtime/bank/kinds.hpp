// Kinds of motion of modes (bending, torsion, nodal diameters ...), from their shapes on the surface.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

enum class MotionKind : std::uint8_t {
  kUnknown,         // another kind, or a mixture
  kBending,         // of a long body, along the thinner side of its section; square and round sections: any direction
  kLateralBending,  // along the wider side
  kTorsion,         // about the long axis, or about the axis of a round body
  kLongitudinal,    // along the long axis
  kBreathing,       // the whole skin outward and inward
  kDiameters,       // of a round body
  kPlateBending,    // of a flat body, out of its plane
  kInPlane,         // of a flat body
};

struct ModeKind {
  MotionKind motion = MotionKind::kUnknown;
  // Nodes of a long body, nodal lines across the length of a flat one, nodal diameters of a round one. None: unknown.
  std::optional<int> nodes = {};
  std::optional<int> lines = {};  // nodal lines along the length of a flat body
};

/// Of the first `count` modes, at most all. Cost: a pass over their shapes. Pure; any thread.
std::vector<ModeKind> find_kinds(const Bank& bank, std::size_t count = SIZE_MAX);

/// "bending, 2 nodes", "plate bending, 2 x 1 lines", "3 diameters", "breathing"; "-" for kUnknown.
std::string describe(const ModeKind& kind);

}  // namespace carillon::bank
