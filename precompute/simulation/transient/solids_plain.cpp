#include "precompute/simulation/transient/kernel.hpp"

namespace carillon::transient {
namespace {
constexpr int kLanes = 2;
#include "precompute/simulation/transient/kernel.inl"
}  // namespace

const Loops& get_loops_plain() { return kLoops; }

}  // namespace carillon::transient
