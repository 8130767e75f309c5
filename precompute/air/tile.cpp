// Method:     facets in the lanes of registers. For each midpoint of the patch and each of the three of a lane's facet: G = e^{ikr} / r and
//             g = (1/r - ik) G / r, combined to the kernels of - K - alpha W and - V - alpha K'; then sums over the midpoints next to a
//             node, and over its facets for the curls. Points that are near each other take part without the static kernels, by series.
// Source:     docs/equations.md E10. Sine and cosine: reduction by pi / 2 in three parts, polynomials of degree 7 and 8 (least squares).
#include "precompute/air/tile.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::air::HWY_NAMESPACE {
namespace {

constexpr int kWidth = CARILLON_REGISTER_BYTES / sizeof(float);

typedef float F __attribute__((vector_size(4 * kWidth)));
typedef std::int32_t I __attribute__((vector_size(4 * kWidth)));

inline F load(const float* at) { return *reinterpret_cast<const F*>(at); }
inline void store(float* at, F value) { *reinterpret_cast<F*>(at) = value; }
inline F all(float value) { return value - F{}; }

inline F calc_root(F x) {
  F root;
  for (int lane = 0; lane < kWidth; ++lane) root[lane] = __builtin_sqrtf(x[lane]);
  return root;
}

inline F select(I mask, F yes, F no) { return reinterpret_cast<F>((mask & reinterpret_cast<I>(yes)) | (~mask & reinterpret_cast<I>(no))); }

/// Of 0 <= x < 1e5, to 2e-7.
inline void calc_sine_cosine(F x, F& sine, F& cosine) {
  const I turns = __builtin_convertvector(x * 0.636619772F + 0.5F, I);  // rounds down, x >= 0
  const F n = __builtin_convertvector(turns, F);
  const F r = ((x - n * 1.5703125F) - n * 4.837512969970703125e-4F) - n * 7.54978995489188216e-8F;
  const F s = r * r;
  const F odd = r + r * s * (-1.6666654611e-1F + s * (8.3321608736e-3F + s * -1.9515295891e-4F));
  const F even = 1.0F - 0.5F * s + s * s * (4.166664568298827e-2F + s * (-1.388731625493765e-3F + s * 2.443315711809948e-5F));
  const I swapped = -(turns & 1), sine_sign = (turns & 2) << 30, cosine_sign = ((turns + 1) & 2) << 30;
  sine = reinterpret_cast<F>(reinterpret_cast<I>(select(swapped, even, odd)) ^ sine_sign);
  cosine = reinterpret_cast<F>(reinterpret_cast<I>(select(swapped, odd, even)) ^ cosine_sign);
}

/// G = (re + i im), g = (gradient_re + i gradient_im), both times 4 pi.
struct Kernel {
  F re, im, gradient_re, gradient_im;
};

template <bool kMayBeNear>
inline Kernel calc_kernel(F squared, F reach, float k) {
  const F tiny = all(1e-30F);
  const F inverse = 1.0F / calc_root(squared + tiny), r = squared * inverse, x = k * r;
  F s, c;
  calc_sine_cosine(x, s, c);
  const F per_square = inverse * inverse;
  Kernel kernel;
  kernel.re = c * inverse;
  kernel.im = s * inverse;
  kernel.gradient_re = (kernel.re + k * s) * per_square;
  kernel.gradient_im = (kernel.im - k * c) * per_square;
  if constexpr (kMayBeNear) {
    const I near = squared < reach * reach;
    // Without 1 / r and 1 / r^3.
    const F y = x * x, k1 = all(k), k2 = k1 * k1;
    const F re = -k2 * r * (0.5F - y * (1.0F / 24 - y * (1.0F / 720 - y * (1.0F / 40320 - y * (1.0F / 3628800)))));
    const F gradient_re = k2 * inverse * (0.5F - y * (0.125F - y * (1.0F / 144 - y * (1.0F / 5760 - y * (1.0F / 403200)))));
    const F gradient_im = k1 * k2 * (1.0F / 3 - y * (1.0F / 30 - y * (1.0F / 840 - y * (1.0F / 45360 - y * (1.0F / 3991680)))));
    const F im = k1 * (1.0F - y * (1.0F / 6 - y * (1.0F / 120 - y * (1.0F / 5040 - y * (1.0F / 362880)))));
    kernel.re = select(near, re, kernel.re);
    kernel.im = select(near, im, kernel.im);
    kernel.gradient_re = select(near, gradient_re, kernel.gradient_re);
    kernel.gradient_im = select(near, gradient_im, kernel.gradient_im);
  }
  return kernel;
}

/// What a lane's midpoints make with one of the patch, times the lane's weight.
struct PointRow {
  F re[3], im[3];              // of - K + k^2 alpha's part of W
  F right_re[3], right_im[3];  // of - V - alpha K'
  F plain_re, plain_im;        // G summed
};

template <bool kMayBeNear>
inline void calc_point(const TestBlock& block, int lane, const PatchPoint& point, const WaveNumber& wave, PointRow& row) {
  const F weight = load(block.weight + lane);
  const F nx = load(block.normal[0] + lane), ny = load(block.normal[1] + lane), nz = load(block.normal[2] + lane);
  const float k = wave.k, beta = wave.coupling;
  // - alpha k^2 (n_x . n_y) G, alpha = i beta: i G = - im + i re
  const F normals = (-beta * k * k) * (nx * point.normal[0] + ny * point.normal[1] + nz * point.normal[2]);
  row.plain_re = row.plain_im = F{};
  F re[3], im[3], right_re[3], right_im[3];
#pragma GCC unroll 3
  for (int s = 0; s < 3; ++s) {
    const F dx = load(block.place[s][0] + lane) - point.place[0], dy = load(block.place[s][1] + lane) - point.place[1],
            dz = load(block.place[s][2] + lane) - point.place[2];
    const F squared = dx * dx + dy * dy + dz * dz;
    F reach = load(block.reach[s] + lane);
    if constexpr (kMayBeNear) reach = select(reach < point.reach, all(point.reach), reach);
    const Kernel kernel = calc_kernel<kMayBeNear>(squared, reach, k);
    const F to_patch = dx * point.normal[0] + dy * point.normal[1] + dz * point.normal[2];
    const F to_block = beta * (dx * nx + dy * ny + dz * nz);
    re[s] = weight * (-kernel.gradient_re * to_patch - normals * kernel.im);
    im[s] = weight * (-kernel.gradient_im * to_patch + normals * kernel.re);
    // - G + alpha g (d . n_x): i beta g = beta (- im + i re)
    right_re[s] = weight * (-kernel.re - kernel.gradient_im * to_block);
    right_im[s] = weight * (-kernel.im + kernel.gradient_re * to_block);
    row.plain_re += weight * kernel.re;
    row.plain_im += weight * kernel.im;
  }
#pragma GCC unroll 3
  for (int c = 0; c < 3; ++c) {
    const int a = (c + 1) % 3, b = (c + 2) % 3;
    row.re[c] = 0.5F * (re[a] + re[b]);
    row.im[c] = 0.5F * (im[a] + im[b]);
    row.right_re[c] = 0.5F * (right_re[a] + right_re[b]);
    row.right_im[c] = 0.5F * (right_im[a] + right_im[b]);
  }
}

template <bool kMayBeNear>
inline void calc_points(const TestBlock& block, int lane, const Patch& patch, const WaveNumber& wave, float* points, float* right) {
  constexpr int kTogether = 16;  // midpoints whose rows stay in the first cache while the sources pass over them
  alignas(64) float rows[kTogether][6][kWidth];
  for (int first = 0; first < patch.points; first += kTogether) {
    const int count = patch.points - first < kTogether ? patch.points - first : kTogether;
    for (int p = 0; p < count; ++p) {
      PointRow row;
      calc_point<kMayBeNear>(block, lane, patch.point[first + p], wave, row);
      float* at = points + (first + p) * 8 * kLanes;
#pragma GCC unroll 3
      for (int c = 0; c < 3; ++c) {
        store(at + 2 * c * kLanes, row.re[c]);
        store(at + (2 * c + 1) * kLanes, row.im[c]);
        store(rows[p][2 * c], row.right_re[c]);
        store(rows[p][2 * c + 1], row.right_im[c]);
      }
      store(at + 6 * kLanes, row.plain_re);
      store(at + 7 * kLanes, row.plain_im);
    }
    for (int m = 0; m < patch.sources; m += kSources) {
      F sum[kSources][6];
      float* at = right + m * 6 * kLanes;
#pragma GCC unroll 4
      for (int j = 0; j < kSources; ++j)
#pragma GCC unroll 6
        for (int i = 0; i < 6; ++i) sum[j][i] = load(at + (j * 6 + i) * kLanes);
      for (int p = 0; p < count; ++p) {
        const float* source = patch.source + (first + p) * patch.sources + m;
#pragma GCC unroll 6
        for (int i = 0; i < 6; ++i) {
          const F value = load(rows[p][i]);
#pragma GCC unroll 4
          for (int j = 0; j < kSources; ++j) sum[j][i] += value * source[j];
        }
      }
#pragma GCC unroll 4
      for (int j = 0; j < kSources; ++j)
#pragma GCC unroll 6
        for (int i = 0; i < 6; ++i) store(at + (j * 6 + i) * kLanes, sum[j][i]);
    }
  }
}

/// calc_tile() of kWidth lanes from `lane` on; the buffers begin there, too.
inline void calc_lanes(const TestBlock& block, int lane, const Patch& patch, const WaveNumber& wave, const TileRoom& room, float* matrix,
                       float* right) {
  if (patch.may_be_near) {
    calc_points<true>(block, lane, patch, wave, room.point, right);
  } else {
    calc_points<false>(block, lane, patch, wave, room.point, right);
  }
  for (int t = 0; t < patch.facets; ++t) {
    const std::int32_t* p = patch.facet_points + 3 * t;
#pragma GCC unroll 2
    for (int part = 6; part < 8; ++part)
      store(room.facet + (2 * t + part - 6) * kLanes, load(room.point + (p[0] * 8 + part) * kLanes) +
                                                          load(room.point + (p[1] * 8 + part) * kLanes) +
                                                          load(room.point + (p[2] * 8 + part) * kLanes));
  }
  const float beta = wave.coupling;
  for (int j = 0; j < patch.nodes; ++j) {
    F sum[6] = {};
    for (int at = patch.first_point[j]; at < patch.first_point[j + 1]; ++at) {
      const float* point = room.point + patch.node_points[at] * 8 * kLanes;
#pragma GCC unroll 6
      for (int i = 0; i < 6; ++i) sum[i] += load(point + i * kLanes);
    }
    F re[3] = {}, im[3] = {};
    for (int at = patch.first_facet[j]; at < patch.first_facet[j + 1]; ++at) {
      const F x = load(room.facet + patch.node_facets[at] * 2 * kLanes), y = load(room.facet + (patch.node_facets[at] * 2 + 1) * kLanes);
#pragma GCC unroll 3
      for (int axis = 0; axis < 3; ++axis) {
        re[axis] += x * patch.node_curls[3 * at + axis];
        im[axis] += y * patch.node_curls[3 * at + axis];
      }
    }
    // + alpha curl . curl G, alpha = i beta
#pragma GCC unroll 3
    for (int c = 0; c < 3; ++c) {
      const F cx = load(block.curl[c][0] + lane), cy = load(block.curl[c][1] + lane), cz = load(block.curl[c][2] + lane);
      float* out = matrix + (j * 6 + 2 * c) * kLanes;
      store(out, sum[2 * c] - beta * (cx * im[0] + cy * im[1] + cz * im[2]));
      store(out + kLanes, sum[2 * c + 1] + beta * (cx * re[0] + cy * re[1] + cz * re[2]));
    }
  }
}

void calc_tile(const TestBlock& block, const Patch& patch, const WaveNumber& wave, const TileRoom& room, float* matrix, float* right) {
  for (int lane = 0; lane < kLanes; lane += kWidth)
    calc_lanes(block, lane, patch, wave, {room.point + lane, room.facet + lane}, matrix + lane, right + lane);
}

inline F load_unaligned(const float* at) {
  F value;
  __builtin_memcpy(&value, at, sizeof(F));
  return value;
}
inline void store_unaligned(float* at, F value) { __builtin_memcpy(at, &value, sizeof(F)); }

/// kRows rows, kVectors vectors of sides, the unknowns `first` to `last`; adds to y.
template <int kRows, int kVectors>
inline void multiply_some(const float* matrix, std::size_t unknowns, std::size_t first, std::size_t last, const float* x,
                          std::size_t stride, float* y) {
  F re[kRows][kVectors], im[kRows][kVectors];
#pragma GCC unroll 4
  for (int r = 0; r < kRows; ++r)
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
      re[r][v] = load_unaligned(y + r * 2 * stride + v * kWidth);
      im[r][v] = load_unaligned(y + (r * 2 + 1) * stride + v * kWidth);
    }
  for (std::size_t j = first; j < last; ++j) {
    F a[kVectors], b[kVectors];
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
      a[v] = load_unaligned(x + j * 2 * stride + v * kWidth);
      b[v] = load_unaligned(x + (j * 2 + 1) * stride + v * kWidth);
    }
#pragma GCC unroll 4
    for (int r = 0; r < kRows; ++r) {
      const float p = matrix[(r * unknowns + j) * 2], q = matrix[(r * unknowns + j) * 2 + 1];
#pragma GCC unroll 2
      for (int v = 0; v < kVectors; ++v) {
        re[r][v] += p * a[v];
        im[r][v] += p * b[v];
        re[r][v] -= q * b[v];
        im[r][v] += q * a[v];
      }
    }
  }
#pragma GCC unroll 4
  for (int r = 0; r < kRows; ++r)
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
      store_unaligned(y + r * 2 * stride + v * kWidth, re[r][v]);
      store_unaligned(y + (r * 2 + 1) * stride + v * kWidth, im[r][v]);
    }
}

template <int kVectors>
inline void multiply_vectors(const float* matrix, std::size_t rows, std::size_t unknowns, const float* x, std::size_t stride, float* y) {
  constexpr std::size_t kRun = 256;  // unknowns whose sides stay in the cache
  constexpr std::size_t kTogether = 4;
  for (std::size_t first = 0; first < unknowns; first += kRun) {
    const std::size_t last = unknowns - first < kRun ? unknowns : first + kRun;
    std::size_t row = 0;
    for (; row + kTogether <= rows; row += kTogether)
      multiply_some<kTogether, kVectors>(matrix + row * unknowns * 2, unknowns, first, last, x, stride, y + row * 2 * stride);
    for (; row < rows; ++row)
      multiply_some<1, kVectors>(matrix + row * unknowns * 2, unknowns, first, last, x, stride, y + row * 2 * stride);
  }
}

void multiply_rows(const float* matrix, std::size_t rows, std::size_t unknowns, const float* x, std::size_t vectors, float* y) {
  constexpr int kVectors = kWidth == kLanes ? 2 : 1;  // sums that fit into the registers
  const std::size_t stride = vectors * kLanes;
  for (std::size_t i = 0; i < rows * 2 * stride; ++i) y[i] = 0.0F;
  for (std::size_t at = 0; at < stride; at += kVectors * kWidth) {
    if (at + kVectors * kWidth <= stride) {
      multiply_vectors<kVectors>(matrix, rows, unknowns, x + at, stride, y + at);
    } else {
      multiply_vectors<1>(matrix, rows, unknowns, x + at, stride, y + at);
    }
  }
}

}  // namespace
}  // namespace carillon::air::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::air {

HWY_EXPORT(calc_tile);
HWY_EXPORT(multiply_rows);

void calc_tile(const TestBlock& block, const Patch& patch, const WaveNumber& wave, const TileRoom& room, float* matrix, float* right) {
  base::choose(HWY_DISPATCH_TABLE(calc_tile))(block, patch, wave, room, matrix, right);
}

void multiply_rows(const float* matrix, std::size_t rows, std::size_t unknowns, const float* x, std::size_t vectors, float* y) {
  base::choose(HWY_DISPATCH_TABLE(multiply_rows))(matrix, rows, unknowns, x, vectors, y);
}

}  // namespace carillon::air
#endif
