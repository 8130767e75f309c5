#define CARILLON_LANES 8
#include "runtime/bank/packed/loops.inl"

namespace carillon::packed {

const Loops kLoopsAvx2 = Kernels::kAll;

}  // namespace carillon::packed
