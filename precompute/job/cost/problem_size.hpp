// The size of a problem: what every prediction begins with.
#pragma once

#include <cstdint>
#include <optional>

#include "precompute/job/job_spec.hpp"

namespace carillon::cost {

inline constexpr std::int64_t kAirNodes = job::kSkinNodes;

/// What is known of a run. Zeros and empty ones are unknown; complete() estimates them from the rest.
struct ProblemSize {
  std::int64_t nodes = 0;  // of the elements that are solved, mid-side nodes included
  std::int64_t tets = 0;
  std::int64_t unknowns = 0;
  std::int64_t surface_nodes = 0;
  std::int64_t air_nodes = 0;  // of the surface outside which the air is solved; 0: it is not
  int coupled_modes = 0;       // whose quartic energy is condensed; 0: none
  bool is_quadratic = true;
  bool is_thin = false;         // slenderness above kVerySlender: low modes are refined by another solve
  bool is_dense = false;        // solved by LAPACK, whatever its size
  bool is_read_by_all = false;  // the mesh file is read by all ranks
  bool counts_low_end = true;   // by a factorisation of its own; false: the first shift counts there, too
  double read_seconds = 0;      // reading or meshing, measured or predicted
  double factor_flops = 0;      // of one factorisation
  std::int64_t factor_entries = 0;
  std::optional<std::int64_t> modes;  // of the band, or max_modes; 0: the band is empty
  std::int64_t rigid_modes = 6;
};

/// A mesh file of so many bytes, each tetrahedron refined into 8^refinements.
ProblemSize estimate_file_size(std::int64_t bytes, bool is_quadratic, int refinements = 0);

/// A body that will be meshed with so many nodes.
ProblemSize estimate_meshed_size(std::int64_t nodes, bool is_quadratic);

/// Estimates what is unknown. Entries and operations of the factor follow powers of the unknowns: to a factor of two for thin walls, of ten
/// for thick bodies of a million.
ProblemSize complete(ProblemSize size);

/// The same body and band on a mesh with `growth` times as many nodes.
ProblemSize refine(const ProblemSize& size, double growth);

/// The same mesh with ten nodes per tetrahedron instead of four.
ProblemSize make_quadratic(const ProblemSize& size);

/// Slices of the spectrum, right-hand sides of all of them, and factorisations with those of the counts, for so many modes.
std::int64_t count_slices(std::int64_t modes);
std::int64_t predict_solves(std::int64_t modes);
std::int64_t predict_factorisations(std::int64_t modes, bool counts_low_end = true);

}  // namespace carillon::cost
