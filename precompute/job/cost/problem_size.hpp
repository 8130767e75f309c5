// Problem size, the input of all predictions.
#pragma once

#include <cstdint>
#include <optional>

#include "precompute/job/job_spec.hpp"

namespace carillon::cost {

inline constexpr std::int64_t kAirNodes = job::kSkinNodes;

/// Known properties of a run. Zero and empty values are unknown; complete() estimates them.
struct ProblemSize {
  std::int64_t nodes = 0;  // of the solved elements, including mid-side nodes
  std::int64_t tets = 0;
  std::int64_t unknowns = 0;
  std::int64_t surface_nodes = 0;
  std::int64_t air_nodes = 0;  // of the surface for the air solve; 0: none
  int coupled_modes = 0;       // modes with quartic energy; 0: none
  bool is_quadratic = true;
  bool is_thin = false;         // slenderness above kVerySlender: low modes are refined by one more solve
  bool is_dense = false;        // LAPACK, at any size
  bool is_read_by_all = false;  // every rank reads the mesh file
  bool counts_low_end = true;   // by an extra factorisation; false: the first shift also counts there
  double read_seconds = 0;      // reading or meshing, measured or predicted
  double factor_flops = 0;      // of one factorisation
  std::int64_t factor_entries = 0;
  std::optional<std::int64_t> modes;  // in the band, or max_modes; 0: empty band
  std::int64_t rigid_modes = 6;
};

/// A mesh file of this size, each tetrahedron refined into 8^refinements.
ProblemSize estimate_file_size(std::int64_t bytes, bool is_quadratic, int refinements = 0);

/// A body to be meshed with this many nodes.
ProblemSize estimate_meshed_size(std::int64_t nodes, bool is_quadratic);

/// Estimates unknown values. Entries and operations of the factor follow powers of the unknowns: within a factor of two for thin walls, of
/// ten for solid bodies of a million.
ProblemSize complete(ProblemSize size);

/// The same body and band on a mesh with `growth` times as many nodes.
ProblemSize refine(const ProblemSize& size, double growth);

/// The same mesh with ten nodes per tetrahedron instead of four.
ProblemSize make_quadratic(const ProblemSize& size);

/// For this many modes: slices of the spectrum, their total right-hand sides, and factorisations including those for counts.
std::int64_t count_slices(std::int64_t modes);
std::int64_t predict_solves(std::int64_t modes);
std::int64_t predict_factorisations(std::int64_t modes, bool counts_low_end = true);

}  // namespace carillon::cost
