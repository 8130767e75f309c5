#define CARILLON_ISA avx2
#define CARILLON_ISA_NAME "AVX2"
namespace carillon::ldlt::avx2 {
inline constexpr int kRows = 6;
inline constexpr int kVectors = 1;
}  // namespace carillon::ldlt::avx2
#include "precompute/ldlt/kernels_body.inl"
