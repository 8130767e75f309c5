#include "precompute/la/node_products.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::la::HWY_NAMESPACE {
namespace {

constexpr int kStrip = NodeMatrix::kStrip;
using Row = NodeMatrix::Row;

constexpr int kWidth = CARILLON_REGISTER_BYTES / sizeof(double);
typedef double Vector __attribute__((vector_size(8 * kWidth), may_alias));
constexpr int kVectors = kStrip / kWidth;
constexpr int kTogether = 2;  // vectors of a row at a time: the registers hold three sums of each
static_assert(kVectors % kTogether == 0);

[[gnu::always_inline]] inline void prefetch_rows(const Row* rows) {
#pragma GCC unroll 6
  for (int line = 0; line < 3 * kStrip / 8; ++line) __builtin_prefetch(reinterpret_cast<const double*>(rows) + 8 * line);
}

// All loops over the sums are unrolled: GCC 12 spills them to memory otherwise.

/// kTogether vectors of each row of a node, from vector `first` on.
[[gnu::always_inline]] inline void multiply_node(std::int64_t begin, std::int64_t end, const std::int32_t* neighbour, const double* values,
                                                 const double* rest, const Vector* own_row, const Row* x, int first, Vector* out) {
  Vector sum[3][kTogether], own[3][kTogether];
#pragma GCC unroll 3
  for (int d = 0; d < 3; ++d)
#pragma GCC unroll 2
    for (int v = 0; v < kTogether; ++v) own[d][v] = own_row[d * kVectors + first + v];
#pragma GCC unroll 3
  for (int d = 0; d < 3; ++d)
#pragma GCC unroll 2
    for (int v = 0; v < kTogether; ++v) sum[d][v] = rest[3 * d] * own[0][v] + rest[3 * d + 1] * own[1][v] + rest[3 * d + 2] * own[2][v];
  for (std::int64_t k = begin; k < end; ++k) {
    const double* a = values + 9 * k;
    const auto* from = reinterpret_cast<const Vector*>(x + 3 * static_cast<std::ptrdiff_t>(neighbour[k])) + first;
    if (first == 0) prefetch_rows(x + 3 * static_cast<std::ptrdiff_t>(neighbour[k + kAhead]));
#pragma GCC unroll 3
    for (int d = 0; d < 3; ++d)
#pragma GCC unroll 2
      for (int v = 0; v < kTogether; ++v)
        sum[d][v] += a[3 * d] * (from[v] - own[0][v]) + a[3 * d + 1] * (from[kVectors + v] - own[1][v]) +
                     a[3 * d + 2] * (from[2 * kVectors + v] - own[2][v]);
  }
#pragma GCC unroll 3
  for (int d = 0; d < 3; ++d)
#pragma GCC unroll 2
    for (int v = 0; v < kTogether; ++v) out[d * kVectors + first + v] = sum[d][v];
}

void multiply_blocks(const std::int64_t* start, const std::int32_t* neighbour, const double* values, const double* rest, std::size_t nodes,
                     const Row* own_rows, const Row* x, Row* y) {
  auto* out = reinterpret_cast<Vector*>(y);
  const auto* own_row = reinterpret_cast<const Vector*>(own_rows);
  for (std::size_t node = 0; node < nodes; ++node, out += 3 * kVectors, own_row += 3 * kVectors, rest += 9)
    for (int first = 0; first < kVectors; first += kTogether)
      multiply_node(start[node], start[node + 1], neighbour, values, rest, own_row, x, first, out);
}

void multiply_scalars(const std::int64_t* start, const std::int32_t* neighbour, const double* values, std::size_t nodes, const Row* x,
                      Row* y) {
  constexpr int kAll = 3 * kVectors, kSums = kAll < 12 ? kAll : 12;
  auto* out = reinterpret_cast<Vector*>(y);
  for (std::size_t node = 0; node < nodes; ++node, out += kAll)
    for (int first = 0; first < kAll; first += kSums) {
      Vector sum[kSums];
#pragma GCC unroll 12
      for (int v = 0; v < kSums; ++v) sum[v] = Vector{};
      for (std::int64_t k = start[node]; k < start[node + 1]; ++k) {
        const auto* from = reinterpret_cast<const Vector*>(x + 3 * static_cast<std::ptrdiff_t>(neighbour[k])) + first;
        if (first == 0) prefetch_rows(x + 3 * static_cast<std::ptrdiff_t>(neighbour[k + kAhead]));
#pragma GCC unroll 12
        for (int v = 0; v < kSums; ++v) sum[v] += values[k] * from[v];
      }
#pragma GCC unroll 12
      for (int v = 0; v < kSums; ++v) out[first + v] = sum[v];
    }
}

}  // namespace
}  // namespace carillon::la::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::la {

HWY_EXPORT(multiply_blocks);
HWY_EXPORT(multiply_scalars);

void multiply_blocks(const std::int64_t* start, const std::int32_t* neighbour, const double* values, const double* rest, std::size_t nodes,
                     const NodeMatrix::Row* own_rows, const NodeMatrix::Row* x, NodeMatrix::Row* y) {
  base::choose(HWY_DISPATCH_TABLE(multiply_blocks))(start, neighbour, values, rest, nodes, own_rows, x, y);
}

void multiply_scalars(const std::int64_t* start, const std::int32_t* neighbour, const double* values, std::size_t nodes,
                      const NodeMatrix::Row* x, NodeMatrix::Row* y) {
  base::choose(HWY_DISPATCH_TABLE(multiply_scalars))(start, neighbour, values, nodes, x, y);
}

}  // namespace carillon::la
#endif
