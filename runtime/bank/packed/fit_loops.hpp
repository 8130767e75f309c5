// Inner loops of the shape encoder, selected by instruction set at run time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "runtime/bank/packed/stencil.hpp"
#include "runtime/base/instructions.hpp"

namespace carillon::packed {

inline constexpr std::size_t kGradientFields = 9, kFields = kGradientFields + 3 * kNeighbours;

/// Kriging residual of a vertex and its candidate predictors; a column has a number per mode.
class Columns {
 public:
  // Left: component c at c. Gradient along axis j of component c at kGradient + 3 c + j; difference of neighbour k at kDifferences +
  // kNeighbours c + k. Columns from kUsed are 0.
  static constexpr std::size_t kGradient = 3, kDifferences = kGradient + kGradientFields, kUsed = kDifferences + 3 * kNeighbours;
  static constexpr std::size_t kCount = (kUsed + 3) / 4 * 4;

  explicit Columns(std::size_t padded) : padded_(padded), values_(kCount * padded + kLine) {
    // As Rows: vectors across two cache lines take twice the time.
    first_ = (kLine - reinterpret_cast<std::uintptr_t>(values_.data()) / sizeof(float) % kLine) % kLine;
  }
  Columns(const Columns&) = delete;  // a copy would not be aligned
  Columns& operator=(const Columns&) = delete;
  std::size_t get_padded() const { return padded_; }
  float* get(std::size_t column) { return values_.data() + first_ + column * padded_; }
  const float* get(std::size_t column) const { return values_.data() + first_ + column * padded_; }

 private:
  static constexpr std::size_t kLine = 16;  // numbers per cache line
  std::size_t padded_, first_ = 0;
  std::vector<float> values_;
};

/// Inner products of columns, row-major; at and below the diagonal.
using Products = std::array<float, Columns::kCount * Columns::kCount>;

/// Model of the bits and the error of a vertex's residual [steps].
struct ResidualCost {
  float step = 1.0F, rounding = 0.5F;        // step of the residual; numbers are floor(|x| + rounding)
  float bits_of_0 = 0.0F, bits_of_1 = 0.0F;  // of a number q: bits_of_0, or bits_of_1 + 2 log2 |q|
  float per_error = 0.0F;                    // weight of the squared error
};

struct FitLoops {
  /// Fills the columns of a vertex from the rows of its neighbours and its own.
  void (*calc_columns)(const float* const* rows, const float* wanted, const Stencil& stencil, Columns& columns);
  /// Inner products of the columns [begin, end), multiples of 4, with all columns up to their own.
  void (*calc_products)(const Columns& columns, std::size_t begin, std::size_t end, Products& products);
  /// Cost of the residual after the first `fields` fields with coefficients (fields, 3). Piecewise linear log2: error below 0.09.
  float (*calc_cost)(const Columns& columns, const float* coefficients, std::size_t fields, const ResidualCost& model);
};

/// Loops of the best supported instruction set up to `best`.
const FitLoops& find_fit_loops(base::Instructions best = base::Instructions::kBest);

}  // namespace carillon::packed
