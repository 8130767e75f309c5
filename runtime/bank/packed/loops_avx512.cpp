#define CARILLON_LANES 16
#include "runtime/bank/packed/loops.inl"

namespace carillon::packed {

const Loops kLoopsAvx512 = Kernels::kAll;

}  // namespace carillon::packed
