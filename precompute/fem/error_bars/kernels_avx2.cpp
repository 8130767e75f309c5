#define CARILLON_ISA avx2
#define CARILLON_ISA_NAME "AVX2"
#include "precompute/fem/error_bars/kernels_body.inl"
