#include "runtime/synth/nonlinear/kernels.inl"

namespace carillon::nonlinear {

const CoupledKernels kAvx2Kernels = make_kernels<8, 8>();

}  // namespace carillon::nonlinear
