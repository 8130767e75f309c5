// Modes in the bank's form: 16-bit shapes on the surface, and radiation gains.
#pragma once

#include <petscmat.h>

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "runtime/bank/radiation_gain.hpp"
#include "runtime/bank/surface.hpp"

namespace carillon::io {

/// The surface of the body, known to rank 0.
struct Surface {
  std::vector<Vec3> vertices_m;     // (V) in the order of the mesh's nodes
  std::vector<Triangle> triangles;  // (T) of vertices, counter-clockwise from outside
  std::vector<std::int32_t> row;    // (V) r: rows 3 r, 3 r + 1, 3 r + 2 of the shapes; -1: fixed
};

struct SurfaceModes {
  std::vector<double> shape_scale;     // (m) every rank; bank::Bank
  std::vector<double> radiation_gain;  // (m) every rank
  std::vector<std::int16_t> shape;     // (V, m, 3) rank 0 only
};

/// Calculates the surface modes; each rank works on its own rows, and rank 0 receives 16-bit steps only. The surface is read on rank 0.
/// shapes: dense (3n, m) [kg^-1/2], or null when there are no modes; omega_rad_s: (m).
/// shape and shape_scale have the same bits for every number of ranks, radiation_gain the same to rounding.
/// Collective. Throws SolveError on every rank when a shape is not finite, SystemError when memory runs out.
SurfaceModes calc_surface_modes(const comm::Communicator& comm, Mat shapes, std::span<const double> omega_rad_s, const Surface& surface);

}  // namespace carillon::io
