// Input and output of a solve of K phi = lambda M phi.
#pragma once

#include <petscmat.h>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/eigen/checkpoint.hpp"
#include "precompute/la/pencil.hpp"
#include "precompute/petsc/handle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::ldlt {
class MeshOrder;
}  // namespace carillon::ldlt

namespace carillon::eigen {

/// Positions of the free nodes, needed for the rigid modes.
struct NodeLayout {
  std::vector<Vec3> nodes_m;            // (owned free nodes) [m], in the order of the owned row blocks of K
  std::vector<std::int32_t> component;  // (owned free nodes), 0 <= component < component_count
  std::int32_t component_count = 1;     // connected components of the mesh, the same on every rank
  /// Per component the positions of its fixed (Dirichlet) nodes [m], the same on every rank. Empty: no node is fixed. Components with all
  /// nodes fixed have no rows in K and may be listed.
  std::vector<std::vector<Vec3>> fixed;
  /// Elimination order for our L D L^T, used to distribute the mesh if balanced enough; null: L D L^T computes its own order.
  std::shared_ptr<const ldlt::MeshOrder> order;
  /// Fill-reducing order of MUMPS, used on rank 0 only: elimination position of every free node in the global numbering of the row blocks
  /// of K (partition::order_nested_dissection). Empty: MUMPS orders by itself, with more fill.
  std::vector<std::int32_t> elimination_position;
};

/// K phi = lambda M phi. Rows come in blocks of three (x, y, z) per free node; K and M have the same row distribution, whole nodes per
/// rank.
struct Problem {
  Mat stiffness = nullptr;  // K [N/m], (3n, 3n), AIJ, symmetric positive semidefinite, both triangles stored
  Mat mass = nullptr;       // M [kg], (3n, 3n), AIJ, symmetric positive definite, diagonal or in K's pattern
  NodeLayout nodes;
};

enum class Factorisation {
  kAutomatic,  // our L D L^T, and MUMPS if that is unstable
  kLdlt,
  kMumps,
};

/// Eigensolver. Block Lanczos and Krylov-Schur (SLEPc) solve the band in slices.
enum class Method {
  kAutomatic,  // dense for some hundred unknowns, otherwise block Lanczos
  kBlockLanczos,
  kKrylovSchur,
  kDense,  // LAPACK, all eigenvalues; up to kMaxDenseUnknowns
};

/// Larger dense solves would take hours and store the full matrices on every rank.
inline constexpr std::int64_t kMaxDenseUnknowns = 8000;

enum class Phase { kRigid, kAnalyse, kCount, kFactor, kIterate, kCheck };

/// Progress of a solve; reported on rank 0 only.
struct Progress {
  Phase phase = Phase::kRigid;
  std::int64_t modes_done = 0;
  std::int64_t modes_wanted = 0;    // 0 until the band has been counted
  double factor_flops = 0;          // of one factorisation; 0 if unknown or none was made
  std::int64_t factor_entries = 0;  // the same
  std::int64_t factorisations = 0;  // made so far
  std::int64_t solves = 0;          // right-hand sides so far
};

struct Modes;

struct Options {
  double low_hz = 20;  // both ends are inclusive
  double high_hz = 20e3;
  std::optional<std::int64_t> max_modes;  // only the lowest modes of the band
  double expected_hz = 0;   // guess of the last of max_modes modes; 0: none. A good one saves counts; the modes do not depend on it
  double tolerance = 1e-8;  // bound on the relative residual of every mode; see Modes::residual
  Factorisation factorisation = Factorisation::kAutomatic;
  Method method = Method::kAutomatic;
  /// Memory limit of all ranks of a host together [byte]; 0: limits of the machine, its cgroup and the process.
  std::int64_t memory_limit_bytes = 0;
  /// Frequency range [Hz] in which our L D L^T rejects every shift, as if a pivot vanished. For tests and benchmarks of the fallback to
  /// MUMPS: where a pivot really vanishes depends on rounding. Empty: none.
  std::optional<std::array<double, 2>> refused_shifts_hz;
  /// All modes of a narrower band of the same problem, with shapes: they are kept, and the modes around them are searched. Null: none.
  const Modes* known = nullptr;
  int max_steps = 0;                              // blocks of a Krylov run; 0: by the size of its basis. For tests of missing modes
  std::function<void(const Progress&)> progress;  // may be empty
  Checkpoint* checkpoint = nullptr;               // may be null
};

/// Seconds of the stages (wall clock, slowest rank), without sub-stages.
struct Seconds {
  double rigid = 0;
  double analyse = 0;  // elimination order and symbolic factorisation
  double factor = 0;   // all numeric factorisations, including those of counts
  double iterate = 0;  // block Lanczos or Krylov-Schur, including solves and orthogonalisation
  double solve = 0;    // triangular solves, part of iterate
  double check = 0;    // residuals, orthonormality, signs
  double total = 0;
};

struct FactorStatistics {
  std::string solver;        // "carillon L D L^T", "MUMPS 5.5.1 L D L^T", "LAPACK dsygvd (dense)"
  std::string ordering;      // "METIS nested dissection (given)", "PORD", ...
  std::int64_t entries = 0;  // stored entries of the factor, all ranks; 0 if unknown
  double flops = 0;          // of one numeric factorisation; 0 if unknown
  std::int64_t factorisations = 0;
  std::int64_t solves = 0;  // right-hand sides
};

/// Eigenvalues below a frequency, by the signs of the pivots of K - lambda M = L D L^T (or from all eigenvalues, see Proof::method).
struct Count {
  double freq_hz = 0;
  std::int64_t below = 0;
  double margin = 0;  // |lambda - nearest mode found| / lambda: distance of the count from an eigenvalue
};

/// Degenerate modes: their lambda agree to 1e-12, or to rounding. Their shapes are a canonical basis of their span.
struct Cluster {
  std::int64_t first = 0;  // index into Modes::lambda
  std::int64_t count = 0;
};

/// Proof of completeness: between neighbouring counts, the number of modes found equals the difference of the counts.
struct Proof {
  /// Ascending in frequency: both ends of the band, every cut and every shift. The lower end may follow from the first shift (see
  /// `method`).
  std::vector<Count> counts;
  std::vector<std::int64_t> rigid_per_component;  // (components) rigid modes of each, included in the count below the band
  std::int64_t found = 0;                         // modes found; fewer than between the first and last count only with max_modes
  std::string method;                             // description of the counts
  double factor_backward_error = 0;               // largest relative residual of a solve with the factors; 0 if not measured
  std::vector<Cluster> clusters;                  // ascending; single modes are not listed
};

struct Modes {
  std::vector<double> lambda;  // (modes) eigenvalues omega^2 [(rad/s)^2], ascending
  /// (modes) ||K phi - lambda M phi||_2 / (lambda ||M phi||_2), from K and M after the solve. A mode above the tolerance is refined once;
  /// it is then accepted within the tolerance or within 10 epsilon ||diag(K) phi||_2 / (lambda ||M phi||_2), the possible rounding of K phi
  /// (low modes of thin bodies); otherwise it is refined again, and the solve fails if that does not help. A mode accepted above the
  /// tolerance is also measured through the inverse (bound_error_by_inverse_residual), and the smaller value is stored.
  std::vector<double> residual;
  std::int64_t above_tolerance_count = 0;  // modes accepted above the tolerance because of rounding
  /// (3n, modes) dense, with the row distribution of K; column j is phi_j [kg^-1/2], phi^T M phi = 1. The entry of largest magnitude is
  /// positive (of several equal ones, that of the first node by x, y, z). Null without modes.
  petsc::MatHandle shapes;
  double orthonormality_error = 0;  // max |phi_i^T M phi_j - delta_ij|

  std::int64_t rigid_count = 0;      // dimension of the rigid subspace, all components; deflated, not in lambda
  std::int64_t count_below_low = 0;  // eigenvalues below the band: rigid modes, mechanisms and modes below low_hz
  std::int64_t band_count = 0;       // modes in the band by inertia; more than lambda.size() only with max_modes
  /// Part of count_below_low: not rigid, and zero within rounding (parts connected at a point or an edge). 0 if rounding is so near the
  /// band that slow modes cannot be distinguished.
  std::int64_t mechanism_count = 0;
  Proof proof;
  FactorStatistics factor;
  Seconds seconds;
};

}  // namespace carillon::eigen
