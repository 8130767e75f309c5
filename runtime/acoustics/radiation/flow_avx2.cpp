#include "runtime/acoustics/radiation/flow.inl"

namespace carillon::radiation {

void add_flow_avx2(const float* through, const float* harmonic, std::size_t rows, double* flow) {
  add_flow<8, 6, 2>(through, harmonic, rows, flow);
}

}  // namespace carillon::radiation
