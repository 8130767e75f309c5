#include "runtime/codec/loops.inl"

namespace carillon::codec {

const Loops kLoopsPlain = Kernels<4>::kAll;

}  // namespace carillon::codec
