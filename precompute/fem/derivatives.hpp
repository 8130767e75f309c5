// Derivatives of the frequencies by the constants of the material and the size.
#pragma once

#include <petscmat.h>

#include <span>
#include <string>
#include <vector>

#include "precompute/fem/assemble.hpp"

namespace carillon::fem {

/// d ln f / d ln p of the n lowest modes for p parameters; of Poisson's ratios d ln f / d nu.
struct Derivatives {
  std::vector<std::string> parameters;  // (p) keys of a material in a job; "size"
  std::vector<double> values;           // (n, p)
};

/// Of a body of one material, at constant shapes: d lambda = phi^T dK phi - lambda phi^T dM phi. `lambda` (n); `shapes` (3n, m), m >= n,
/// rows as in the system of `local`. Assembles K once for an isotropic material, 18 times for an orthotropic one. Collective. Throws on
/// every rank as assemble().
Derivatives calc_derivatives(const comm::Communicator& comm, const mesh::LocalMesh& local, const material::Material& material,
                             job::Mass mass, std::span<const double> lambda, Mat shapes);

}  // namespace carillon::fem
