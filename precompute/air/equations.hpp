// Boundary element equations of the air outside a surface.
#pragma once

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

/// Rows of one block of the preconditioner; ranks own whole blocks.
inline constexpr std::size_t kBlockRows = 128;

/// Rows first .. last - 1 of the equations at one wave number, with N unknowns and several right-hand sides. Rows are divided by half their
/// lumped mass, so the matrix is close to the identity for a large smooth body; first and last are multiples of kBlockRows.
struct LinearSystem {
  std::size_t unknowns = 0, first = 0, last = 0, sides = 0;
  std::vector<std::complex<float>> matrix;  // (last - first, N)
  std::vector<std::complex<float>> right;   // (last - first, sides)

  std::size_t count_rows() const { return last - first; }
  /// Rows of A x.
  void multiply(const Sides& x, Sides& y) const;
};

/// Solves a complete system by LU with one step of iterative refinement; used where GMRES fails, at resonances of open cavities. Returns
/// the largest relative residual.
double solve_directly(const LinearSystem& system, Sides& solution);

/// Inverses of the diagonal blocks of kBlockRows rows. Nodes of a block are neighbours, so the blocks hold most of the hypersingular part.
/// A singular block counts as the identity.
class BlockInverse {
 public:
  explicit BlockInverse(const LinearSystem& system);
  /// Applies it to the rows of the system.
  void apply(Sides& rows) const;

 private:
  std::vector<std::vector<std::complex<float>>> blocks_;
};

/// Galerkin form of the Burton-Miller equation for outgoing sound of a closed surface, e^{-i omega t}:
///   [ 1/2 - K - alpha W ] p = - [ V + alpha (1/2 + K') ] q,      alpha = i / max(k, 1 / R),      q = dp / dn,
/// p linear and continuous, q linear on each facet, W by parts (equation E10 in docs/equations.md). Unique at every wave number; with the
/// other sign of alpha GMRES diverges, without it the solution is not unique. n velocities.
class BoundaryEquations {
 public:
  /// `velocity`: (T, 3, n) normal velocities at the corners of the facets of `surface`; `sphere` encloses it. The surface must outlive
  /// this.
  BoundaryEquations(const RadiatingSurface& surface, const Sphere& sphere, std::vector<float> velocity, std::size_t count,
                    StaticPart static_part);
  /// Computes the static part.
  BoundaryEquations(const RadiatingSurface& surface, const Sphere& sphere, const std::vector<float>& velocity, std::size_t count)
      : BoundaryEquations(surface, sphere, velocity, count, make_static_part(surface, velocity, count, 0, surface.count_nodes())) {}

  /// Rows first .. last - 1 at wave number k > 0 [1/m] with q = v of the velocities `sides`. A row has the same bits in every range.
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
};

/// 1 / max(k, 1 / R): magnitude of alpha.
double calc_coupling(double k, double radius_m);

}  // namespace carillon::air
