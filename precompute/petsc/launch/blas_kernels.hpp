// Which kernels OpenBLAS should run on this processor.
#pragma once

#include <string>

namespace carillon::launch {

/// The variable that names OpenBLAS's kernels, and the one by which the launcher says what OpenBLAS alone would have taken.
inline constexpr const char* kKernelsVariable = "OPENBLAS_CORETYPE";
inline constexpr const char* kDefaultKernelsVariable = "CARILLON_DEFAULT_KERNELS";

/// Instruction sets that a set of kernels needs, the older first.
enum class KernelAge { older, avx2, avx512 };

/// Of OpenBLAS's kernels of that name ("SkylakeX"); names that are not known are newer than all that are.
KernelAge find_age(std::string kernels);

/// The oldest kernels that use all vector instructions of this processor; empty where that is not known (not x86-64).
std::string find_fitting_kernels();

/// Are these kernels for older processors than this one? False where one of the two is not known.
bool are_older_than_processor(const std::string& kernels);

}  // namespace carillon::launch
