#include "runtime/base/instructions.hpp"
#include "runtime/physics/rigid/sweeps.inl"

namespace carillon::rigid::sweeps {

const Functions kPlain{prepare, sweep, add, begin, share};

const Functions& get_functions() {
#if defined(__x86_64__)
  if (base::has_instructions(base::Instructions::kAvx2)) return kAvx2;
#endif
  return kPlain;
}

}  // namespace carillon::rigid::sweeps
