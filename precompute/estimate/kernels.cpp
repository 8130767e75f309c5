// Method: loops over elements, nodes or edges; the modes of a block are the lanes of vectors, so that every access is one contiguous read
// and
//   no mode costs a pass of its own. Single precision but for the displacements, whose differences are taken first.
// Source: Zienkiewicz and Zhu 1992, IJNME 33, 1331 and 1365 (recovery in patches); HRZ weights of the ten nodes as a quadrature of squares.
// Deviations: the quadratic error field of a T10 is integrated with the positive HRZ weights instead of exactly.
#include "precompute/estimate/kernels.hpp"

#include "precompute/mesh/tet_mesh.hpp"

// Compiled for several instruction sets, chosen when the program starts.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define CARILLON_WIDE __attribute__((target_clones("arch=skylake-avx512", "arch=haswell", "default")))
#else
#define CARILLON_WIDE
#endif

namespace carillon::estimate {
namespace {

constexpr float kGaussNear = 0.58541019662496845F, kGaussFar = 0.13819660112501052F;

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
      // Consistent mass of the straight T10 in 420ths: corners 6 and 1, corner to middle -4 or -6, middles 32, 16 or 8.
      constexpr int kOpposite[6] = {5, 3, 4, 1, 2, 0};
      Lanes u[10] = {};
      for (int i = 1; i < 10; ++i) u[i] = d[i - 1][k];
      const Lanes corners = u[0] + u[1] + u[2] + u[3], middles = u[4] + u[5] + u[6] + u[7] + u[8] + u[9];
      Lanes lumped = {}, consistent = corners * corners + 16 * middles * middles - 12 * corners * middles;
      for (int i = 0; i < 4; ++i) {
        lumped += u[i] * u[i] / 36;
        consistent += 5 * u[i] * u[i];
      }
      for (int m = 0; m < 6; ++m) {
        lumped += 4 * u[4 + m] * u[4 + m] / 27;
        consistent += u[4 + m] * (16 * u[4 + m] - 8 * u[4 + kOpposite[m]] + 4 * (u[mesh::kEdges[m][0]] + u[mesh::kEdges[m][1]]));
      }
      sum += lumped - consistent / 420;
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

template <int nodes, int samples, int terms>
[[gnu::always_inline]] inline void find_strains_of(const Elements& elements, bool lumped, const DoubleLanes* displacement, Strain* strains,
                                                   Strain* patches, DoubleLanes& difference) {
  for (std::size_t e = 0; e < elements.count; ++e) {
    const std::int32_t* node = &elements.node[e * nodes];
    Lanes d[nodes - 1][3];
    for (int i = 1; i < nodes; ++i)
      for (int k = 0; k < 3; ++k)
        d[i - 1][k] =
            __builtin_convertvector(displacement[3 * std::size_t(node[i]) + k] - displacement[3 * std::size_t(node[0]) + k], Lanes);
    if (lumped)
      difference +=
          __builtin_convertvector(calc_lumping<nodes>(d) * (elements.volume[e] * elements.density[elements.material[e]]), DoubleLanes);
    const auto& root = elements.root[elements.material[e]];
    Lanes strain[samples][6];
    for (int s = 0; s < samples; ++s) {
      const float* b = &elements.gradient[(e * samples + s) * (nodes - 1) * 3];
      Lanes g[3][3] = {};
      for (int i = 0; i < nodes - 1; ++i)
        for (int k = 0; k < 3; ++k)
          for (int l = 0; l < 3; ++l) g[k][l] += d[i][k] * b[3 * i + l];
      for (int k = 0; k < 3; ++k) strain[s][k] = g[k][k];
      strain[s][3] = g[1][2] + g[2][1];
      strain[s][4] = g[0][2] + g[2][0];
      strain[s][5] = g[0][1] + g[1][0];
    }
    if constexpr (samples > 1) damp_dilatation(elements.dilatation[elements.material[e]], strain);
    for (int s = 0; s < samples; ++s) {
      Strain q;
      for (int r = 0; r < 6; ++r) {
        q[r] = strain[s][r] * root[7 * r];
        for (int c = r + 1; c < 6; ++c) q[r] += strain[s][c] * root[6 * r + c];
      }
      strains[e * samples + s] = q;
      for (int v = 0; v < 4; ++v) {
        const float* w = &elements.weight[((e * 4 + v) * samples + s) * terms];
        Strain* patch = patches + std::size_t(elements.patch[4 * e + v]) * terms;
        for (int t = 0; t < terms; ++t)
          for (int r = 0; r < 6; ++r) patch[t][r] += w[t] * q[r];
      }
    }
  }
}

CARILLON_WIDE void find_strains_t4(const Elements& elements, bool lumped, const DoubleLanes* displacement, Strain* strains, Strain* patches,
                                   DoubleLanes& difference) {
  find_strains_of<4, 1, 1>(elements, lumped, displacement, strains, patches, difference);
}

CARILLON_WIDE void find_strains_t10(const Elements& elements, bool lumped, const DoubleLanes* displacement, Strain* strains,
                                    Strain* patches, DoubleLanes& difference) {
  find_strains_of<10, 4, 10>(elements, lumped, displacement, strains, patches, difference);
}

CARILLON_WIDE void add_energies_t4(const Elements& elements, const std::int32_t* value_of, const Strain* values, const Strain* strains,
                                   DoubleLanes& error, DoubleLanes& energy) {
  for (std::size_t e = 0; e < elements.count; ++e) {
    const Strain& q = strains[e];
    Lanes squares = {}, own = {};
    for (int r = 0; r < 6; ++r) {
      Lanes sum = {};
      for (int v = 0; v < 4; ++v) {
        const Lanes d = values[value_of[4 * e + v]][r] - q[r];
        sum += d;
        squares += d * d;
      }
      squares += sum * sum;
      own += q[r] * q[r];
    }
    error += __builtin_convertvector(squares * (elements.volume[e] / 20), DoubleLanes);
    energy += __builtin_convertvector(own * elements.volume[e], DoubleLanes);
  }
}

CARILLON_WIDE void add_energies_t10(const Elements& elements, const std::int32_t* value_of, const Strain* values, const Strain* strains,
                                    DoubleLanes& error, DoubleLanes& energy) {
  constexpr float kCorner = 1.0F / 36, kMiddle = 4.0F / 27;
  for (std::size_t e = 0; e < elements.count; ++e) {
    const Strain* q = strains + 4 * e;
    const std::int32_t* value = value_of + 10 * e;
    Lanes at_corners = {}, at_middles = {}, own = {};
    for (int r = 0; r < 6; ++r) {
      const Lanes far = (q[0][r] + q[1][r] + q[2][r] + q[3][r]) * kGaussFar;
      Lanes corner[4];  // of the linear field through the four points
      for (int v = 0; v < 4; ++v) {
        own += q[v][r] * q[v][r];
        corner[v] = (q[v][r] - far) * (1 / (kGaussNear - kGaussFar));
        const Lanes d = values[value[v]][r] - corner[v];
        at_corners += d * d;
      }
      for (int m = 0; m < 6; ++m) {
        const Lanes d = values[value[4 + m]][r] - (corner[mesh::kEdges[m][0]] + corner[mesh::kEdges[m][1]]) * 0.5F;
        at_middles += d * d;
      }
    }
    error += __builtin_convertvector((at_corners * kCorner + at_middles * kMiddle) * elements.volume[e], DoubleLanes);
    energy += __builtin_convertvector(own * (elements.volume[e] / 4), DoubleLanes);
  }
}

}  // namespace

void find_strains(const Elements& elements, bool lumped, const DoubleLanes* displacement, Strain* strains, Strain* patches,
                  DoubleLanes& difference) {
  (elements.nodes == 4 ? find_strains_t4 : find_strains_t10)(elements, lumped, displacement, strains, patches, difference);
}

CARILLON_WIDE void find_middles(const std::vector<Middle>& middles, int materials, const Strain* patches, Strain* values) {
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

void add_energies(const Elements& elements, const std::int32_t* value_of, const Strain* values, const Strain* strains, DoubleLanes& error,
                  DoubleLanes& energy) {
  (elements.nodes == 4 ? add_energies_t4 : add_energies_t10)(elements, value_of, values, strains, error, energy);
}

CARILLON_WIDE void add_shifts(const std::vector<Shift>& shifts, const Strain* values, const DoubleLanes* displacement,
                              const DoubleLanes& lambda, DoubleLanes& change, DoubleLanes& magnitude) {
  for (const Shift& shift : shifts) {
    DoubleLanes kinetic = {};
    for (int k = 0; k < 3; ++k) {
      const DoubleLanes u = (displacement[3 * std::size_t(shift.node[0]) + k] + displacement[3 * std::size_t(shift.node[1]) + k]) * 0.5;
      kinetic += u * u;
    }
    Lanes elastic = {};
    for (int r = 0; r < 6; ++r) {
      const Lanes q = (values[shift.value[0]][r] + values[shift.value[1]][r]) * 0.5F;
      elastic += q * q;
    }
    const DoubleLanes stretched = __builtin_convertvector(elastic, DoubleLanes) * double(shift.volume_m3);
    const DoubleLanes moved = kinetic * lambda * double(shift.density * shift.volume_m3);
    change += stretched - moved;
    magnitude += stretched * (shift.volume_m3 < 0 ? -1.0 : 1.0) + moved * (shift.volume_m3 < 0 ? -1.0 : 1.0);
  }
}

}  // namespace carillon::estimate
