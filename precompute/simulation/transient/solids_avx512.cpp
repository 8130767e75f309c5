#include "precompute/simulation/transient/kernel.hpp"

namespace carillon::transient {
namespace {
constexpr int kLanes = 8;
#include "precompute/simulation/transient/kernel.inl"
}  // namespace

const Loops& get_loops_avx512() { return kLoops; }

}  // namespace carillon::transient
