#include "runtime/codec/loops.inl"

namespace carillon::codec {

const Loops kLoopsAvx2 = Kernels<8>::kAll;

}  // namespace carillon::codec
