#include "precompute/simulation/emission/loops.hpp"

namespace carillon::emission {
namespace {
#include "precompute/simulation/emission/loops.inl"
}  // namespace

const RowLoops kLoopsAvx2{add_places, add_value,   close_value, calc_motion, calc_flux, calc_rates,
                          sum_frames, find_facets, radiate,     scatter,     add_rows};

}  // namespace carillon::emission
