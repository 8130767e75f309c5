#include "runtime/synth/nonlinear/kernels.inl"

namespace carillon::nonlinear {

const CoupledKernels kPlainKernels = make_kernels<4, 8>();

}  // namespace carillon::nonlinear
