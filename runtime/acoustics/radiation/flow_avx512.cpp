#include "runtime/acoustics/radiation/flow.inl"

namespace carillon::radiation {

void add_flow_avx512(const float* through, const float* harmonic, std::size_t rows, double* flow) {
  add_flow<16, 6, 4>(through, harmonic, rows, flow);
}

}  // namespace carillon::radiation
