// What kind of motion a mode is: bending, torsion, nodal diameters ..., from its shape on the surface.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

enum class MotionKind : std::uint8_t {
  kUnknown,         // none of those below, or several at once
  kBending,         // of a long body, along the thinner side of its section; of a section as wide as thick in any direction
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
  // How often the motion changes its sign along the long axis: the nodes of a long body, the nodal lines across the length of a flat one;
  // the nodal diameters of a round one. None: not known.
  std::optional<int> nodes = {};
  std::optional<int> lines = {};  // nodal lines along the length of a flat body
};

/// Of the first `count` modes, or of all when there are no more. Cost: a pass over their shapes. Pure; any thread.
std::vector<ModeKind> find_kinds(const Bank& bank, std::size_t count = SIZE_MAX);

/// "bending, 2 nodes", "plate bending, 2 x 1 lines", "3 diameters", "breathing"; "-" for kUnknown.
std::string describe(const ModeKind& kind);

}  // namespace carillon::bank
