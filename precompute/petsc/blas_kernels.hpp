// Which of its kernels OpenBLAS runs. Inner header.
#pragma once

#include <string>

namespace carillon::petsc {

/// ", kernels SkylakeX, OpenBLAS's own choice": the kernels and why these; empty when the BLAS is not OpenBLAS. Local.
std::string describe_kernels();

/// What to say of kernels that use none of the processor's newer vector instructions (AVX2 on): two to eight times slower in what BLAS
/// does, with the correction; empty when there is nothing to say. AVX2 in place of AVX-512 is no matter: the factorisation has kernels of
/// its own. Local.
std::string describe_slow_kernels();

}  // namespace carillon::petsc
