#include "precompute/simulation/transient/kernel.hpp"

namespace carillon::transient {
namespace {
constexpr int kLanes = 4;
#include "precompute/simulation/transient/kernel.inl"
}  // namespace

const Loops& get_loops_avx2() { return kLoops; }

}  // namespace carillon::transient
