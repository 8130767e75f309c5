#include "precompute/simulation/transient/sheets.hpp"

namespace carillon::transient {
namespace {
#include "precompute/simulation/transient/sheets.inl"
}  // namespace

void add_sheet_forces_avx512(const Sheets::Block* blocks, std::size_t count, bool is_damped, const StepWeights& weights, const Quad* x,
                             const Quad* v, Quad* f, double* lag, double* spent) {
  add_blocks(blocks, count, is_damped, weights, x, v, f, lag, spent);
}

}  // namespace carillon::transient
