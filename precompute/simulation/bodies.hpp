// Bodies of a simulation, from their description to an assembly on all ranks.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/job/simulation.hpp"
#include "precompute/simulation/transient/contact.hpp"
#include "precompute/simulation/transient/motion.hpp"

namespace carillon::simulation {

/// Rotates from mesh to world coordinates, then translates.
struct Placement {
  Mat3 rotation{};
  Vec3 position_m{};
  Vec3 place(const Vec3& x_m) const { return rotation * x_m + position_m; }
};
Placement find_placement(const job::SimulatedBody& body);

/// Result of bending a body.
struct Bent {
  std::size_t body = 0;
  double displacement_m = 0;  // maximum
  double energy_j = 0;        // elastic
  double mode_hz = 0;         // 0: not bent by a mode
  double cpu_s = 0;
};

/// Bodies and their constraints, the same on every rank.
struct Bodies {
  std::shared_ptr<const transient::Assembly> assembly;
  std::vector<transient::Constraint> constraints;
  std::vector<transient::Impulse> impulses;
  std::vector<std::string> warnings;   // from the meshes, on rank 0
  std::vector<Vec3> centre_m;          // centres of mass
  std::vector<transient::Quad> start;  // (nodes) displacements; for sheet edges the angle, in x; empty: no bent body
  std::vector<Bent> bent;              // on rank 0
};

/// Reads or makes the meshes on rank 0, positions them, and finds fixed, driven and struck nodes. Collective. Throws on every rank:
/// InputError that names the body's line in the job, SystemError. `report`: one line per body, called on rank 0.
Bodies make_bodies(const comm::Communicator& comm, const job::SimulationSpec& spec, const std::function<void(const std::string&)>& report);

/// Outward triangles of a body's skin in assembly numbers: four per facet of quadratic elements. A sheet has its own.
std::vector<std::array<std::int32_t, 3>> list_skin_triangles(const transient::Assembly& assembly, std::int32_t body);

/// Contact surfaces.
transient::TouchSurface make_touch_surface(const transient::Assembly& assembly, const job::SimulationSpec& spec);

}  // namespace carillon::simulation
