#include "runtime/impact/dense.inl"

namespace carillon::impact::dense {

const Functions kPlain{add_columns, factorise, substitute};

const Functions& get_functions() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return kAvx2;
#endif
  return kPlain;
}

}  // namespace carillon::impact::dense
