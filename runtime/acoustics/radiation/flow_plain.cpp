#include "runtime/acoustics/radiation/flow.inl"

namespace carillon::radiation {

void add_flow_plain(const float* through, const float* harmonic, std::size_t rows, double* flow) {
  add_flow<4, 4, 3>(through, harmonic, rows, flow);
}

}  // namespace carillon::radiation
