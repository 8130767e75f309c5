// Which inner loops run: decided once, by what the processor says of itself.
#include "precompute/ldlt/kernels.hpp"

namespace carillon::ldlt {

#ifdef CARILLON_LDLT_X86
namespace avx512 {
extern const Kernels kTable;
}
namespace avx2 {
extern const Kernels kTable;
}
#endif
namespace plain {
extern const Kernels kTable;
}

const Kernels& get_kernels() {
#ifdef CARILLON_LDLT_X86
  if (__builtin_cpu_supports("avx512f")) return avx512::kTable;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return avx2::kTable;
#endif
  return plain::kTable;
}

}  // namespace carillon::ldlt
