// Method: elementwise; see loops.hpp. docs/equations.md E14.
#include "precompute/simulation/emission/loops.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::emission::HWY_NAMESPACE {
namespace {

constexpr std::size_t kWidth = CARILLON_REGISTER_BYTES / sizeof(double);
constexpr std::size_t kQuad = kWidth < 4 ? kWidth : 4;
typedef double Wide __attribute__((vector_size(8 * kWidth), aligned(8), may_alias));
typedef double Quad __attribute__((vector_size(8 * kQuad), aligned(8), may_alias));
typedef std::int64_t Whole __attribute__((vector_size(8 * kWidth), aligned(8), may_alias));

void add_places(double* __restrict sum, const double* __restrict u, const std::int32_t* __restrict node, std::size_t n, bool is_first) {
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t part = 0; part < 4; part += kQuad) {
      const Quad x = *reinterpret_cast<const Quad*>(u + 4 * node[i] + part);
      Quad* to = reinterpret_cast<Quad*>(sum + 4 * i + part);
      if (is_first)
        *to = x;
      else
        *to += x;
    }
}

template <bool kHasSum, bool kHasStep>
void add_numbers(double* __restrict open, const double* __restrict sum, const double* __restrict u, const std::int32_t* __restrict node,
                 std::size_t n, const double* __restrict weight) {
  constexpr std::size_t kNumbers = 4 * kEntry;
  Wide w[kNumbers / kWidth];
  for (std::size_t i = 0; i < kNumbers; ++i) w[i / kWidth][i % kWidth] = weight[i / 4];
  for (std::size_t i = 0; i < n; ++i) {
    Quad x[4 / kQuad]{};
    for (std::size_t part = 0; part < 4 / kQuad; ++part) {
      if (kHasSum) x[part] = *reinterpret_cast<const Quad*>(sum + 4 * i + kQuad * part);
      if (kHasStep) x[part] += *reinterpret_cast<const Quad*>(u + 4 * node[i] + kQuad * part);
    }
    Wide* to = reinterpret_cast<Wide*>(open + kNumbers * i);
#if HWY_MAX_BYTES == 64
    const Wide both = __builtin_shufflevector(x[0], x[0], 0, 1, 2, 3, 0, 1, 2, 3);
    for (std::size_t s = 0; s < kNumbers / kWidth; ++s) to[s] += w[s] * both;
#else
    for (std::size_t s = 0; s < kNumbers / kWidth; ++s) to[s] += w[s] * x[s % (4 / kQuad)];
#endif
  }
}

void add_value(double* open, const double* sum, const double* u, const std::int32_t* node, std::size_t n, const double* weight) {
  if (!u) {
    add_numbers<true, false>(open, sum, u, node, n, weight);
  } else if (!sum) {
    add_numbers<false, true>(open, sum, u, node, n, weight);
  } else {
    add_numbers<true, true>(open, sum, u, node, n, weight);
  }
}

void close_value(double* __restrict open, std::size_t n, int slot, double scale, Frames to) {
  double* from = open + 4 * slot;
  for (std::size_t begin = 0; begin < n; begin += kVertices, to.data += to.stride)
    // The fourth component of a vertex is overwritten by the next one, or lies after the rows in use.
    for (std::size_t i = 0; i < kVertices && begin + i < n; ++i, from += 4 * kEntry)
      for (std::size_t part = 0; part < 4; part += kQuad) {
        *reinterpret_cast<Quad*>(to.data + 3 * i + part) = scale * *reinterpret_cast<const Quad*>(from + part);
        *reinterpret_cast<Quad*>(from + part) = Quad{};
      }
}

constexpr std::size_t kVectors = 4;               // vectors per pass: sums fit the registers
constexpr std::size_t kRows = kVectors * kWidth;  // per pass
static_assert(kLane % kRows == 0);

void calc_motion(Frames from, const std::size_t* offset, std::size_t rows, const double* even, const double* odd, const double* rest,
                 double* const* x, double* const* v) {
  for (std::size_t begin = 0; begin < rows; begin += kRows) {
    const double* base = from.data + begin / kLane * from.stride + begin % kLane;
    for (int b = 0; b < kBatch; ++b) {
      const std::size_t* at = offset + 2 * b + kMotionHalf;
      const Wide* middle = reinterpret_cast<const Wide*>(base + at[0]);
      Wide place[kVectors], speed[kVectors];
      for (std::size_t i = 0; i < kVectors; ++i) {
        place[i] = even[0] * middle[i];
        speed[i] = Wide{};
      }
      for (int j = 1; j <= kMotionHalf; ++j) {
        const Wide* after = reinterpret_cast<const Wide*>(base + at[j]);
        const Wide* before = reinterpret_cast<const Wide*>(base + at[-j]);
        for (std::size_t i = 0; i < kVectors; ++i) {
          place[i] += even[j] * (after[i] + before[i]);
          speed[i] += odd[j] * (after[i] - before[i]);
        }
      }
      const Wide* still = reinterpret_cast<const Wide*>(rest + begin);
      Wide* to_x = reinterpret_cast<Wide*>(x[b] + begin);
      Wide* to_v = reinterpret_cast<Wide*>(v[b] + begin);
      for (std::size_t i = 0; i < kVectors; ++i) {
        to_x[i] = still[i] + place[i];
        to_v[i] = speed[i];
      }
    }
  }
}

void calc_flux(const double* x, const double* v, const std::int32_t* corner, std::size_t blocks, double scale, Frames flux) {
  for (std::size_t block = 0; block < blocks; ++block, corner += 3 * kLane, flux.data += flux.stride)
    for (std::size_t i = 0; i < kLane; ++i) {
      const double *a = x + corner[3 * i], *b = x + corner[3 * i + 1], *c = x + corner[3 * i + 2];
      const double *va = v + corner[3 * i], *vb = v + corner[3 * i + 1], *vc = v + corner[3 * i + 2];
      const double e0 = b[0] - a[0], e1 = b[1] - a[1], e2 = b[2] - a[2], d0 = c[0] - a[0], d1 = c[1] - a[1], d2 = c[2] - a[2];
      flux.data[i] = scale * ((va[0] + vb[0] + vc[0]) * (e1 * d2 - e2 * d1) + (va[1] + vb[1] + vc[1]) * (e2 * d0 - e0 * d2) +
                              (va[2] + vb[2] + vc[2]) * (e0 * d1 - e1 * d0));
    }
}

void calc_rates(Frames from, const std::size_t* offset, std::size_t blocks, const double* odd, Frames to, const std::size_t* to_offset) {
  for (std::size_t begin = 0; begin < blocks * kLane; begin += kRows) {
    const double* base = from.data + begin / kLane * from.stride + begin % kLane;
    double* to_base = to.data + begin / kLane * to.stride + begin % kLane;
    for (int b = 0; b < kBatch; ++b) {
      const std::size_t* at = offset + b + kDerivativeHalf;
      Wide sum[kVectors]{};
      for (int j = 1; j <= kDerivativeHalf; ++j) {
        const Wide* after = reinterpret_cast<const Wide*>(base + at[j]);
        const Wide* before = reinterpret_cast<const Wide*>(base + at[-j]);
        for (std::size_t i = 0; i < kVectors; ++i) sum[i] += odd[j] * (after[i] - before[i]);
      }
      Wide* out = reinterpret_cast<Wide*>(to_base + to_offset[b]);
      for (std::size_t i = 0; i < kVectors; ++i) out[i] = sum[i];
    }
  }
}

void sum_frames(Frames from, const std::size_t* offset, std::size_t blocks, const double* weight, double keep, const double* before,
                double* const* out) {
  for (std::size_t begin = 0; begin < blocks * kLane; begin += kRows) {
    const double* base = from.data + begin / kLane * from.stride + begin % kLane;
    Wide sum[kVectors];
    for (std::size_t i = 0; i < kVectors; ++i) sum[i] = reinterpret_cast<const Wide*>(before + begin)[i];
    for (int b = 0; b < kBatch; ++b) {
      for (std::size_t i = 0; i < kVectors; ++i) sum[i] = keep * sum[i];
      for (int j = 0; j < kPoleSpan; ++j) {
        const Wide* x = reinterpret_cast<const Wide*>(base + offset[b + j]);
        for (std::size_t i = 0; i < kVectors; ++i) sum[i] += weight[j] * x[i];
      }
      for (std::size_t i = 0; i < kVectors; ++i) reinterpret_cast<Wide*>(out[b] + begin)[i] = sum[i];
    }
  }
}

void find_facets(const double* x, const std::int32_t* corner, Facets* facets) {
  for (std::size_t i = 0; i < kLane; ++i) {
    const double *a = x + corner[3 * i], *b = x + corner[3 * i + 1], *c = x + corner[3 * i + 2];
    double e[3], d[3];
    for (int axis = 0; axis < 3; ++axis) {
      e[axis] = b[axis] - a[axis];
      d[axis] = c[axis] - a[axis];
      facets->centre[axis][i] = (1.0 / 3.0) * (a[axis] + b[axis] + c[axis]);
    }
    for (int axis = 0; axis < 3; ++axis) {
      const int next = (axis + 1) % 3, last = (axis + 2) % 3;
      facets->normal[axis][i] = e[next] * d[last] - e[last] * d[next];
    }
  }
  for (std::size_t i = 0; i < kLane; ++i) {
    double square = 0.0;
    for (int axis = 0; axis < 3; ++axis) square += facets->normal[axis][i] * facets->normal[axis][i];
    const double twice = __builtin_sqrt(square), per = 1.0 / (twice + 1e-300);
    facets->twice_area[i] = twice;
    for (int axis = 0; axis < 3; ++axis) facets->normal[axis][i] *= per;
  }
}

void radiate(const Facets* __restrict facets, const Ear* __restrict ear, double per_speed, const double* __restrict plain,
             const double* __restrict turned, double* __restrict time, double* __restrict pa) {
  for (std::size_t i = 0; i < kLane; ++i) {
    double square = 0.0, out = 0.0, ahead = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      const double way = ear->place_m[axis] - facets->centre[axis][i];
      square += way * way;
      out += way * facets->normal[axis][i];
      ahead += way * ear->axis[axis];
    }
    const double r = __builtin_sqrt(square), per_r = 1.0 / r;
    time[i] = per_speed * r;
    pa[i] = (plain[i] + turned[i] * (out * per_r)) * per_r * (1.0 - ear->directivity - ear->directivity * (ahead * per_r));
  }
}

bool scatter(std::int64_t* units, double now, double end, const double* time, const double* pa, std::size_t n, const double* spline) {
  constexpr double kBitsOffset = 6755399441055744.0;  // 1.5 * 2^52
  constexpr std::int64_t kMiddleBits = 0x4338000000000000;
  constexpr double kMaxBitsPa = 30.0;  // largest pressure handled by the bit representation
  constexpr std::size_t kParts = kSplinePoints / kWidth;
  bool is_fine = true;
  for (std::size_t i = 0; i < n; ++i) {
    const double size = __builtin_fabs(pa[i]), at = now + time[i];
    if (!(size < 1e4)) {
      is_fine = false;
      continue;
    }
    if (!(at < end)) continue;
    const auto whole = static_cast<std::int64_t>(at);
    const double part = at - static_cast<double>(whole);
    Wide share[kParts];
    for (std::size_t j = 0; j < kParts; ++j) share[j] = reinterpret_cast<const Wide*>(spline + kSplinePoints * (kSplinePoints - 1))[j];
    for (std::size_t d = kSplinePoints - 1; d-- > 0;)
      for (std::size_t j = 0; j < kParts; ++j) share[j] = share[j] * part + reinterpret_cast<const Wide*>(spline + kSplinePoints * d)[j];
    std::int64_t* to = units + whole;
    for (std::size_t j = 0; j < kParts; ++j) {
      share[j] *= pa[i] * kUnitsPerPa;
      if (size <= kMaxBitsPa) {
        *reinterpret_cast<Whole*>(to + kWidth * j) += (Whole)(share[j] + kBitsOffset) - kMiddleBits;
      } else {
        for (std::size_t k = 0; k < kWidth; ++k) to[kWidth * j + k] += static_cast<std::int64_t>(share[j][k]);
      }
    }
  }
  return is_fine;
}

void add_rows(double* __restrict open, const double* __restrict value, std::size_t rows, const double* const* weight, std::size_t count) {
  constexpr std::size_t kRowsPerPass = kWidth < 4 ? 1 : 2, kParts = kSlots / kWidth;  // rows and vectors whose sums fit the registers
  Wide w[kValuesPerCall][kParts];
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t s = 0; s < kParts; ++s) w[i][s] = *reinterpret_cast<const Wide*>(weight[i] + kWidth * s);
  for (std::size_t row = 0; row < rows; row += kRowsPerPass) {
    Wide* to = reinterpret_cast<Wide*>(open + row * kSlots);
    Wide sum[kRowsPerPass][kParts];
    for (std::size_t r = 0; r < kRowsPerPass; ++r)
      for (std::size_t s = 0; s < kParts; ++s) sum[r][s] = to[r * kParts + s];
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t r = 0; r < kRowsPerPass; ++r)
        for (std::size_t s = 0; s < kParts; ++s) sum[r][s] += value[i * rows + row + r] * w[i][s];
    for (std::size_t r = 0; r < kRowsPerPass; ++r)
      for (std::size_t s = 0; s < kParts; ++s) to[r * kParts + s] = sum[r][s];
  }
}

const RowLoops kLoops{add_places, add_value,   close_value, calc_motion, calc_flux, calc_rates,
                      sum_frames, find_facets, radiate,     scatter,     add_rows};

const RowLoops& get_loops() { return kLoops; }

}  // namespace
}  // namespace carillon::emission::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::emission {

HWY_EXPORT(get_loops);

const RowLoops& find_loops() { return base::choose(HWY_DISPATCH_TABLE(get_loops))(); }

}  // namespace carillon::emission
#endif
