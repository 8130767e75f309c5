// Inner loop of the boundary elements: sixteen test facets against one patch of source facets at one wave number.
#pragma once

#include <cstddef>
#include <cstdint>

namespace carillon::air {

inline constexpr int kLanes = 16;

/// Sixteen test facets; padding has weight 0. Positions are relative to the middle of the surface.
struct alignas(64) TestBlock {
  float place[3][3][kLanes];  // midpoint, axis
  float normal[3][kLanes];
  float weight[kLanes];      // a third of the area, over 4 pi
  float reach[3][kLanes];    // kNearPoints times the size of the midpoint
  float curl[3][3][kLanes];  // corner, axis
};

/// A midpoint with the sums over its facets in the patch.
struct PatchPoint {
  float place[3];
  float reach;
  float normal[3];  // sum of normal times a sixth of the area
};

/// Patch of facets with local numbers of midpoints and nodes. Non-owning.
struct Patch {
  int points = 0, facets = 0, nodes = 0;
  const PatchPoint* point = nullptr;
  const std::int32_t* facet_points = nullptr;  // (facets, 3)
  const std::int32_t* first_point = nullptr;   // (nodes + 1): midpoints next to each node
  const std::int32_t* node_points = nullptr;
  const std::int32_t* first_facet = nullptr;  // (nodes + 1): facets of each node
  const std::int32_t* node_facets = nullptr;
  const float* node_curls = nullptr;  // (as many, 3): curl of the node's hat function times a third of the area
  const float* source = nullptr;      // (points, sources): third of area times velocity, summed over the facets of the patch
  int sources = 0;                    // a multiple of kSources
  bool may_be_near = true;            // of the block
};

inline constexpr int kSources = 4;  // processed at once

struct WaveNumber {
  float k = 0.0F;         // [1/m]
  float coupling = 0.0F;  // beta of alpha = i beta [m]
};

/// Scratch buffers of a patch, sized by the caller.
struct TileRoom {
  float* point = nullptr;  // (points, 8, kLanes): three corners and the plain kernel, real and imaginary parts
  float* facet = nullptr;  // (facets, 2, kLanes)
};

/// Fills `matrix` (nodes, 3, 2, kLanes): for corner c of each lane's facet the entry of - K - alpha W with the node, real and imaginary.
/// Adds - V - alpha K' of the sources to `right` (sources, 3, 2, kLanes).
void calc_tile(const TestBlock& block, const Patch& patch, const WaveNumber& wave, const TileRoom& room, float* matrix, float* right);

/// y = A x: A (rows, unknowns) complex; x and y in the layout of Sides, `vectors` times kLanes sides. The bits of a row do not depend on
/// the other rows.
void multiply_rows(const float* matrix, std::size_t rows, std::size_t unknowns, const float* x, std::size_t vectors, float* y);

}  // namespace carillon::air
