// The bodies of a simulation, from their description to an assembly on all ranks.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/job/simulation.hpp"
#include "precompute/simulation/transient/contact.hpp"
#include "precompute/simulation/transient/motion.hpp"

namespace carillon::simulation {

/// Turns from the axes of a body's mesh to the world, then moves.
struct Placement {
  Mat3 rotation{};
  Vec3 position_m{};
  Vec3 place(const Vec3& x_m) const { return rotation * x_m + position_m; }
};
Placement find_placement(const job::SimulatedBody& body);

/// Results of bending a body.
struct Bent {
  std::size_t body = 0;
  double displacement_m = 0;  // the largest
  double energy_j = 0;        // elastic
  double mode_hz = 0;         // 0: not bent by a mode
  double cpu_s = 0;
};

/// Everything that moves and what constraints it, the same on every rank.
struct Bodies {
  std::shared_ptr<const transient::Assembly> assembly;
  std::vector<transient::Constraint> constraints;
  std::vector<transient::Impulse> impulses;
  std::vector<std::string> warnings;   // of their meshes, on rank 0
  std::vector<Vec3> centre_m;          // of mass, of each body
  std::vector<transient::Quad> start;  // (nodes) displacements; for edges of sheets the angle, in x; empty: no bent body
  std::vector<Bent> bent;              // on rank 0
};

/// Reads and makes the meshes on rank 0, puts them in their places, and finds the nodes that are fixed, driven or struck. Collective.
/// Throws on every rank: InputError that names the body's line in the job, SystemError. `report`: one line per body, called on rank 0.
Bodies make_bodies(const comm::Communicator& comm, const job::SimulationSpec& spec, const std::function<void(const std::string&)>& report);

/// Triangles of a body's skin in assembly numbers, from outside: four for each facet of quadratic elements. A sheet has its own.
std::vector<std::array<std::int32_t, 3>> list_skin_triangles(const transient::Assembly& assembly, std::int32_t body);

/// The surfaces that may touch.
transient::TouchSurface make_touch_surface(const transient::Assembly& assembly, const job::SimulationSpec& spec);

}  // namespace carillon::simulation
