#include "runtime/acoustics/head/convolve.inl"

namespace carillon::head {

const Loops kAvx2Loops{convolve<8, 4>, convolve_pair<8, 2>, blend};

}  // namespace carillon::head
