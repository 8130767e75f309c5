// Many right sides of one matrix, by GMRES.
#pragma once

#include <functional>

#include "precompute/air/sides.hpp"

namespace carillon::air {

/// y = A x.
using Multiply = std::function<void(const Sides& x, Sides& y)>;

struct GmresOptions {
  double tolerance = 1e-4;  // of the residual, relative to the right side
  int max_products = 300;
  int restart = 60;
};

struct GmresResult {
  int products = 0;
  double residual = 0.0;  // of the worst side, relative, as the iteration knows it
  bool is_converged = false;
};

/// Solves for each side alone; all share the products. `solution` is zero at first or a guess. Sums over unknowns are in double precision
/// and in their order. Deterministic.
GmresResult solve_gmres(const Multiply& multiply, const Sides& right, const GmresOptions& options, Sides& solution);

}  // namespace carillon::air
