// What a run costs, predicted from the size of its parts.
#pragma once

#include <cstdint>

namespace carillon::io {

/// What is known of a run. Zeros are unknown and guessed from the rest.
struct Extent {
  std::int64_t nodes = 0;  // of the elements that are solved, mid-side nodes among them
  std::int64_t tets = 0;
  std::int64_t unknowns = 0;
  std::int64_t surface_nodes = 0;
  bool is_quadratic = true;
  bool is_lumped = false;       // M is diagonal
  bool is_thin = false;         // the lowest modes need a correction: walls a hundred times as wide as thick
  bool is_read_by_all = false;  // the file is read by all ranks
  double read_seconds = 0;      // what reading or meshing took, or will
  double factor_flops = 0;      // of one factorisation
  std::int64_t factor_entries = 0;
  std::int64_t modes = 0;  // of the band, or as many as are wanted
};

/// CPU seconds of all ranks by what is done.
struct Costs {
  double read = 0;
  double partition = 0;
  double assemble = 0;
  double analyse = 0;
  double factor = 0;  // all factorisations
  double solve = 0;   // triangular solves
  double orthogonalise = 0;
  double check = 0;  // residuals, orthonormality
  double errors = 0;
  double collect = 0;
  double write = 0;

  double sum_modes() const { return analyse + factor + solve + orthogonalise + check; }
  double sum() const { return read + partition + assemble + sum_modes() + errors + collect + write; }
};

/// Right-hand sides that the iteration solves for so many modes, and factorisations with those of the counts.
std::int64_t predict_solves(std::int64_t modes);
std::int64_t count_slices(std::int64_t modes);
std::int64_t predict_factorisations(std::int64_t modes);

/// Fills the guesses into what is unknown.
Extent complete(Extent extent);

/// On the machine whose rates are in costs.cpp; another is that much faster or slower as measure_speed() says.
Costs predict_costs(const Extent& extent);

/// The same as seconds of wall clock on so many ranks with a core each: what one rank does alone, and the rest shared.
Costs calc_wall(const Costs& costs, const Extent& extent, int ranks);

/// How fast this processor is beside that one, by a kernel that takes a tenth of a second: 1 is alike, 2 twice as fast.
double measure_speed();

}  // namespace carillon::io
