#include "runtime/physics/impact/dense.inl"

namespace carillon::impact::dense {

const Functions kAvx2{add_columns, factorise, substitute};

}  // namespace carillon::impact::dense
