#include "precompute/air/tile.hpp"

namespace carillon::air {
namespace {
#include "precompute/air/tile.inl"
}  // namespace

void calc_tile_avx2(const TestBlock& block, const Patch& patch, const WaveNumber& wave, const TileRoom& room, float* matrix, float* right) {
  calc_tile(block, patch, wave, room, matrix, right);
}

void multiply_rows_avx2(const float* matrix, std::size_t rows, std::size_t unknowns, const float* x, std::size_t vectors, float* y) {
  multiply_rows(matrix, rows, unknowns, x, vectors, y);
}

}  // namespace carillon::air
