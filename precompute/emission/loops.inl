// Method:     elementwise; see loops.hpp.
// Source:     docs/equations.md E14.
// Deviations: none.
//
// Included by loops_*.cpp inside an unnamed namespace; nothing of std is used, so that no function compiled for one processor can be linked
// in place of another's.

typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
typedef double Eight __attribute__((vector_size(64), aligned(8), may_alias));
typedef std::int64_t Whole __attribute__((vector_size(64), aligned(8), may_alias));

void add_places(double* __restrict sum, const double* __restrict u, const std::int32_t* __restrict node, std::size_t n, bool is_first) {
  for (std::size_t i = 0; i < n; ++i) {
    const Four x = *reinterpret_cast<const Four*>(u + 4 * static_cast<std::size_t>(node[i]));
    Four* to = reinterpret_cast<Four*>(sum + 4 * i);
    if (is_first) *to = x;
    else *to += x;
  }
}

template <bool kHasSum, bool kHasStep>
void add_numbers(double* __restrict open, const double* __restrict sum, const double* __restrict u, const std::int32_t* __restrict node,
                 std::size_t n, const double* __restrict weight) {
  Eight w[kEntry / 2];
  for (std::size_t s = 0; s < kEntry; ++s)
    for (std::size_t axis = 0; axis < 4; ++axis) w[s / 2][4 * (s % 2) + axis] = weight[s];
  for (std::size_t i = 0; i < n; ++i) {
    Four x{};
    if (kHasSum) x = *reinterpret_cast<const Four*>(sum + 4 * i);
    if (kHasStep) x += *reinterpret_cast<const Four*>(u + 4 * static_cast<std::size_t>(node[i]));
    const Eight both = __builtin_shufflevector(x, x, 0, 1, 2, 3, 0, 1, 2, 3);
    Eight* to = reinterpret_cast<Eight*>(open + 4 * kEntry * i);
    for (std::size_t s = 0; s < kEntry / 2; ++s) to[s] += w[s] * both;
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
    // The fourth number of a vertex is overwritten by the next one, or lies behind the rows in use.
    for (std::size_t i = 0; i < kVertices && begin + i < n; ++i, from += 4 * kEntry) {
      *reinterpret_cast<Four*>(to.data + 3 * i) = scale * *reinterpret_cast<const Four*>(from);
      *reinterpret_cast<Four*>(from) = Four{};
    }
}

constexpr std::size_t kVectors = kLane / 8;

void calc_motion(Frames from, const std::size_t* offset, std::size_t rows, const double* even, const double* odd, const double* rest,
                 double* const* x, double* const* v) {
  for (std::size_t begin = 0; begin < rows; begin += kLane, from.data += from.stride)
    for (int b = 0; b < kBatch; ++b) {
      const std::size_t* at = offset + 2 * b + kMotionHalf;
      const Eight* middle = reinterpret_cast<const Eight*>(from.data + at[0]);
      Eight place[kVectors], speed[kVectors];
      for (std::size_t i = 0; i < kVectors; ++i) {
        place[i] = even[0] * middle[i];
        speed[i] = Eight{};
      }
      for (int j = 1; j <= kMotionHalf; ++j) {
        const Eight* after = reinterpret_cast<const Eight*>(from.data + at[j]);
        const Eight* before = reinterpret_cast<const Eight*>(from.data + at[-j]);
        for (std::size_t i = 0; i < kVectors; ++i) {
          place[i] += even[j] * (after[i] + before[i]);
          speed[i] += odd[j] * (after[i] - before[i]);
        }
      }
      const Eight* still = reinterpret_cast<const Eight*>(rest + begin);
      Eight* to_x = reinterpret_cast<Eight*>(x[b] + begin);
      Eight* to_v = reinterpret_cast<Eight*>(v[b] + begin);
      for (std::size_t i = 0; i < kVectors; ++i) {
        to_x[i] = still[i] + place[i];
        to_v[i] = speed[i];
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
  for (std::size_t block = 0; block < blocks; ++block, from.data += from.stride, to.data += to.stride)
    for (int b = 0; b < kBatch; ++b) {
      const std::size_t* at = offset + b + kDerivativeHalf;
      Eight sum[kVectors]{};
      for (int j = 1; j <= kDerivativeHalf; ++j) {
        const Eight* after = reinterpret_cast<const Eight*>(from.data + at[j]);
        const Eight* before = reinterpret_cast<const Eight*>(from.data + at[-j]);
        for (std::size_t i = 0; i < kVectors; ++i) sum[i] += odd[j] * (after[i] - before[i]);
      }
      Eight* out = reinterpret_cast<Eight*>(to.data + to_offset[b]);
      for (std::size_t i = 0; i < kVectors; ++i) out[i] = sum[i];
    }
}

void sum_frames(Frames from, const std::size_t* offset, std::size_t blocks, const double* weight, double keep, const double* before,
                double* const* out) {
  for (std::size_t begin = 0; begin < blocks * kLane; begin += kLane, from.data += from.stride) {
    Eight sum[kVectors];
    for (std::size_t i = 0; i < kVectors; ++i) sum[i] = reinterpret_cast<const Eight*>(before + begin)[i];
    for (int b = 0; b < kBatch; ++b) {
      for (std::size_t i = 0; i < kVectors; ++i) sum[i] = keep * sum[i];
      for (int j = 0; j < kPoleSpan; ++j) {
        const Eight* x = reinterpret_cast<const Eight*>(from.data + offset[b + j]);
        for (std::size_t i = 0; i < kVectors; ++i) sum[i] += weight[j] * x[i];
      }
      for (std::size_t i = 0; i < kVectors; ++i) reinterpret_cast<Eight*>(out[b] + begin)[i] = sum[i];
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

bool scatter(std::int64_t* units, double now, double end, const double* time, const double* pa, std::size_t n,
             const double* spline) {
  constexpr double kMiddle = 6755399441055744.0;  // 1.5 * 2^52
  constexpr std::int64_t kMiddleBits = 0x4338000000000000;
  constexpr double kMostPa = 30.0;  // whose units are read off the bits
  static_assert(kSplinePoints == 8);
  const Eight* power = reinterpret_cast<const Eight*>(spline);
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
    Eight share = power[kSplinePoints - 1];
    for (int d = kSplinePoints - 2; d >= 0; --d) share = share * part + power[d];
    share *= pa[i] * kUnitsPerPa;
    std::int64_t* to = units + whole;
    if (size <= kMostPa) {
      *reinterpret_cast<Whole*>(to) += (Whole)(share + kMiddle) - kMiddleBits;
    } else {
      for (int j = 0; j < kSplinePoints; ++j) to[j] += static_cast<std::int64_t>(share[j]);
    }
  }
  return is_fine;
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

