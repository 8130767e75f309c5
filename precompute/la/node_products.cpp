#include "precompute/la/node_products.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::la::HWY_NAMESPACE {
namespace {

constexpr int kStrip = NodeMatrix::kStrip;
using Row = NodeMatrix::Row;

typedef double Vector __attribute__((vector_size(64), may_alias));
constexpr int kVectors = kStrip / 8;

[[gnu::always_inline]] inline void prefetch_rows(const Row* rows) {
#pragma GCC unroll 6
  for (int line = 0; line < 3 * kVectors; ++line) __builtin_prefetch(reinterpret_cast<const Vector*>(rows) + line);
}

// All loops over the sums are unrolled: GCC 12 spills them to memory otherwise.
void multiply_blocks(const std::int64_t* start, const std::int32_t* neighbour, const double* values, const double* rest, std::size_t nodes,
                     const Row* own_rows, const Row* x, Row* y) {
  auto* out = reinterpret_cast<Vector*>(y);
  const auto* own_row = reinterpret_cast<const Vector*>(own_rows);
  for (std::size_t node = 0; node < nodes; ++node, out += 3 * kVectors, own_row += 3 * kVectors, rest += 9) {
    Vector sum[3][kVectors];
    Vector own[3 * kVectors];
#pragma GCC unroll 6
    for (int v = 0; v < 3 * kVectors; ++v) own[v] = own_row[v];
#pragma GCC unroll 3
    for (int d = 0; d < 3; ++d)
#pragma GCC unroll 2
      for (int v = 0; v < kVectors; ++v)
        sum[d][v] = rest[3 * d] * own[v] + rest[3 * d + 1] * own[kVectors + v] + rest[3 * d + 2] * own[2 * kVectors + v];
    for (std::int64_t k = start[node]; k < start[node + 1]; ++k) {
      const double* a = values + 9 * k;
      const auto* from = reinterpret_cast<const Vector*>(x + 3 * static_cast<std::ptrdiff_t>(neighbour[k]));
      prefetch_rows(x + 3 * static_cast<std::ptrdiff_t>(neighbour[k + kAhead]));
#pragma GCC unroll 3
      for (int d = 0; d < 3; ++d)
#pragma GCC unroll 2
        for (int v = 0; v < kVectors; ++v)
          sum[d][v] += a[3 * d] * (from[v] - own[v]) + a[3 * d + 1] * (from[kVectors + v] - own[kVectors + v]) +
                       a[3 * d + 2] * (from[2 * kVectors + v] - own[2 * kVectors + v]);
    }
#pragma GCC unroll 3
    for (int d = 0; d < 3; ++d)
#pragma GCC unroll 2
      for (int v = 0; v < kVectors; ++v) out[d * kVectors + v] = sum[d][v];
  }
}

void multiply_scalars(const std::int64_t* start, const std::int32_t* neighbour, const double* values, std::size_t nodes, const Row* x,
                      Row* y) {
  constexpr int kAll = 3 * kVectors;
  auto* out = reinterpret_cast<Vector*>(y);
  for (std::size_t node = 0; node < nodes; ++node, out += kAll) {
    Vector sum[kAll];
#pragma GCC unroll 6
    for (int v = 0; v < kAll; ++v) sum[v] = Vector{};
    for (std::int64_t k = start[node]; k < start[node + 1]; ++k) {
      const auto* from = reinterpret_cast<const Vector*>(x + 3 * static_cast<std::ptrdiff_t>(neighbour[k]));
      prefetch_rows(x + 3 * static_cast<std::ptrdiff_t>(neighbour[k + kAhead]));
#pragma GCC unroll 6
      for (int v = 0; v < kAll; ++v) sum[v] += values[k] * from[v];
    }
#pragma GCC unroll 6
    for (int v = 0; v < kAll; ++v) out[v] = sum[v];
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
