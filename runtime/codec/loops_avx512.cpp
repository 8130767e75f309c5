#define CARILLON_LANES 16
#include "runtime/codec/loops.inl"

namespace carillon::codec {

const Loops kLoopsAvx512 = Kernels::kAll;

}  // namespace carillon::codec
