// Method:     elementwise; see loops.hpp.
// Source:     docs/equations.md E14.
// Deviations: none.
//
// Included by loops_*.cpp inside an unnamed namespace; nothing of std is used, so that no function compiled for one processor can be linked
// in place of another's.

typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));

void add_places(double* __restrict sum, const double* __restrict u, const std::int32_t* __restrict node, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    *reinterpret_cast<Four*>(sum + 4 * i) += *reinterpret_cast<const Four*>(u + 4 * static_cast<std::size_t>(node[i]));
  }
}

void add_rows(double* __restrict open, const double* __restrict value, std::size_t rows, const double* const* weight, std::size_t count) {
  double w[kTogether][kSlots];
  for (std::size_t i = 0; i < count; ++i)
    for (int s = 0; s < kSlots; ++s) w[i][s] = weight[i][s];
  for (std::size_t row = 0; row < rows; ++row) {
    double* to = open + row * kSlots;
    double sum[kSlots];
    for (int s = 0; s < kSlots; ++s) sum[s] = to[s];
    for (std::size_t i = 0; i < count; ++i) {
      const double x = value[i * rows + row];
      for (int s = 0; s < kSlots; ++s) sum[s] += x * w[i][s];
    }
    for (int s = 0; s < kSlots; ++s) to[s] = sum[s];
  }
}

void calc_derivatives(const double* const* frame, std::size_t rows, const double* first, const double* second, double* v, double* a) {
  for (std::size_t begin = 0; begin < rows; begin += kLane) {
    double speed[kLane], acceleration[kLane];
    for (std::size_t i = 0; i < kLane; ++i) {
      speed[i] = 0.0;
      acceleration[i] = second[0] * frame[kDerivativeHalf][begin + i];
    }
    for (int j = 1; j <= kDerivativeHalf; ++j) {
      const double* after = frame[kDerivativeHalf + j] + begin;
      const double* before = frame[kDerivativeHalf - j] + begin;
      const double odd = first[j], even = second[j];
      for (std::size_t i = 0; i < kLane; ++i) {
        speed[i] += odd * (after[i] - before[i]);
        acceleration[i] += even * (after[i] + before[i]);
      }
    }
    for (std::size_t i = 0; i < kLane; ++i) {
      v[begin + i] = speed[i];
      a[begin + i] = acceleration[i];
    }
  }
}

void sum_frames(const double* const* frame, std::size_t rows, const double* weight, double keep, double* out) {
  for (std::size_t begin = 0; begin < rows; begin += kLane) {
    double sum[kLane];
    for (std::size_t i = 0; i < kLane; ++i) sum[i] = keep * out[begin + i];
    for (int j = 0; j < kSpread; ++j) {
      const double* x = frame[j] + begin;
      const double w = weight[j];
      for (std::size_t i = 0; i < kLane; ++i) sum[i] += w * x[i];
    }
    for (std::size_t i = 0; i < kLane; ++i) out[begin + i] = sum[i];
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
