// Method: the stiffness depends on the element's shape by the integrals P_ij = integral b_i b_j^T dV of products of gradients. They are
//   constant for T4; a straight T10 is a fixed combination of T4 ones; a curved one uses a 14-point rule. The material contracts them. The
//   mass of a curved T10 is exact: its Jacobian is a cubic with 20 coefficients, and integral N_i N_j (cubic k) is a table. Nearly
//   incompressible T10: only the mean dilatation of an element meets the part of lambda above kMaxDisplacementLambda mu. Ten nodes can
//   satisfy one volume constraint per element and still bend, but not a constraint at every point.
// Source: OSG02 section 3.2; Zienkiewicz and Taylor, "The Finite Element Method", vol. 1 (T10); Hinton, Rock and Zienkiewicz 1976,
//   Earthquake Eng. Struct. Dyn. 4, 245 (HRZ lumping); Nagtegaal, Parks and Rice 1974, CMAME 4, 153, and Malkus and Hughes 1978, CMAME 15,
//   63 (mean dilatation, selective integration).
// Deviations: OSG02 eq. 12 is printed with -vol/2; stiffness is minus the Jacobian of the force, which gives +vol. OSG02's row-sum lumping
//   (eq. 15) is negative at the corners of a T10, so T10 uses HRZ: the diagonal of the consistent mass scaled to the true mass. Those
//   papers apply mean dilatation to all of lambda; here it applies to the part above a multiple of mu, so that nu up to 0.4545 keeps the
//   standard form and quadratic elements keep their order.
#include "precompute/fem/element.hpp"

#include <algorithm>

namespace carillon::fem {
namespace {

constexpr int kPairs = kMaxNodes * (kMaxNodes + 1) / 2;

/// (n, n) blocks of 3 x 3, i <= j used: P_ij^rc = integral of d N_i / d x_r times d N_j / d x_c.
struct Products {
  int nodes = 0;
  std::array<double, 9 * kMaxNodes * kMaxNodes> value{};
  double* at(int i, int j) { return value.data() + 9 * (i * nodes + j); }
  const double* at(int i, int j) const { return value.data() + 9 * (i * nodes + j); }
};

/// Stiffness block for the block `p` of products. Isotropic: lambda P + mu (P^T + tr P I); otherwise C contracted.
inline void contract(const double* p, const Solid& solid, double lambda, double* k) {
  if (solid.isotropic) {
    const double mu = solid.lame_mu_pa, trace = mu * (p[0] + p[4] + p[8]);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) k[3 * r + c] = lambda * p[3 * r + c] + mu * p[3 * c + r] + (r == c ? trace : 0.0);
    return;
  }
  for (int rc = 0; rc < 9; ++rc) {
    const double* tensor = &solid.tensor_pa[9 * rc];
    double sum = 0.0;
    for (int bd = 0; bd < 9; ++bd) sum += tensor[bd] * p[bd];
    k[rc] = sum;
  }
}

void set_block(const double* k, int i, int j, ElementMatrices& out) {
  const int width = 3 * out.nodes;
  double* upper = &out.stiffness[3 * i * width + 3 * j];
  double* lower = &out.stiffness[3 * j * width + 3 * i];
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      upper[r * width + c] = k[3 * r + c];
      lower[c * width + r] = k[3 * r + c];
    }
}

void set_stiffness(const Products& products, const Solid& solid, double lambda, ElementMatrices& out) {
  std::array<double, 9> k;
  for (int i = 0; i < out.nodes; ++i)
    for (int j = i; j < out.nodes; ++j) {
      contract(products.at(i, j), solid, lambda, k.data());
      set_block(k.data(), i, j, out);
    }
}

/// Gradients of the barycentric coordinates and the volume of a straight tetrahedron.
double calc_linear(std::span<const Vec3> x, std::array<Vec3, 4>& b) {
  const std::array<Vec3, 3> e{x[1] - x[0], x[2] - x[0], x[3] - x[0]};
  const std::array<Vec3, 3> area{cross(e[1], e[2]), cross(e[2], e[0]), cross(e[0], e[1])};
  const double determinant = dot(e[0], area[0]);
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i) b[i + 1][k] = area[i][k] / determinant;
    b[0][k] = -(b[1][k] + b[2][k] + b[3][k]);
  }
  return determinant / 6.0;
}

/// Integral of L_a L_b over the element, relative to its volume.
constexpr double find_moment(int a, int b) { return a == b ? 0.1 : 0.05; }

/// Products of a straight four-node tetrahedron, all blocks.
Products calc_linear_products(const std::array<Vec3, 4>& b, double volume) {
  Products products;
  products.nodes = 4;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) products.at(i, j)[3 * r + c] = volume * b[i][r] * b[j][c];
  return products;
}

/// N_i of a T10 has d N_i / d L_a for one corner a (corner nodes: 4 L_a - 1) or two (mid nodes: 4 times the other end's L).
/// G_ij^ab = integral (d N_i / d L_a) (d N_j / d L_b) dV / V, so that K_ij = sum over a, b of G_ij^ab K_ab of the linear tetrahedron.
struct ReferenceProducts {
  struct Term {
    int a, b;
    double factor;
  };
  std::array<std::array<Term, 4>, kPairs> terms{};
  std::array<int, kPairs> count{};
};

const ReferenceProducts& get_reference_products() {
  static const ReferenceProducts products = [] {
    struct Slope {
      int along, of;  // d N / d L_along = 4 L_of + offset
      double offset;
    };
    const auto find_slopes = [](int i) {
      if (i < 4) return std::vector<Slope>{{i, i, -1.0}};
      const auto [a, b] = mesh::kEdges[i - 4];
      return std::vector<Slope>{{a, b, 0.0}, {b, a, 0.0}};
    };
    ReferenceProducts made;
    int pair = 0;
    for (int i = 0; i < kMaxNodes; ++i)
      for (int j = i; j < kMaxNodes; ++j, ++pair)
        for (const Slope& p : find_slopes(i))
          for (const Slope& q : find_slopes(j))
            made.terms[pair][made.count[pair]++] = {p.along, q.along,
                                                    16 * find_moment(p.of, q.of) + p.offset + q.offset + p.offset * q.offset};
    return made;
  }();
  return products;
}

/// m_ij / (rho V) of the straight T10, in 420ths, from integral L0^a L1^b L2^c L3^d dV = 6 V a! b! c! d! / (a + b + c + d + 3)!.
double straight_mass_420(int i, int j) {
  if (i > j) std::swap(i, j);
  if (j < 4) return i == j ? 6 : 1;
  const auto& edge = mesh::kEdges[j - 4];
  if (i < 4) return i == edge[0] || i == edge[1] ? -4 : -6;
  if (i == j) return 32;
  const auto& other = mesh::kEdges[i - 4];
  const bool touch = edge[0] == other[0] || edge[0] == other[1] || edge[1] == other[0] || edge[1] == other[1];
  return touch ? 16 : 8;
}

void set_straight_mass(double mass_kg, ElementMatrices& out) {
  static const std::array<double, kMaxNodes* kMaxNodes> kParts = [] {
    std::array<double, kMaxNodes * kMaxNodes> parts{};
    for (int i = 0; i < kMaxNodes; ++i)
      for (int j = 0; j < kMaxNodes; ++j) parts[i * kMaxNodes + j] = straight_mass_420(i, j) / 420.0;
    return parts;
  }();
  for (std::size_t i = 0; i < kParts.size(); ++i) out.mass[i] = mass_kg * kParts[i];
}

void set_straight_stiffness(const std::array<Vec3, 4>& b, double volume, const Solid& solid, ElementMatrices& out) {
  const Products products = calc_linear_products(b, volume);
  std::array<std::array<double, 9>, 16> linear;
  for (int a = 0; a < 4; ++a)
    for (int c = 0; c < 4; ++c) contract(products.at(a, c), solid, solid.displacement_lambda_pa, linear[4 * a + c].data());
  const ReferenceProducts& reference = get_reference_products();
  int pair = 0;
  for (int i = 0; i < kMaxNodes; ++i)
    for (int j = i; j < kMaxNodes; ++j, ++pair) {
      std::array<double, 9> k{};
      for (int t = 0; t < reference.count[pair]; ++t) {
        const auto& [a, c, factor] = reference.terms[pair][t];
        for (int v = 0; v < 9; ++v) k[v] += factor * linear[4 * a + c][v];
      }
      set_block(k.data(), i, j, out);
    }
}

/// d V and the gradients of the ten shape functions at the fourteen points.
struct Gradients {
  std::array<double, 14> dv{};
  std::array<std::array<double, 3 * kMaxNodes>, 14> b{};  // d N_i / d x_r at 3 i + r
  std::array<Jacobian, 14> jacobian{};
};

/// False when the Jacobian is not positive at a node or a point.
bool calc_gradients(std::span<const Vec3> x, Gradients& out) {
  static const std::vector<Shape> kShapes = calc_shapes(get_rule_of_degree_5());
  static const std::vector<Shape> kNodes = [] {
    std::vector<Shape> shapes;
    for (int i = 0; i < kMaxNodes; ++i) {
      Barycentric l{};
      if (i < 4) {
        l[i] = 1.0;
      } else {
        l[mesh::kEdges[i - 4][0]] = l[mesh::kEdges[i - 4][1]] = 0.5;
      }
      shapes.push_back(calc_shape(l));
    }
    return shapes;
  }();
  for (const Shape& shape : kNodes)
    if (!(calc_determinant(x, shape) > 0.0)) return false;
  for (std::size_t q = 0; q < 14; ++q) {
    const Jacobian jacobian = calc_jacobian(x, kShapes[q]);
    if (!(jacobian.determinant > 0.0)) return false;
    out.jacobian[q] = jacobian;
    out.dv[q] = get_rule_of_degree_5()[q].weight * jacobian.determinant / 6.0;
    out.b[q].fill(0.0);
    for (int i = 0; i < kMaxNodes; ++i)
      for (int d = 0; d < 3; ++d)
        for (int r = 0; r < 3; ++r) out.b[q][3 * i + r] += kShapes[q].derivative[i][d] * jacobian.inverse[d][r];
  }
  return true;
}

Products calc_curved_products(const Gradients& gradients) {
  constexpr int kWidth = 3 * kMaxNodes;
  std::array<std::array<double, kWidth>, kWidth> sum{};  // rows (i, r), columns (j, c), upper triangle of blocks
  for (int q = 0; q < 14; ++q) {
    const auto& b = gradients.b[q];
    for (int row = 0; row < kWidth; ++row) {
      const double weighed = gradients.dv[q] * b[row];
      for (int column = row - row % 3; column < kWidth; ++column) sum[row][column] += weighed * b[column];
    }
  }
  Products products;
  products.nodes = kMaxNodes;
  for (int i = 0; i < kMaxNodes; ++i)
    for (int j = i; j < kMaxNodes; ++j)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) products.at(i, j)[3 * r + c] = sum[3 * i + r][3 * j + c];
  return products;
}

/// M_ij / rho of a curved T10 and its volume, exactly.
double calc_curved_mass(std::span<const Vec3> x, std::array<double, kMaxNodes * kMaxNodes>& mass) {
  static const std::array<Shape, 20> kThirds = [] {
    std::array<Shape, 20> shapes;
    for (int k = 0; k < 20; ++k) shapes[k] = calc_shape(get_thirds()[k]);
    return shapes;
  }();
  // integral N_i N_j (cubic k) dV / V of the reference tetrahedron, divided by its six
  static const std::vector<double> kTable = [] {
    std::vector<double> table(20 * kMaxNodes * kMaxNodes, 0.0);
    for (const Point& point : get_rule_of_degree_7()) {
      const auto value = calc_shape(point.at).value;
      const auto cubic = calc_cubics(point.at);
      for (int k = 0; k < 20; ++k)
        for (int i = 0; i < kMaxNodes; ++i)
          for (int j = 0; j < kMaxNodes; ++j)
            table[(k * kMaxNodes + i) * kMaxNodes + j] += point.weight / 6 * cubic[k] * value[i] * value[j];
    }
    return table;
  }();
  mass.fill(0.0);
  for (int k = 0; k < 20; ++k) {
    const double determinant = calc_determinant(x, kThirds[k]);
    const double* table = &kTable[k * kMaxNodes * kMaxNodes];
    for (int ij = 0; ij < kMaxNodes * kMaxNodes; ++ij) mass[ij] += determinant * table[ij];
  }
  double volume = 0.0;
  for (const double m : mass) volume += m;
  return volume;
}

/// Integral of div u over the element per degree of freedom.
using Divergence = std::array<double, 3 * kMaxNodes>;

/// Adds the excess of the bulk modulus for the mean dilatation only: excess (integral div u)^2 / V.
void add_mean_dilatation(const Divergence& divergence, double volume, double excess, ElementMatrices& out) {
  const int width = 3 * out.nodes;
  for (int row = 0; row < width; ++row)
    for (int column = 0; column < width; ++column)
      out.stiffness[row * width + column] += excess / volume * divergence[row] * divergence[column];
}

void lump_hrz(ElementMatrices& out, double mass_kg) {
  const int n = out.nodes;
  double trace = 0.0;
  for (int i = 0; i < n; ++i) trace += out.mass[i * n + i];
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) out.mass[i * n + j] = i == j ? out.mass[i * n + i] * mass_kg / trace : 0.0;
}

/// K and M of a T4 from the gradients b and the volume of the tetrahedron.
void calc_t4(const std::array<Vec3, 4>& b, double volume, const Solid& solid, ElementMatrices& out) {
  set_stiffness(calc_linear_products(b, volume), solid, solid.displacement_lambda_pa + solid.mean_dilatation_modulus_pa, out);
  if (!solid.isotropic && solid.mean_dilatation_modulus_pa > 0) {
    Divergence divergence{};
    for (int i = 0; i < 4; ++i)
      for (int r = 0; r < 3; ++r) divergence[3 * i + r] = volume * b[i][r];
    add_mean_dilatation(divergence, volume, solid.mean_dilatation_modulus_pa, out);
  }
  const double mass_kg = solid.density_kg_m3 * volume;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) out.mass[i * 4 + j] = mass_kg / 20.0 * (i == j ? 2 : 1);
}

/// K and M of a straight T10.
void calc_straight_t10(const std::array<Vec3, 4>& b, double volume, const Solid& solid, ElementMatrices& out) {
  set_straight_stiffness(b, volume, solid, out);
  set_straight_mass(solid.density_kg_m3 * volume, out);
  if (!(solid.mean_dilatation_modulus_pa > 0)) return;
  // integral d N / d L_a is 0 for corners (4 L_a - 1) and V for mid nodes (4 L_b)
  Divergence divergence{};
  for (int e = 0; e < 6; ++e)
    for (int r = 0; r < 3; ++r) divergence[12 + 3 * e + r] = volume * (b[mesh::kEdges[e][0]][r] + b[mesh::kEdges[e][1]][r]);
  add_mean_dilatation(divergence, volume, solid.mean_dilatation_modulus_pa, out);
}

/// K and M of a curved T10; mass_kg becomes that of the element. False when the Jacobian is not positive everywhere.
bool calc_curved_t10(std::span<const Vec3> x, const Solid& solid, double& mass_kg, ElementMatrices& out) {
  Gradients gradients;
  if (!calc_gradients(x, gradients)) return false;
  set_stiffness(calc_curved_products(gradients), solid, solid.displacement_lambda_pa, out);
  if (solid.mean_dilatation_modulus_pa > 0) {
    Divergence divergence{};
    double volume = 0.0;
    for (std::size_t q = 0; q < 14; ++q) {
      volume += gradients.dv[q];
      for (std::size_t i = 0; i < divergence.size(); ++i) divergence[i] += gradients.dv[q] * gradients.b[q][i];
    }
    add_mean_dilatation(divergence, volume, solid.mean_dilatation_modulus_pa, out);
  }
  mass_kg = solid.density_kg_m3 * calc_curved_mass(x, out.mass);
  for (double& m : out.mass) m *= solid.density_kg_m3;
  return true;
}

}  // namespace

bool is_straight(std::span<const Vec3> x) {
  for (int e = 0; e < 6; ++e) {
    const Vec3 &a = x[mesh::kEdges[e][0]], &b = x[mesh::kEdges[e][1]];
    double off = 0.0, length = 0.0;
    for (int k = 0; k < 3; ++k) {
      const double bow = x[4 + e][k] - (a[k] + b[k]) / 2, edge = b[k] - a[k];
      off += bow * bow;
      length += edge * edge;
    }
    if (off > 1e-12 * length) return false;
  }
  return true;
}

double calc_mean_dilatation_modulus_pa(const material::Elasticity& c) {
  // C s = 1 for the normal strains s under a unit pressure, by elimination; C is positive definite.
  std::array<std::array<double, 7>, 6> row{};
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) row[i][j] = c[6 * i + j];
    row[i][6] = i < 3 ? 1.0 : 0.0;
  }
  for (int p = 0; p < 6; ++p)
    for (int i = 0; i < 6; ++i) {
      if (i == p) continue;
      const double factor = row[i][p] / row[p][p];
      for (int j = p; j < 7; ++j) row[i][j] -= factor * row[p][j];
    }
  double dilatation = 0.0;
  for (int i = 0; i < 3; ++i) dilatation += row[i][6] / row[i][i];
  const double bulk = 1 / dilatation;
  return std::max(bulk - (kMaxDisplacementLambda + 2.0 / 3) * material::calc_mean_shear_pa(c), 0.0);
}

Solid::Solid(const material::Material& material, bool full)
    : isotropic(!material.orthotropic), lame_mu_pa(material.lame_mu_pa()), density_kg_m3(material.density_kg_m3) {
  if (isotropic) {
    mean_dilatation_modulus_pa = full ? 0.0 : std::max(material.lame_lambda_pa() - kMaxDisplacementLambda * lame_mu_pa, 0.0);
    displacement_lambda_pa = material.lame_lambda_pa() - mean_dilatation_modulus_pa;
    return;
  }
  constexpr int kVoigt[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};
  const material::Elasticity c = material.calc_elasticity_pa();
  mean_dilatation_modulus_pa = full ? 0.0 : calc_mean_dilatation_modulus_pa(c);
  for (int r = 0; r < 3; ++r)
    for (int s = 0; s < 3; ++s)
      for (int b = 0; b < 3; ++b)
        for (int d = 0; d < 3; ++d)
          tensor_pa[27 * r + 9 * s + 3 * b + d] =
              c[6 * kVoigt[r][b] + kVoigt[s][d]] - (r == b && s == d ? mean_dilatation_modulus_pa : 0.0);
}

bool calc_element(std::span<const Vec3> x, const Solid& solid, job::Mass mass, ElementMatrices& out) {
  out.nodes = static_cast<int>(x.size());
  std::array<Vec3, 4> b;
  const double volume = calc_linear(x.first(4), b);
  double mass_kg = solid.density_kg_m3 * volume;
  if (out.nodes == kMaxNodes && !is_straight(x)) {
    if (!calc_curved_t10(x, solid, mass_kg, out)) return false;
  } else {
    if (!(volume > 0.0)) return false;
    out.nodes == 4 ? calc_t4(b, volume, solid, out) : calc_straight_t10(b, volume, solid, out);
  }
  if (mass == job::Mass::lumped) lump_hrz(out, mass_kg);  // for the T4, with a constant diagonal, this equals row-sum lumping
  return true;
}

ElementMoments calc_moments(std::span<const Vec3> x, double density_kg_m3) {
  // Isoparametric: x = sum N_i x_i, so the mass matrix integrates positions and their products.
  ElementMatrices m;
  const int n = static_cast<int>(x.size());
  ElementMoments moments;
  std::array<Vec3, 4> b;
  moments.volume_m3 = calc_linear(x.first(4), b);
  if (n == 4 || is_straight(x)) {
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) m.mass[i * 4 + j] = moments.volume_m3 * find_moment(i, j);
    x = x.first(4);
  } else {
    moments.volume_m3 = calc_curved_mass(x, m.mass);
  }
  moments.mass_kg = density_kg_m3 * moments.volume_m3;
  const std::size_t count = x.size();
  for (std::size_t i = 0; i < count; ++i) {
    Vec3 sum{};  // integral rho N_i x
    for (std::size_t j = 0; j < count; ++j)
      for (int k = 0; k < 3; ++k) sum[k] += density_kg_m3 * m.mass[i * count + j] * x[j][k];
    for (int r = 0; r < 3; ++r) {
      moments.first_kg_m[r] += sum[r];
      for (int c = 0; c < 3; ++c) moments.second_kg_m2[3 * r + c] += x[i][r] * sum[c];
    }
  }
  return moments;
}

}  // namespace carillon::fem
