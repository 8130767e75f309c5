#define CARILLON_ISA avx512
#define CARILLON_ISA_NAME "AVX-512"
#include "precompute/fem/error_bars/kernels_body.inl"
