#include "runtime/bank/packed/fit_loops.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::packed::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
const hn::ScalableTag<float> kFloats;
const hn::ScalableTag<std::int32_t> kInts;
using Vector = hn::Vec<decltype(kFloats)>;
constexpr std::size_t kLanes = hn::MaxLanes(kFloats);

void calc_columns(const float* const* rows, const float* wanted, const Stencil& stencil, Columns& columns) {
  const std::size_t padded = columns.get_padded();
  for (std::size_t c = 0; c < 3; ++c) {
    float* const left = columns.get(c);
    float* const gradient = columns.get(Columns::kGradient + 3 * c);
    float* const difference = columns.get(Columns::kDifferences + kNeighbours * c);
    for (std::size_t i = 0; i < padded; i += kLanes) {
      Vector x[kNeighbours], value = hn::Zero(kFloats), g[3] = {value, value, value};
      for (std::size_t k = 0; k < kNeighbours; ++k) {
        x[k] = hn::LoadU(kFloats, rows[k] + c * padded + i);
        value = hn::MulAdd(hn::Set(kFloats, stencil.value[k]), x[k], value);
        for (std::size_t j = 0; j < 3; ++j) g[j] = hn::MulAdd(hn::Set(kFloats, stencil.gradient[j][k]), x[k], g[j]);
      }
      hn::StoreU(hn::LoadU(kFloats, wanted + c * padded + i) - value, kFloats, left + i);
      for (std::size_t j = 0; j < 3; ++j) hn::StoreU(g[j], kFloats, gradient + j * padded + i);
      for (std::size_t k = 0; k < kNeighbours; ++k) {
        Vector d = x[k] - value;
        for (std::size_t j = 0; j < 3; ++j) d = hn::NegMulAdd(hn::Set(kFloats, stencil.offset[j][k]), g[j], d);
        hn::StoreU(d, kFloats, difference + k * padded + i);
      }
    }
  }
}

/// Products of 4 columns from `row` on with kWide columns from `column` on.
template <std::size_t kWide>
void calc_block(const Columns& columns, std::size_t row, std::size_t column, Products& products) {
  const std::size_t padded = columns.get_padded();
  Vector sum[4][kWide];
#pragma GCC unroll 4
  for (auto& of_row : sum) {
#pragma GCC unroll 4
    for (Vector& one : of_row) one = hn::Zero(kFloats);
  }
  const float *const a = columns.get(row), *const b = columns.get(column);
  for (std::size_t i = 0; i < padded; i += kLanes) {
    Vector x[kWide];
#pragma GCC unroll 4
    for (std::size_t k = 0; k < kWide; ++k) x[k] = hn::LoadU(kFloats, b + k * padded + i);
#pragma GCC unroll 4
    for (std::size_t r = 0; r < 4; ++r) {
      const Vector y = hn::LoadU(kFloats, a + r * padded + i);
#pragma GCC unroll 4
      for (std::size_t k = 0; k < kWide; ++k) sum[r][k] = hn::MulAdd(x[k], y, sum[r][k]);
    }
  }
  for (std::size_t r = 0; r < 4; ++r)
    for (std::size_t k = 0; k < kWide; ++k)
      products[(row + r) * Columns::kCount + column + k] = hn::GetLane(hn::SumOfLanes(kFloats, sum[r][k]));
}

void calc_products(const Columns& columns, std::size_t begin, std::size_t end, Products& products) {
  constexpr std::size_t kWide = kLanes == 16 ? 4 : 2;  // keeps all sums in registers
  for (std::size_t row = begin; row < end; row += 4)
    for (std::size_t column = 0; column < row + 4; column += kWide) calc_block<kWide>(columns, row, column, products);
}

float calc_cost(const Columns& columns, const float* coefficients, std::size_t fields, const ResidualCost& model) {
  const std::size_t padded = columns.get_padded();
  const auto per_step = hn::Set(kFloats, 1.0F / model.step), rounding = hn::Set(kFloats, model.rounding), one = hn::Set(kFloats, 1.0F);
  const auto one_as_bits = hn::Set(kInts, 0x3f800000);  // of 1.0F; above it the exponent, and the mantissa as its fraction
  const auto per_bit = hn::Set(kFloats, 2.0F / (1 << 23));
  const auto bits_of_0 = hn::Set(kFloats, model.bits_of_0), bits_of_1 = hn::Set(kFloats, model.bits_of_1);
  auto bits = hn::Zero(kFloats), error = hn::Zero(kFloats);
  for (std::size_t i = 0; i < padded; i += kLanes) {
    Vector left[3];
    for (std::size_t c = 0; c < 3; ++c) left[c] = hn::LoadU(kFloats, columns.get(c) + i);
    for (std::size_t f = 0; f < fields; ++f) {
      const Vector x = hn::LoadU(kFloats, columns.get(Columns::kGradient + f) + i);
      for (std::size_t c = 0; c < 3; ++c) left[c] = hn::NegMulAdd(hn::Set(kFloats, coefficients[3 * f + c]), x, left[c]);
    }
    for (const Vector& one_left : left) {
      const Vector x = hn::Abs(one_left) * per_step, q = hn::Floor(x + rounding), off = x - q;
      const Vector size = hn::ConvertTo(kFloats, hn::BitCast(kInts, q) - one_as_bits);
      bits = bits + hn::IfThenElse(q >= one, hn::MulAdd(size, per_bit, bits_of_1), bits_of_0);
      error = hn::MulAdd(off, off, error);
    }
  }
  return hn::GetLane(hn::SumOfLanes(kFloats, hn::MulAdd(error, hn::Set(kFloats, model.per_error), bits)));
}

const FitLoops& get_table() {
  static constexpr FitLoops kLoops{calc_columns, calc_products, calc_cost};
  return kLoops;
}

}  // namespace
}  // namespace carillon::packed::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::packed {

HWY_EXPORT(get_table);
const FitLoops& find_fit_loops(base::Instructions best) { return base::choose(HWY_DISPATCH_TABLE(get_table), best)(); }

}  // namespace carillon::packed
#endif
