#define CARILLON_ISA plain
#define CARILLON_ISA_NAME "plain"
namespace carillon::ldlt::plain {
inline constexpr int kRows = 3;
inline constexpr int kVectors = 1;
}  // namespace carillon::ldlt::plain
#include "precompute/ldlt/kernels_body.inl"
