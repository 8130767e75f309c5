#define CARILLON_ISA plain
#define CARILLON_ISA_NAME "plain"
#include "precompute/estimate/kernels_body.inl"
