// Method:     elementwise; see loops.hpp.
// Source:     docs/equations.md E14.
// Deviations: none.
//
// Included by loops_*.cpp inside an unnamed namespace; nothing of std is used, so that no function compiled for one processor can be linked
// in place of another's.

typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
typedef double Eight __attribute__((vector_size(64), aligned(8), may_alias));

void add_places(double* __restrict sum, const double* __restrict u, const std::int32_t* __restrict node, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    *reinterpret_cast<Four*>(sum + 4 * i) += *reinterpret_cast<const Four*>(u + 4 * static_cast<std::size_t>(node[i]));
  }
}

void add_rows(double* __restrict open, const double* __restrict value, std::size_t rows, const double* const* weight, std::size_t count) {
  constexpr std::size_t kRows = 2, kVectors = kSlots / 8;  // sums that fit the registers
  static_assert(kLane % kRows == 0 && kSlots % 8 == 0);
  Eight w[kTogether][kVectors];
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t s = 0; s < kVectors; ++s) w[i][s] = *reinterpret_cast<const Eight*>(weight[i] + 8 * s);
  for (std::size_t row = 0; row < rows; row += kRows) {
    Eight* to = reinterpret_cast<Eight*>(open + row * kSlots);
    Eight sum[kRows][kVectors];
    for (std::size_t r = 0; r < kRows; ++r)
      for (std::size_t s = 0; s < kVectors; ++s) sum[r][s] = to[r * kVectors + s];
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t r = 0; r < kRows; ++r)
        for (std::size_t s = 0; s < kVectors; ++s) sum[r][s] += value[i * rows + row + r] * w[i][s];
    for (std::size_t r = 0; r < kRows; ++r)
      for (std::size_t s = 0; s < kVectors; ++s) to[r * kVectors + s] = sum[r][s];
  }
}

void calc_derivatives(const double* const* frame, std::size_t rows, const double* first, const double* second, double* v, double* a) {
  for (std::size_t begin = 0; begin < rows; begin += kLane)
    for (int b = 0; b < kBatch; ++b) {
      const double* const* own = frame + b + kDerivativeHalf;
      double speed[kLane], acceleration[kLane];
      for (std::size_t i = 0; i < kLane; ++i) {
        speed[i] = 0.0;
        acceleration[i] = second[0] * own[0][begin + i];
      }
      for (int j = 1; j <= kDerivativeHalf; ++j) {
        const double* after = own[j] + begin;
        const double* before = own[-j] + begin;
        const double odd = first[j], even = second[j];
        for (std::size_t i = 0; i < kLane; ++i) {
          speed[i] += odd * (after[i] - before[i]);
          acceleration[i] += even * (after[i] + before[i]);
        }
      }
      double* to_v = v + static_cast<std::size_t>(b) * rows + begin;
      double* to_a = a + static_cast<std::size_t>(b) * rows + begin;
      for (std::size_t i = 0; i < kLane; ++i) {
        to_v[i] = speed[i];
        to_a[i] = acceleration[i];
      }
    }
}

void sum_frames(const double* const* frame, std::size_t rows, const double* weight, double keep, const double* before, double* const* out) {
  for (std::size_t begin = 0; begin < rows; begin += kLane) {
    double sum[kLane];
    for (std::size_t i = 0; i < kLane; ++i) sum[i] = before[begin + i];
    for (int b = 0; b < kBatch; ++b) {
      for (std::size_t i = 0; i < kLane; ++i) sum[i] = keep * sum[i];
      for (int j = 0; j < kSpread; ++j) {
        const double* x = frame[b + j] + begin;
        const double w = weight[j];
        for (std::size_t i = 0; i < kLane; ++i) sum[i] += w * x[i];
      }
      for (std::size_t i = 0; i < kLane; ++i) out[b][begin + i] = sum[i];
    }
  }
}

void scatter(std::int64_t* __restrict to, double pa, const float* __restrict row, const float* __restrict share) {
  constexpr double kMiddle = 6755399441055744.0;  // 1.5 * 2^52
  constexpr std::int64_t kMiddleBits = 0x4338000000000000;
  const double units = pa * kUnitsPerPa;
  const float a = share[0], b = share[1], c = share[2];
  for (int j = 0; j < kSpread; ++j) {
    const float tap = a * row[j] + b * row[j + kSpread] + c * row[j + 2 * kSpread];
    const double sum = units * static_cast<double>(tap) + kMiddle;
    to[j] += __builtin_bit_cast(std::int64_t, sum) - kMiddleBits;
  }
}
