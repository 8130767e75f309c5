#include "runtime/acoustics/head/convolve.inl"

namespace carillon::head {

const Loops kPlainLoops{convolve<4, 4>, convolve_pair<4, 2>, blend};

}  // namespace carillon::head
