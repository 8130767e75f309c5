#include "runtime/acoustics/head/convolve.hpp"

#include "runtime/base/instructions.hpp"

namespace carillon::head {

const Loops& get_loops() noexcept {
#if defined(__x86_64__)
  switch (base::find_instructions()) {
    case base::Instructions::kAvx512:
      return kAvx512Loops;
    case base::Instructions::kAvx2:
      return kAvx2Loops;
    default:
      break;
  }
#endif
  return kPlainLoops;
}

}  // namespace carillon::head
