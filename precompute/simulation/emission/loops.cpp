#include "precompute/simulation/emission/loops.hpp"

#include "runtime/base/instructions.hpp"

namespace carillon::emission {

const RowLoops& find_loops() {
#if defined(__x86_64__)
  if (base::has_instructions(base::Instructions::kAvx512)) return kLoopsAvx512;
  if (base::has_instructions(base::Instructions::kAvx2)) return kLoopsAvx2;
#endif
  return kLoopsPlain;
}

}  // namespace carillon::emission
