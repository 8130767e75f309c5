#include "precompute/emission/loops.hpp"

namespace carillon::emission {
namespace {
#include "precompute/emission/loops.inl"
}  // namespace

const RowLoops kLoopsAvx512{add_places, add_rows, calc_derivatives, sum_frames, scatter};

}  // namespace carillon::emission
