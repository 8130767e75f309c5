#define CARILLON_LANES 4
#include "runtime/bank/packed/loops.inl"

namespace carillon::packed {

const Loops kLoopsPlain = Kernels::kAll;

}  // namespace carillon::packed
