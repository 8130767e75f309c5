// Kernel dispatch by processor features.
#include "precompute/fem/error_bars/kernels.hpp"

#include "runtime/base/instructions.hpp"

namespace carillon::error_bars {

#ifdef CARILLON_ESTIMATE_X86
namespace avx512 {
extern const ElementKernels kT4, kT10;
}
namespace avx2 {
extern const ElementKernels kT4, kT10;
}
#endif
namespace plain {
extern const ElementKernels kT4, kT10;
}

std::vector<const ElementKernels*> list_kernels(int nodes) {
  std::vector<const ElementKernels*> tables;
#ifdef CARILLON_ESTIMATE_X86
  if (base::has_instructions(base::Instructions::kAvx512)) tables.push_back(nodes == 4 ? &avx512::kT4 : &avx512::kT10);
  if (base::has_instructions(base::Instructions::kAvx2)) tables.push_back(nodes == 4 ? &avx2::kT4 : &avx2::kT10);
#endif
  tables.push_back(nodes == 4 ? &plain::kT4 : &plain::kT10);
  return tables;
}

}  // namespace carillon::error_bars
