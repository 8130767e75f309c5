// The boundary element equations of a surface outside which the air is, at any wave number.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/air/sides.hpp"
#include "precompute/air/static_part.hpp"
#include "precompute/air/surface.hpp"
#include "precompute/air/tile.hpp"

namespace carillon::air {

/// Rows of one block of the preconditioner; ranks have whole blocks.
inline constexpr std::size_t kBlockRows = 128;

/// Rows first .. last - 1 of the equations at one wave number, with N unknowns and some right sides. Each row is divided by half its lumped
/// mass, so that the matrix is near the identity for a large smooth body; first and last are whole blocks.
struct LinearSystem {
  std::size_t unknowns = 0, first = 0, last = 0, sides = 0;
  std::vector<std::complex<float>> matrix;  // (last - first, N)
  std::vector<std::complex<float>> right;   // (last - first, sides)

  std::size_t count_rows() const { return last - first; }
  /// The rows of A x.
  void multiply(const Sides& x, Sides& y) const;
};

/// Solves a system of all rows by LU with one step of refinement, for where an iteration does not converge: at the resonances of open
/// cavities. Returns the residual of the worst side, relative to its right side.
double solve_directly(const LinearSystem& system, Sides& solution);

/// The inverses of the diagonal blocks of a system, kBlockRows each: nodes of a block are neighbours, so that they hold most of the
/// hypersingular part. A block that is singular counts as the identity.
class BlockInverse {
 public:
  explicit BlockInverse(const LinearSystem& system);
  /// The same rows that the system has.
  void apply(Sides& rows) const;

 private:
  std::vector<std::vector<std::complex<float>>> blocks_;
};

/// The Galerkin form of the equation of Burton and Miller for sound that goes out from a closed surface, e^{-i omega t}:
///   [ 1/2 - K - alpha W ] p = - [ V + alpha (1/2 + K') ] q,      alpha = i / max(k, 1 / R),      q = dp / dn,
/// p linear and continuous, q linear on each facet, W by parts (equation E10 in docs/equations.md). Unique at every wave number; with the
/// other sign of alpha, or without it, the iteration does not converge or the solution is not unique. Invariant: all that is
/// independent of the wave number is made once, in the constructor. n velocities.
class BoundaryEquations {
 public:
  /// `velocity`: (T, 3, n) normal velocities at the corners of the facets of `surface`; `sphere` is around it. The surface must outlive
  /// this.
  BoundaryEquations(const RadiatingSurface& surface, const Sphere& sphere, std::vector<float> velocity, std::size_t count);

  /// The rows first .. last - 1 at wave number k > 0 [1/m] with q = v of the velocities `sides`. A row has the same bits whatever the
  /// range.
  void assemble(double k, std::span<const std::int32_t> sides, std::size_t first, std::size_t last, LinearSystem& system) const;

  const RadiatingSurface& get_surface() const { return surface_; }
  const Sphere& get_sphere() const { return sphere_; }
  std::size_t count_velocities() const { return count_; }
  /// (T, 3, n)
  std::span<const float> get_velocity() const { return velocity_; }
  std::size_t calc_bytes() const;

 private:
  struct PatchData {
    std::size_t first_facet = 0, last_facet = 0;
    std::vector<PatchPoint> points;
    std::vector<std::int32_t> point_number, node_number;  // of the surface
    std::vector<std::int32_t> facet_points, first_point, node_points, first_facet_of_node, node_facets;
    std::vector<float> node_curls;
    Sphere sphere;
    double size_m = 0.0;  // of its largest facet
  };
  struct Rows;
  PatchData make_patch(std::size_t first, std::size_t last) const;
  TestBlock make_block(std::size_t first) const;
  std::vector<float> make_sources(const PatchData& patch, std::span<const std::int32_t> sides, std::size_t padded) const;
  void add_sparse(double k, double coupling, std::span<const std::int32_t> sides, LinearSystem& system) const;

  const RadiatingSurface& surface_;
  std::vector<float> velocity_;
  std::size_t count_ = 0;
  Sphere sphere_;
  StaticPart static_;
  std::vector<double> mass_;  // (N) lumped
  std::vector<PatchData> patches_;
  CalcTile calc_tile_ = calc_tile_plain;
};

/// 1 / max(k, 1 / R): the size of alpha.
double calc_coupling(double k, double radius_m);

}  // namespace carillon::air
