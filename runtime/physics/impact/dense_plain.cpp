#include "runtime/base/instructions.hpp"
#include "runtime/physics/impact/dense.inl"

namespace carillon::impact::dense {

const Functions kPlain{add_columns, factorise, substitute};

const Functions& get_functions() {
#if defined(__x86_64__)
  if (base::has_instructions(base::Instructions::kAvx2)) return kAvx2;
#endif
  return kPlain;
}

}  // namespace carillon::impact::dense
