#define CARILLON_LANES 8
#include "runtime/codec/loops.inl"

namespace carillon::codec {

const Loops kLoopsAvx2 = Kernels::kAll;

}  // namespace carillon::codec
