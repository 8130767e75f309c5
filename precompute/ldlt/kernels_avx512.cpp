#define CARILLON_ISA avx512
#define CARILLON_ISA_NAME "AVX-512"
namespace carillon::ldlt::avx512 {
inline constexpr int kRows = 12;
inline constexpr int kVectors = 2;
}  // namespace carillon::ldlt::avx512
#include "precompute/ldlt/kernels_body.inl"
