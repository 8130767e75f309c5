// The stage from a body to its matrices.
#pragma once

#include <vector>

#include "precompute/fem/assemble.hpp"
#include "precompute/fem/materials.hpp"
#include "precompute/run/body.hpp"
#include "precompute/run/run.hpp"

namespace carillon::run {

/// What the body is made of, and how it moves as a whole.
struct BodyProperties {
  fem::Materials materials;
  std::vector<double> volume_m3;  // of each material
  fem::RigidBody rigid;
};

struct AssembledSystem {
  fem::System matrices;  // K and M
  BodyProperties properties;
};

/// Finds the materials, assembles K and M, and integrates volumes and inertia. Warns of locking. Phase "assemble". Collective. Throws on
/// every rank: InputError, SolveError, SystemError, with the body or the job's line named.
AssembledSystem assemble_system(Run& run, const Setting& setting, const Body& body);

}  // namespace carillon::run
