// What a solve of K phi = lambda M phi is asked and what it answers.
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

/// Where the free nodes of the system are: what the rigid modes need beyond K and M.
struct NodeLayout {
  std::vector<Vec3> nodes_m;            // (owned free nodes) [m], in the order of the owned row blocks of K
  std::vector<std::int32_t> component;  // (owned free nodes), 0 <= component < component_count
  std::int32_t component_count = 1;     // connected components of the mesh, the same on every rank
  /// Per component the positions of its fixed (Dirichlet) nodes [m], the same on every rank. Empty: no node is fixed anywhere. Components
  /// whose every node is fixed have no row in K and may stand in the list.
  std::vector<std::vector<Vec3>> fixed;
  /// The order for our L D L^T, by which the mesh is cut where that is even enough; null: L D L^T orders by itself.
  std::shared_ptr<const ldlt::MeshOrder> order;
  /// Fill-reducing order of MUMPS and CHOLMOD, used on rank 0 only: elimination position of every free node in the global numbering of K's
  /// row blocks (partition::order_nested_dissection). Empty: the factorisation orders by itself, with more fill.
  std::vector<std::int32_t> elimination_position;
};

/// K phi = lambda M phi. Rows come in blocks of three (x, y, z) per free node; K and M have the same row distribution, whole nodes on a
/// rank.
struct Problem {
  Mat stiffness = nullptr;  // K [N/m], (3n, 3n), AIJ, symmetric positive semidefinite, both triangles stored
  Mat mass = nullptr;       // M [kg], (3n, 3n), AIJ, symmetric positive definite, diagonal or in K's pattern
  NodeLayout nodes;
};

enum class Factorisation {
  kAutomatic,  // L D L^T of our own, and MUMPS where that turns out unstable
  kLdlt,
  kMumps,
  kCholmod,  // one rank only; shifts below the spectrum
};

/// The eigensolver. Block Lanczos and Krylov-Schur are SLEPc EPS types, which solve slice by slice and take its options (-eps_..., without
/// prefix); the dense solver takes none.
enum class Method {
  kAutomatic,  // dense for some hundred unknowns, else block Lanczos
  kBlockLanczos,
  kKrylovSchur,
  kDense,  // LAPACK, all eigenvalues; up to kMaxDenseUnknowns
};

/// A dense solve of more would take hours and the matrices' square on every rank.
inline constexpr std::int64_t kMaxDenseUnknowns = 8000;

enum class Phase { kRigid, kAnalyse, kCount, kFactor, kIterate, kCheck };

/// How far the solve is; sent on rank 0 only.
struct Progress {
  Phase phase = Phase::kRigid;
  std::int64_t modes_done = 0;
  std::int64_t modes_wanted = 0;    // 0 until the band has been counted
  double factor_flops = 0;          // of one factorisation; 0 until one was made, or unknown
  std::int64_t factor_entries = 0;  // the same
  std::int64_t factorisations = 0;  // made so far
  std::int64_t solves = 0;          // right-hand sides so far
};

struct Options {
  double low_hz = 20;  // both ends belong to the band
  double high_hz = 20e3;
  std::optional<std::int64_t> max_modes;  // the lowest so many of the band
  double tolerance = 1e-8;                // bound on every mode's relative residual; see Modes::residual
  Factorisation factorisation = Factorisation::kAutomatic;
  Method method = Method::kAutomatic;
  /// What the ranks of one host may use together [byte]; 0: what the machine, its cgroup and the process limits leave.
  std::int64_t memory_limit_bytes = 0;
  /// Frequencies [Hz] between which our L D L^T refuses every shift, as if a pivot vanished there. For tests and benches of the way over
  /// MUMPS: where a pivot really vanishes depends on the rounding of the processor. Empty: nowhere.
  std::optional<std::array<double, 2>> refused_shifts_hz;
  std::function<void(const Progress&)> progress;  // may be empty
  Checkpoint* checkpoint = nullptr;               // may be null
};

/// Own seconds of the stages (wall clock, the slowest rank).
struct Seconds {
  double rigid = 0;
  double analyse = 0;  // elimination order and symbolic factorisation
  double factor = 0;   // every numeric factorisation, those of the counts included
  double iterate = 0;  // block Lanczos (or Krylov-Schur), solves and orthogonalisation included
  double solve = 0;    // of iterate: triangular solves
  double check = 0;    // residuals, orthonormality, signs
  double total = 0;
};

struct FactorStatistics {
  std::string solver;        // "carillon L D L^T", "MUMPS 5.5.1 L D L^T", "CHOLMOD L L^T", "LAPACK dsygvd (dense)"
  std::string ordering;      // "METIS nested dissection (given)", "PORD", ...
  std::int64_t entries = 0;  // stored entries of the factor, all ranks; 0 if unknown
  double flops = 0;          // of one numeric factorisation; 0 if unknown
  std::int64_t factorisations = 0;
  std::int64_t solves = 0;  // right-hand sides
};

/// Eigenvalues below a frequency, by the signs of the pivots of K - lambda M = L D L^T (or of all eigenvalues at once, see Proof::method).
struct Count {
  double freq_hz = 0;
  std::int64_t below = 0;
  double margin = 0;  // |lambda - nearest mode found| / lambda: how far from an eigenvalue the count was taken
};

/// Degenerate modes: their lambda agree to 1e-12, or to rounding. Their shapes are a canonical basis of what they span.
struct Cluster {
  std::int64_t first = 0;  // index into Modes::lambda
  std::int64_t count = 0;
};

/// Why no mode of the band is missing: between any two neighbouring counts as many modes were found as the counts differ by.
struct Proof {
  /// Ascending in frequency: both ends of the band, every cut and every shift. The lower end may follow from the first shift (`method` says
  /// so).
  std::vector<Count> counts;
  std::vector<std::int64_t> rigid_per_component;  // (components) rigid modes of each, in the count below the band
  std::int64_t found = 0;            // modes found; fewer than lie between the first count and the last only if max_modes cut the search
  std::string method;                // how the counts were taken, in words
  double factor_backward_error = 0;  // largest relative residual of a solve with the factors; 0 if not measured
  std::vector<Cluster> clusters;     // ascending; single modes are not listed
};

struct Modes {
  std::vector<double> lambda;  // (modes) eigenvalues omega^2 [(rad/s)^2], ascending
  /// (modes) ||K phi - lambda M phi||_2 / (lambda ||M phi||_2), calculated from K and M after the solve. A mode above the tolerance is
  /// refined once; it is then accepted within the tolerance or within 10 epsilon ||diag(K) phi||_2 / (lambda ||M phi||_2), which the
  /// rounding of K phi alone may come to (low modes of thin bodies); beyond both it is refined again, and the solve fails if that does not
  /// help. Accepted above the tolerance, it is measured through the inverse as well (bound_error_by_inverse_residual), and the less of the
  /// two stands here.
  std::vector<double> residual;
  std::int64_t above_tolerance_count = 0;  // modes accepted above the tolerance, because rounding explains their residual
  /// (3n, modes) dense, the row distribution of K; column j is phi_j [kg^-1/2], phi^T M phi = 1. The entry of largest magnitude is positive
  /// (of several as large, the one whose node comes first by x, y, z). Null when there are no modes.
  petsc::MatHandle shapes;
  double orthonormality_error = 0;  // max |phi_i^T M phi_j - delta_ij|

  std::int64_t rigid_count = 0;      // dimension of the rigid subspace, all components; deflated, not in lambda
  std::int64_t count_below_low = 0;  // eigenvalues below the band: rigid modes, mechanisms and modes below low_hz
  std::int64_t band_count = 0;       // modes the band holds, by inertia; more than lambda.size() only if max_modes cut it
  /// Of count_below_low: not rigid, and zero to within rounding (parts that hang on a point or an edge). None where rounding
  /// reaches so near the band that slow modes pass for such.
  std::int64_t mechanism_count = 0;
  Proof proof;
  FactorStatistics factor;
  Seconds seconds;
};

}  // namespace carillon::eigen
