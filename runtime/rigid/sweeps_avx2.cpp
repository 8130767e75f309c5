#include "runtime/rigid/sweeps.inl"

namespace carillon::rigid::sweeps {

const Functions kAvx2{sweep, add, begin, share};

}  // namespace carillon::rigid::sweeps
