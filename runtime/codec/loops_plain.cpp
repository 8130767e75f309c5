#define CARILLON_LANES 4
#include "runtime/codec/loops.inl"

namespace carillon::codec {

const Loops kLoopsPlain = Kernels::kAll;

}  // namespace carillon::codec
