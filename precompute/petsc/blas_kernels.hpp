// Which of its kernels OpenBLAS runs. Inner header.
#pragma once

#include <string>

namespace carillon::petsc {

/// ", kernels SkylakeX, OpenBLAS's own choice": the kernels and why these; empty when the BLAS is not OpenBLAS. Local.
std::string describe_kernels();

}  // namespace carillon::petsc
