#include "runtime/acoustics/head/convolve.inl"

namespace carillon::head {

const Loops kAvx512Loops{convolve<16, 2>, convolve_pair<16, 2>, blend};

}  // namespace carillon::head
