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

namespace {

const Kernels* chosen = nullptr;

}  // namespace

std::vector<const Kernels*> list_kernels() {
  std::vector<const Kernels*> tables;
#ifdef CARILLON_LDLT_X86
  if (__builtin_cpu_supports("avx512f")) tables.push_back(&avx512::kTable);
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) tables.push_back(&avx2::kTable);
#endif
  tables.push_back(&plain::kTable);
  return tables;
}

const Kernels& get_kernels() {
  static const Kernels& fastest = *list_kernels().front();
  return chosen != nullptr ? *chosen : fastest;
}

void set_kernels(const Kernels* kernels) { chosen = kernels; }

}  // namespace carillon::ldlt
