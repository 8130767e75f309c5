// How fast this processor eliminates, before anything is factorised.
#pragma once

namespace carillon::ldlt {

/// Operations a second of the update behind a panel (kernels.hpp), which is most of a factorisation; a multiplication and an addition are
/// two. By CPU time, the best of some runs on a front of its own; takes a twentieth of a second and 12 MB. Throws std::bad_alloc.
double measure_update_rate();

}  // namespace carillon::ldlt
