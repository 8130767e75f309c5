// Choice of OpenBLAS kernels for this processor.
#pragma once

#include <string>

namespace carillon::launch {

/// The variable that selects the kernels of OpenBLAS, and the one in which the launcher records the default of OpenBLAS.
inline constexpr const char* kKernelsVariable = "OPENBLAS_CORETYPE";
inline constexpr const char* kDefaultKernelsVariable = "CARILLON_DEFAULT_KERNELS";

/// Instruction sets required by kernels, oldest first.
enum class KernelAge { older, avx2, avx512 };

/// Age of the OpenBLAS kernels with this name ("SkylakeX"); unknown names are treated as newest.
KernelAge find_age(std::string kernels);

/// The oldest kernels that use all vector instructions of this processor; empty if unknown (not x86-64).
std::string find_fitting_kernels();

/// True if these kernels are for older processors than this one; false if unknown.
bool are_older_than_processor(const std::string& kernels);

}  // namespace carillon::launch
