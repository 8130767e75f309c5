// Factorisation speed of this processor, measured before a factorisation.
#pragma once

namespace carillon::ldlt {

/// Operations per second of the panel update (kernels.hpp), which dominates a factorisation; a multiply-add counts as two. CPU time, best
/// of several runs on a synthetic front; takes 0.05 s and 12 MB. Throws std::bad_alloc.
double measure_update_rate();

}  // namespace carillon::ldlt
