#include "runtime/codec/loops.inl"

namespace carillon::codec {

const Loops kLoopsAvx512 = Kernels<16>::kAll;

}  // namespace carillon::codec
