#include "runtime/synth/nonlinear/kernels.inl"

namespace carillon::nonlinear {

const CoupledKernels kAvx512Kernels = make_kernels<16, 8>();

}  // namespace carillon::nonlinear
