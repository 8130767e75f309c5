#define CARILLON_ISA plain
#define CARILLON_ISA_NAME "plain"
#include "precompute/fem/error_bars/kernels_body.inl"
