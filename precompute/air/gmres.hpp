// GMRES for one matrix and many right-hand sides.
#pragma once

#include <functional>

#include "precompute/air/sides.hpp"

namespace carillon::air {

/// y = A x.
using Multiply = std::function<void(const Sides& x, Sides& y)>;

struct GmresOptions {
  double tolerance = 1e-4;  // relative residual
  int max_products = 300;
  int restart = 60;
};

struct GmresResult {
  int products = 0;
  double residual = 0.0;  // largest relative residual, as estimated by the iteration
  bool is_converged = false;
};

/// Solves all sides with shared matrix products. `solution`: initial guess, may be zero. Sums over unknowns are in double precision and in
/// order. Deterministic.
GmresResult solve_gmres(const Multiply& multiply, const Sides& right, const GmresOptions& options, Sides& solution);

}  // namespace carillon::air
