// Selects the fastest kernels that the processor supports.
#include "precompute/ldlt/kernels.hpp"

#include "runtime/base/instructions.hpp"

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
  if (base::has_instructions(base::Instructions::kAvx512)) tables.push_back(&avx512::kTable);
  if (base::has_instructions(base::Instructions::kAvx2)) tables.push_back(&avx2::kTable);
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
