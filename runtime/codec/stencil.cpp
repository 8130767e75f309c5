#include "runtime/codec/stencil.hpp"

#include "runtime/base/instructions.hpp"
#include "runtime/codec/loops.hpp"

namespace carillon::codec {

const Loops& find_loops() {
#if defined(__x86_64__)
  if (base::has_instructions(base::Instructions::kAvx512)) return kLoopsAvx512;
  if (base::has_instructions(base::Instructions::kAvx2)) return kLoopsAvx2;
#endif
  return kLoopsPlain;
}

void calc_stencils(std::span<const Place> centres, std::span<const Neighbours> neighbours, std::span<const Place> places,
                   std::span<Stencil> stencils) {
  find_loops().calc_stencils(centres.data(), neighbours.data(), places.data(), centres.size(), stencils.data());
}

Matrix calc_matrix(const Stencil& stencil, std::span<const float> gradient, std::span<const float> differences) {
  // The coefficients of what the neighbours do by themselves, and what that adds to those of the value and the gradient.
  std::array<double, 9> of_value{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  std::array<double, kGradientNumbers> of_gradient;
  for (std::size_t i = 0; i < kGradientNumbers; ++i) of_gradient[i] = static_cast<double>(gradient[i]);
  const bool has_differences = !differences.empty();
  if (has_differences) {
    for (std::size_t k = 0; k < kNeighbours; ++k) {
      for (std::size_t e = 0; e < 9; ++e) {
        const auto d = static_cast<double>(differences[9 * k + e]);
        of_value[e] -= d;
        for (std::size_t j = 0; j < 3; ++j) of_gradient[9 * j + e] -= stencil.offset[k][j] * d;
      }
    }
  }
  Matrix matrix;
  for (std::size_t k = 0; k < kNeighbours; ++k) {
    for (std::size_t to = 0; to < 3; ++to) {
      for (std::size_t from = 0; from < 3; ++from) {
        const std::size_t e = 3 * to + from;
        double weight = stencil.value[k] * of_value[e];
        for (std::size_t j = 0; j < 3; ++j) weight += stencil.gradient[j][k] * of_gradient[9 * j + e];
        if (has_differences) weight += static_cast<double>(differences[9 * k + e]);
        matrix[(3 * k + from) * 3 + to] = static_cast<float>(weight);
      }
    }
  }
  return matrix;
}

}  // namespace carillon::codec
