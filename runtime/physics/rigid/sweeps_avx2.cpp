#include "runtime/physics/rigid/sweeps.inl"

namespace carillon::rigid::sweeps {

const Functions kAvx2{prepare, sweep, add, begin, share};

}  // namespace carillon::rigid::sweeps
