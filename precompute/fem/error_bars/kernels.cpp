// Method: loops over elements, nodes or edges; the modes of a block are the lanes of vectors, so that every access is one contiguous read
//   and no mode costs a pass of its own. Single precision but for the displacements of T10, whose differences are taken first. Sums are
//   collected over some elements in single, then in double precision.
// Source: Zienkiewicz and Zhu 1992, IJNME 33, 1331 and 1365 (recovery in patches).
// Deviations: the quadratic error field of a T10 is integrated exactly over the straight element, also where it is curved.
#include "precompute/fem/error_bars/kernels.hpp"

#include <algorithm>
#include <cmath>

#include "precompute/mesh/tet_mesh.hpp"
#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::error_bars::HWY_NAMESPACE {
namespace {

constexpr float kGaussNear = 0.58541019662496845F, kGaussFar = 0.13819660112501052F;
constexpr std::size_t kChunk = 32;  // elements whose sums are kept in single precision

using HalfDoubles = double __attribute__((vector_size(4 * kLanes)));

inline void flush(Lanes& from, DoubleLanes& to) {
  for (int l = 0; l < kLanes; ++l) to.lane[l] += from[l];
  from = Lanes{};
}

[[gnu::always_inline]] inline Lanes subtract(const FloatLanes& a, const FloatLanes& b) { return a.lane - b.lane; }
[[gnu::always_inline]] inline Lanes add_halves(const DoubleLanes& a, const DoubleLanes& b, double sign) {
  const auto* x = reinterpret_cast<const HalfDoubles*>(a.lane);
  const auto* y = reinterpret_cast<const HalfDoubles*>(b.lane);
  using HalfFloats = float __attribute__((vector_size(2 * kLanes)));
  const HalfFloats low = __builtin_convertvector(x[0] + sign * y[0], HalfFloats),
                   high = __builtin_convertvector(x[1] + sign * y[1], HalfFloats);
  static_assert(kLanes == 16);
  return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}
[[gnu::always_inline]] inline Lanes subtract(const DoubleLanes& a, const DoubleLanes& b) { return add_halves(a, b, -1.0); }

[[gnu::always_inline]] inline Lanes calc_sum(const FloatLanes& a, const FloatLanes& b) { return a.lane + b.lane; }
[[gnu::always_inline]] inline Lanes calc_sum(const DoubleLanes& a, const DoubleLanes& b) { return add_halves(a, b, 1.0); }

/// Mean over a straight T10 of the square of the field with these nodal values: 420 times its matrix has corners 6 and 1, corner to middle
/// -4 or -6, middles 32, 16 or 8.
[[gnu::always_inline]] inline Lanes integrate_square(const Lanes* u) {
  constexpr int kOpposite[6] = {5, 3, 4, 1, 2, 0};
  const Lanes corners = u[0] + u[1] + u[2] + u[3], middles = u[4] + u[5] + u[6] + u[7] + u[8] + u[9];
  Lanes sum = corners * corners + 16 * middles * middles - 12 * corners * middles;
  for (int i = 0; i < 4; ++i) sum += 5 * u[i] * u[i];
  for (int m = 0; m < 6; ++m)
    sum += u[4 + m] * (16 * u[4 + m] - 8 * u[4 + kOpposite[m]] + 4 * (u[mesh::kEdges[m][0]] + u[mesh::kEdges[m][1]]));
  return sum / 420;
}

/// sum over directions of u^T (M_lumped - M_consistent) u per mass of the element; d: displacements relative to node 0, which the
/// difference of the matrices, having no row sums, does not see.
template <int nodes>
[[gnu::always_inline]] inline Lanes calc_lumping(const Lanes (*d)[3]) {
  Lanes sum = {};
  for (int k = 0; k < 3; ++k) {
    if constexpr (nodes == 4) {
      const Lanes total = d[0][k] + d[1][k] + d[2][k];
      sum += (4 * (d[0][k] * d[0][k] + d[1][k] * d[1][k] + d[2][k] * d[2][k]) - total * total) / 20;
    } else {
      Lanes u[10] = {};
      for (int i = 1; i < 10; ++i) u[i] = d[i - 1][k];
      Lanes lumped = {};
      for (int i = 0; i < 4; ++i) lumped += u[i] * u[i] / 36;
      for (int m = 0; m < 6; ++m) lumped += 4 * u[4 + m] * u[4 + m] / 27;
      sum += lumped - integrate_square(u);
    }
  }
  return sum;
}

/// As fem assembles nearly incompressible T10: the bulk modulus is met by the mean of the dilatation, less by its variation.
[[gnu::always_inline]] inline void damp_dilatation(float part, Lanes (*strain)[6]) {
  if (part >= 1.0F) return;
  Lanes trace[4], mean = {};
  for (int s = 0; s < 4; ++s) {
    trace[s] = strain[s][0] + strain[s][1] + strain[s][2];
    mean += trace[s] * 0.25F;
  }
  for (int s = 0; s < 4; ++s)
    for (int k = 0; k < 3; ++k) strain[s][k] += (mean - trace[s]) * ((1.0F - part) / 3.0F);
}

/// Displacements relative to node 0.
template <int nodes, typename Displacement>
[[gnu::always_inline]] inline void load_differences(const Elements& elements, const Displacement* displacement, std::size_t e,
                                                    Lanes (*d)[3]) {
  const std::int32_t* node = &elements.node[e * nodes];
  const Displacement* origin = displacement + 3 * std::size_t(node[0]);
  for (int i = 1; i < nodes; ++i)
    for (int k = 0; k < 3; ++k) d[i - 1][k] = subtract(displacement[3 * std::size_t(node[i]) + k], origin[k]);
}

template <int nodes>
[[gnu::always_inline]] inline void calc_strain(const float* b, const Lanes (*d)[3], Lanes* strain) {
  Lanes g[3][3] = {};
  for (int i = 0; i < nodes - 1; ++i)
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l) g[k][l] += d[i][k] * b[3 * i + l];
  for (int k = 0; k < 3; ++k) strain[k] = g[k][k];
  strain[3] = g[1][2] + g[2][1];
  strain[4] = g[0][2] + g[2][0];
  strain[5] = g[0][1] + g[1][0];
}

/// q = U strain, in place.
[[gnu::always_inline]] inline void scale_strain(const float* root, Lanes* strain) {
  for (int r = 0; r < 6; ++r) {
    strain[r] *= root[7 * r];
    for (int c = r + 1; c < 6; ++c) strain[r] += strain[c] * root[6 * r + c];
  }
}

template <int nodes, int samples, int terms, typename Displacement>
void add_strains(const Elements& elements, bool lumped, const void* displacement, Strain* strains, Strain* patches,
                 DoubleLanes& difference) {
  for (std::size_t begin = 0; begin < elements.count; begin += kChunk) {
    Lanes lumping = {};
    for (std::size_t e = begin; e < std::min(elements.count, begin + kChunk); ++e) {
      Lanes d[nodes - 1][3];
      load_differences<nodes>(elements, static_cast<const Displacement*>(displacement), e, d);
      const std::int32_t material = elements.material[e];
      if (lumped) lumping += calc_lumping<nodes>(d) * (elements.volume[e] * elements.density[material]);
      Lanes q[samples][6];
      for (int s = 0; s < samples; ++s) calc_strain<nodes>(&elements.gradient[(e * samples + s) * (nodes - 1) * 3], d, q[s]);
      if constexpr (samples > 1) damp_dilatation(elements.dilatation[material], q);
      for (int s = 0; s < samples; ++s) {
        scale_strain(elements.root[material].data(), q[s]);
        if constexpr (samples > 1)
          for (int r = 0; r < 6; ++r) strains[e * samples + s][r] = q[s][r];
      }
      for (int v = 0; v < 4; ++v) {
        const float* w = &elements.weight[(e * 4 + v) * samples * terms];
        Strain* patch = patches + std::size_t(elements.patch[4 * e + v]) * terms;
        for (int t = 0; t < terms; ++t)
          for (int r = 0; r < 6; ++r) {
            Lanes sum = patch[t][r];
            for (int s = 0; s < samples; ++s) sum += w[s * terms + t] * q[s][r];
            patch[t][r] = sum;
          }
      }
    }
    flush(lumping, difference);
  }
}

void add_energies_t4(const Elements& elements, const std::int32_t* value_of, const Strain* values, const void* displacement, const Strain*,
                     DoubleLanes& error, DoubleLanes& singular, DoubleLanes& bent, DoubleLanes& energy) {
  for (std::size_t begin = 0; begin < elements.count; begin += kChunk) {
    Lanes errors = {}, singulars = {}, bents = {}, energies = {};
    for (std::size_t e = begin; e < std::min(elements.count, begin + kChunk); ++e) {
      Lanes d[3][3], q[6];
      load_differences<4>(elements, static_cast<const FloatLanes*>(displacement), e, d);
      calc_strain<4>(&elements.gradient[9 * e], d, q);
      scale_strain(elements.root[elements.material[e]].data(), q);
      Lanes squares = {}, own = {};
      for (int r = 0; r < 6; ++r) {
        Lanes sum = {};
        for (int v = 0; v < 4; ++v) {
          const Lanes off = values[value_of[4 * e + v]][r] - q[r];
          sum += off;
          squares += off * off;
        }
        squares += sum * sum;
        own += q[r] * q[r];
      }
      squares *= elements.volume[e] / 20;
      errors += squares;
      singulars += squares * elements.singular[e];
      bents += squares * elements.bent[e];
      energies += own * elements.volume[e];
    }
    flush(errors, error);
    flush(singulars, singular);
    flush(bents, bent);
    flush(energies, energy);
  }
}

void add_energies_t10(const Elements& elements, const std::int32_t* value_of, const Strain* values, const void*, const Strain* strains,
                      DoubleLanes& error, DoubleLanes& singular, DoubleLanes& bent, DoubleLanes& energy) {
  for (std::size_t begin = 0; begin < elements.count; begin += kChunk) {
    Lanes errors = {}, singulars = {}, bents = {}, energies = {};
    for (std::size_t e = begin; e < std::min(elements.count, begin + kChunk); ++e) {
      const Strain* q = strains + 4 * e;
      const std::int32_t* value = value_of + 10 * e;
      Lanes squares = {}, own = {};
      for (int r = 0; r < 6; ++r) {
        const Lanes far = (q[0][r] + q[1][r] + q[2][r] + q[3][r]) * kGaussFar;
        Lanes corner[4], d[10];  // of the linear field through the four points; recovered minus computed
        for (int v = 0; v < 4; ++v) {
          own += q[v][r] * q[v][r];
          corner[v] = (q[v][r] - far) * (1 / (kGaussNear - kGaussFar));
          d[v] = values[value[v]][r] - corner[v];
        }
        for (int m = 0; m < 6; ++m) d[4 + m] = values[value[4 + m]][r] - (corner[mesh::kEdges[m][0]] + corner[mesh::kEdges[m][1]]) * 0.5F;
        squares += integrate_square(d);
      }
      squares *= elements.volume[e] * elements.share[e];
      errors += squares;
      singulars += squares * elements.singular[e];
      bents += squares * elements.bent[e];
      energies += own * (elements.volume[e] / 4);
    }
    flush(errors, error);
    flush(singulars, singular);
    flush(bents, bent);
    flush(energies, energy);
  }
}

void find_middles(const std::vector<Middle>& middles, int materials, const Strain* patches, Strain* values) {
  for (const Middle& middle : middles)
    for (int m = 0; m < materials; ++m) {
      Strain value = {};
      for (int end = 0; end < 2; ++end) {
        const Strain* patch = patches + (std::size_t(middle.patch[end]) * materials + m) * 10;
        for (int t = 0; t < 10; ++t)
          for (int r = 0; r < 6; ++r) value[r] += patch[t][r] * (middle.monomials[end][t] / 2);
      }
      values[std::size_t(middle.node) * materials + m] = value;
    }
}

template <typename Displacement>
void add_shifts(const std::vector<Shift>& shifts, const Strain* values, const void* displacement, const DoubleLanes& lambda,
                DoubleLanes& change, DoubleLanes& magnitude) {
  const auto* u = static_cast<const Displacement*>(displacement);
  Lanes lambdas;
  for (int l = 0; l < kLanes; ++l) lambdas[l] = static_cast<float>(lambda.lane[l]);
  for (std::size_t begin = 0; begin < shifts.size(); begin += kChunk) {
    Lanes changes = {}, magnitudes = {};
    for (std::size_t i = begin; i < std::min(shifts.size(), begin + kChunk); ++i) {
      const Shift& shift = shifts[i];
      Lanes elastic = {}, kinetic = {};
      for (int k = 0; k < 3; ++k) {
        const Lanes sum = calc_sum(u[3 * std::size_t(shift.node[0]) + k], u[3 * std::size_t(shift.node[1]) + k]);
        kinetic += sum * sum;
      }
      for (int r = 0; r < 6; ++r) {
        const Lanes q = values[shift.value[0]][r] + values[shift.value[1]][r];
        elastic += q * q;
      }
      kinetic *= lambdas * shift.density;
      changes += (elastic - kinetic) * (0.25F * shift.volume_m3);
      magnitudes += (elastic + kinetic) * std::abs(0.25F * shift.volume_m3);
    }
    flush(changes, change);
    flush(magnitudes, magnitude);
  }
}

void add_tractions(const std::vector<Traction>& tractions, const Strain* values, DoubleLanes& error) {
  for (std::size_t begin = 0; begin < tractions.size(); begin += kChunk) {
    Lanes errors = {};
    for (std::size_t i = begin; i < std::min(tractions.size(), begin + kChunk); ++i) {
      const Traction& traction = tractions[i];
      Lanes part[3] = {};
      for (int r = 0; r < 6; ++r) {
        const Lanes q = values[traction.value][r];
        for (int k = 0; k < 3; ++k) part[k] += q * traction.part[6 * k + r];
      }
      errors += part[0] * part[0] + part[1] * part[1] + part[2] * part[2];
    }
    flush(errors, error);
  }
}

const ElementKernels kT4{add_strains<4, 1, 1, FloatLanes>, find_middles, add_energies_t4, add_shifts<FloatLanes>, add_tractions};
const ElementKernels kT10{add_strains<10, 4, 10, DoubleLanes>, find_middles, add_energies_t10, add_shifts<DoubleLanes>, add_tractions};

const ElementKernels& get_kernels(int nodes) { return nodes == 4 ? kT4 : kT10; }

}  // namespace
}  // namespace carillon::error_bars::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::error_bars {

HWY_EXPORT(get_kernels);

const ElementKernels& find_kernels(int nodes) { return base::choose(HWY_DISPATCH_TABLE(get_kernels))(nodes); }

}  // namespace carillon::error_bars
#endif
