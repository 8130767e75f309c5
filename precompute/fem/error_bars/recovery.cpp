// Method: at every vertex a polynomial (linear for T4, quadratic for T10) is fitted by least squares to the strains of the surrounding
//   elements at their superconvergent points (centroid; the four points of degree 2). The fit is linear in the strains and stored as
//   weights. If the samples leave a term of the highest degree undetermined (a corner with one element), a small ridge sets it to zero.
//   Terms of lower degree have no ridge: linear strains must be recovered exactly in every patch, or bending would be taken for an error
//   wherever patches are one-sided, as on all of a slender bar.
//   Fitted strains show only errors that differ between elements. Elements wider than the boundary layer at a free edge (torsion of a
//   strip: as wide as the strip is thick) all lack the layer and agree. The fit then leaves a traction on the free surface. The energy of
//   the layer that would cancel a traction t is t . A^-1 . t times a depth, A = n . C . n being the elasticity along the normal n: for a
//   traction linear through a strip of thickness h the depth is 0.315 h (St Venant: J = b h^3 / 3 (1 - 0.63 h / b)). The traction part of a
//   scaled strain is a projection.
// Source: Zienkiewicz and Zhu 1992, IJNME 33, 1331 ("superconvergent patch recovery"); Timoshenko and Goodier 1970, Theory of Elasticity,
//   ch. 10 (torsion of a strip).
// Deviations: ridge instead of wider patches, which would need more than one layer of halo elements; strains scaled by the root of the
//   elasticity. Tractions are omitted for T4 and lumped masses, whose other errors are many times greater.
#include "precompute/fem/error_bars/recovery.hpp"

#include <fmt/core.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <compare>
#include <map>
#include <memory>
#include <numeric>

#include "precompute/fem/element.hpp"
#include "precompute/fem/error_bars/surface.hpp"
#include "precompute/la/decompositions.hpp"
#include "precompute/mesh/faces.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::error_bars {
namespace {

constexpr double kRidgeT4 = 1e-3, kRidgeT10 = 1e-2;  // from 1e-4 ... 1: smallest scatter on the training bodies of docs/error-bars.md
// Depth of the layer relative to the size of an element at the surface: smallest scatter on strips and training bodies.
constexpr double kLayer = 0.125;
// Of the estimate of T10 at inward edges. Ratio of true to estimated error at 270 degrees: 0.66, in walls of one layer 0.6; three quarters
// of the estimate lie in the elements at the edge.
constexpr float kInwardShare = 0.5F;
constexpr double kFlatness = 1e-10;  // tolerance for flat elements in the terms without ridge

/// 1, x, y, z, xx, yy, zz, xy, yz, xz relative to the patch's vertex, in units of `scale`.
std::array<double, 10> calc_monomials(const Vec3& at, const Vec3& vertex, double scale) {
  const double x = (at[0] - vertex[0]) / scale, y = (at[1] - vertex[1]) / scale, z = (at[2] - vertex[2]) / scale;
  return {1, x, y, z, x * x, y * y, z * z, x * y, y * z, x * z};
}

/// Shape function gradients and volume of one sample.
struct Sample {
  std::array<Vec3, 10> gradient{};
  double volume_m3 = 0.0;
};

/// One sample of an element: `l` is ignored for T4.
Sample calc_sample(std::span<const Vec3> x, const std::array<double, 4>& l) {
  const int n = static_cast<int>(x.size());
  std::array<std::array<double, 4>, 10> by_l{};  // d N_i / d L_j
  for (int i = 0; i < 4; ++i) {
    by_l[i][i] = n == 4 ? 1 : 4 * l[i] - 1;
  }
  for (int m = 4; m < n; ++m) {
    const auto [a, b] = mesh::kEdges[m - 4];
    by_l[m][a] = 4 * l[b];
    by_l[m][b] = 4 * l[a];
  }
  Sample sample;
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();  // d x_k / d L_d, d = 1 2 3
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 3; ++k) {
      for (int d = 0; d < 3; ++d) jacobian(k, d) += x[i][k] * (by_l[i][d + 1] - by_l[i][0]);
    }
  const Eigen::Matrix3d inverse = jacobian.inverse();
  sample.volume_m3 = jacobian.determinant() / 6;
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 3; ++k)
      for (int d = 0; d < 3; ++d) sample.gradient[i][k] += (by_l[i][d + 1] - by_l[i][0]) * inverse(d, k);
  return sample;
}

/// Position of a sample: calc_sample's `at` only.
Vec3 calc_place(std::span<const Vec3> x, const std::array<double, 4>& l) {
  Vec3 at{};
  const auto add = [&](const Vec3& node, double value) {
    for (int k = 0; k < 3; ++k) at[k] += value * node[k];
  };
  for (int i = 0; i < 4; ++i) add(x[i], x.size() == 4 ? l[i] : l[i] * (2 * l[i] - 1));
  for (std::size_t m = 4; m < x.size(); ++m) add(x[m], 4 * l[mesh::kEdges[m - 4][0]] * l[mesh::kEdges[m - 4][1]]);
  return at;
}

constexpr double kNear = 0.58541019662496845, kFar = 0.13819660112501052;

std::array<double, 4> find_place(int samples, int s) {
  if (samples == 1) return {0.25, 0.25, 0.25, 0.25};
  std::array<double, 4> l{kFar, kFar, kFar, kFar};
  l[s] = kNear;
  return l;
}

std::array<float, 36> calc_root(const Solid& solid) {
  using Matrix6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  la::Matrix upper = Eigen::Map<const Matrix6>(solid.elasticity_pa.data());
  if (la::factorise_cholesky(upper) != 0) throw InputError("a material's elasticity is not positive definite; correct its constants");
  std::array<float, 36> root{};
  for (int r = 0; r < 6; ++r)
    for (int c = r; c < 6; ++c) root[6 * r + c] = static_cast<float>(upper(r, c));
  return root;
}

/// sqrt(K_full / K) of the bulk moduli for the variation and the mean of a T10's dilatation; fem::Solid::mean_dilatation_modulus_pa.
float find_dilatation(const Solid& solid) {
  const double mean = fem::calc_mean_dilatation_modulus_pa(solid.elasticity_pa);
  if (mean == 0.0) return 1.0F;
  const double full = (fem::kMaxDisplacementLambda + 2.0 / 3) * material::calc_mean_shear_pa(solid.elasticity_pa);
  return static_cast<float>(std::sqrt(full / (full + mean)));
}

/// Normal matrices of all patches, summed over the ranks, then their regularised inverses.
class Patches {
 public:
  Patches(int terms, std::size_t count, double scale) : terms_(terms), scale_(scale), normal_(count * terms * terms, 0.0) {}

  std::array<double, 10> monomials(const Vec3& at, const Vec3& vertex) const { return calc_monomials(at, vertex, scale_); }

  void add(std::size_t patch, const std::array<double, 10>& p) {
    double* n = &normal_[patch * terms_ * terms_];
    for (int r = 0; r < terms_; ++r)
      for (int c = 0; c < terms_; ++c) n[r * terms_ + c] += p[r] * p[c];
  }

  void sum(comm::HaloExchange& vertices, int materials) {
    vertices.sum(normal_.data(), static_cast<std::size_t>(terms_) * terms_ * materials);
  }

  /// N becomes D (D N D + ridge)^-1 D with D = diag(N)^-1/2; ridge on the terms of the highest degree only.
  void invert() {
    const double ridge = terms_ == 4 ? kRidgeT4 : kRidgeT10;
    const int first = terms_ == 4 ? 1 : 4;  // of the highest degree
    for (std::size_t at = 0; at < normal_.size(); at += static_cast<std::size_t>(terms_) * terms_) {
      Eigen::Map<Eigen::MatrixXd> normal(&normal_[at], terms_, terms_);
      if (normal(0, 0) == 0.0) continue;
      const Eigen::VectorXd scale =
          normal.diagonal().unaryExpr([&](double d) { return d > 1e-12 * normal(0, 0) ? 1 / std::sqrt(d) : 0.0; });
      la::Matrix scaled = scale.asDiagonal() * normal * scale.asDiagonal();
      for (int i = 0; i < terms_; ++i) scaled(i, i) += scale[i] == 0.0 ? 1.0 : i == 0 ? 0.0 : i < first ? kFlatness : ridge;
      normal = scale.asDiagonal() * la::calc_inverse(scaled) * scale.asDiagonal();
    }
  }

  /// Samples of a patch, after sum() and before invert().
  double count(std::size_t patch) const { return normal_[patch * terms_ * terms_]; }

  /// Contribution of a sample with monomials p to term t of the patch polynomial.
  double weight(std::size_t patch, const std::array<double, 10>& p, int t) const {
    const double* row = &normal_[(patch * terms_ + t) * terms_];
    return std::inner_product(row, row + terms_, p.begin(), 0.0);
  }

 private:
  int terms_;
  double scale_;
  std::vector<double> normal_;
};

/// Elements along a Morton curve, so that neighbours in the arrays are neighbours in the body.
std::vector<std::int32_t> order_elements(const mesh::LocalMesh& local) {
  const int n = local.nodes_per_tet();
  Vec3 low{}, high{};
  for (int k = 0; k < 3 && !local.nodes_m.empty(); ++k) {
    const auto [min, max] =
        std::minmax_element(local.nodes_m.begin(), local.nodes_m.end(), [&](const Vec3& a, const Vec3& b) { return a[k] < b[k]; });
    low[k] = (*min)[k];
    high[k] = (*max)[k];
  }
  const double size = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-300});
  std::vector<std::pair<std::uint32_t, std::int32_t>> keys;
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    std::uint32_t key = 0;
    for (int k = 0; k < 3; ++k) {
      double x = 0;
      for (int i = 0; i < 4; ++i) x += local.nodes_m[local.tets[static_cast<std::size_t>(e) * n + i]][k] / 4;
      const auto cell = static_cast<std::uint32_t>(1023 * (x - low[k]) / size);
      for (int bit = 0; bit < 10; ++bit) key |= (cell >> bit & 1U) << (3 * bit + k);
    }
    keys.emplace_back(key, e);
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::int32_t> order;
  for (const auto& [key, e] : keys) order.push_back(e);
  return order;
}

/// (nodes) numbers in the order of first use by the elements; corners_only: -1 for mid-side nodes.
std::vector<std::int32_t> find_places(const mesh::LocalMesh& local, const std::vector<std::int32_t>& order, bool corners_only) {
  const int n = local.nodes_per_tet();
  std::vector<std::int32_t> place(local.nodes_m.size(), -1);
  std::int32_t next = 0;
  for (const std::int32_t e : order)
    for (int i = 0; i < (corners_only ? 4 : n); ++i) {
      std::int32_t& p = place[local.tets[static_cast<std::size_t>(e) * n + i]];
      if (p < 0) p = next++;
    }
  return place;
}

void fill_elements(const mesh::LocalMesh& local, std::span<const Solid> solids, std::span<const std::int32_t> material_of_tet,
                   const Surface& surface, Recovery& recovery) {
  Elements& elements = recovery.elements;
  const int n = elements.nodes, s = elements.samples;
  elements.node.resize(elements.count * n);
  for (const Solid& solid : solids) {
    elements.root.push_back(calc_root(solid));
    elements.dilatation.push_back(find_dilatation(solid));
    elements.density.push_back(static_cast<float>(solid.density_kg_m3));
  }
  elements.material.resize(elements.count, 0);
  elements.gradient.resize(elements.count * s * (n - 1) * 3);
  elements.volume.resize(elements.count);
  elements.singular.resize(elements.count);
  elements.share.resize(elements.count);
  elements.bent.resize(elements.count);
  elements.patch.resize(elements.count * 4);
  recovery.value_of.resize(elements.count * n);
  std::vector<Vec3> x(n);
  for (std::size_t e = 0; e < elements.count; ++e) {
    const std::int32_t* tet = &local.tets[static_cast<std::size_t>(recovery.order[e]) * n];
    for (int i = 0; i < n; ++i) x[i] = local.nodes_m[tet[i]];
    if (!material_of_tet.empty()) elements.material[e] = material_of_tet[recovery.order[e]];
    double volume = 0;
    for (int k = 0; k < s; ++k) {
      const Sample sample = calc_sample(x, find_place(s, k));
      volume += sample.volume_m3 / s;
      for (int i = 1; i < n; ++i)
        for (int d = 0; d < 3; ++d) elements.gradient[((e * s + k) * (n - 1) + i - 1) * 3 + d] = static_cast<float>(sample.gradient[i][d]);
    }
    if (!(volume > 0))
      throw InputError(fmt::format("element {} of the mesh has no volume; remesh there", local.tet_in_mesh[recovery.order[e]] + 1));
    elements.volume[e] = static_cast<float>(volume);
    const int edges =
        std::accumulate(tet, tet + 4, 0, [&](int bits, std::int32_t node) { return bits | static_cast<int>(surface.singular[node]); });
    elements.singular[e] = edges != 0 ? 1.0F : 0.0F;
    elements.share[e] = edges == kInward ? kInwardShare : 1.0F;
    const float bend = std::accumulate(tet, tet + 4, 0.0F, [&](float sum, std::int32_t node) { return sum + surface.bend[node] / 4; });
    elements.bent[e] = bend * bend;
    for (int v = 0; v < 4; ++v) elements.patch[4 * e + v] = recovery.vertex_place[tet[v]] * elements.materials + elements.material[e];
    for (int i = 0; i < n; ++i) {
      elements.node[e * n + i] = recovery.place[tet[i]];
      recovery.value_of[e * n + i] = recovery.place[tet[i]] * elements.materials + elements.material[e];
    }
  }
}

/// Calls use(element, corner, sample, patch, monomials) for every sample of every element and corner.
template <typename Use>
void for_each_sample(const mesh::LocalMesh& local, const Recovery& recovery, const Patches& patches, const Use& use) {
  const Elements& elements = recovery.elements;
  const int n = elements.nodes, s = elements.samples;
  std::vector<Vec3> x(n);
  for (std::size_t e = 0; e < elements.count; ++e) {
    for (int i = 0; i < n; ++i) x[i] = local.nodes_m[local.tets[static_cast<std::size_t>(recovery.order[e]) * n + i]];
    for (int k = 0; k < s; ++k) {
      const Vec3 at = calc_place(x, find_place(s, k));
      for (int v = 0; v < 4; ++v) use(e, v, k, static_cast<std::size_t>(elements.patch[4 * e + v]), patches.monomials(at, x[v]));
    }
  }
}

void find_middles(const mesh::LocalMesh& local, const Patches& patches, Recovery& recovery) {
  std::vector<char> done(local.nodes_m.size(), 0);
  for (std::size_t e = 0; e < recovery.elements.count; ++e)
    for (int m = 0; m < 6; ++m) {
      const std::int32_t* tet = &local.tets[recovery.order[e] * 10];
      const std::int32_t node = tet[4 + m];
      if (done[node]++ != 0) continue;
      Middle middle;
      middle.node = recovery.place[node];
      for (int end = 0; end < 2; ++end) {
        const std::int32_t vertex = tet[mesh::kEdges[m][end]];
        middle.patch[end] = recovery.vertex_place[vertex];
        const auto p = patches.monomials(local.nodes_m[node], local.nodes_m[vertex]);
        for (int t = 0; t < 10; ++t) middle.monomials[end][t] = static_cast<float>(p[t]);
      }
      recovery.middles.push_back(middle);
      done[node] = 1;
    }
}

/// Number of elements that are flat and have all corners on the surface.
double count_one_layer(const mesh::LocalMesh& local, const std::vector<char>& is_outer) {
  constexpr double kFlat = 4.0;  // longest edge over least height: 1.2 of a regular tetrahedron, 2.5 in a lattice of cubes
  double count = 0.0;
  for (std::size_t at = 0; at < local.tets.size(); at += static_cast<std::size_t>(local.nodes_per_tet())) {
    const std::int32_t* tet = &local.tets[at];
    if (!std::all_of(tet, tet + 4, [&](std::int32_t node) { return is_outer[node] != 0; })) continue;
    std::array<Vec3, 4> x;
    for (int i = 0; i < 4; ++i) x[i] = local.nodes_m[tet[i]];
    double longest = 0.0, widest = 0.0;
    for (const auto& [a, b] : mesh::kEdges) longest = std::max(longest, norm(x[b] - x[a]));
    for (const auto& [a, b, c] : mesh::kFaces) widest = std::max(widest, norm(cross(x[b] - x[a], x[c] - x[a])));
    const double six_volumes = std::abs(dot(x[1] - x[0], cross(x[2] - x[0], x[3] - x[0])));
    if (longest * widest > kFlat * six_volumes) count += 1.0;
  }
  return count;
}

/// Merges both faces of an edge into one entry, in the order of the elements.
std::vector<Shift> find_shifts(const std::vector<SurfaceEdge>& edges, const mesh::LocalMesh& local,
                               std::span<const std::int32_t> material_of_tet, const Recovery& recovery) {
  const Elements& elements = recovery.elements;
  std::map<std::array<std::int32_t, 3>, double> volumes;  // by nodes, material and whether it is fixed
  for (const SurfaceEdge& edge : edges) {
    const std::size_t first = static_cast<std::size_t>(edge.tet) * elements.nodes;
    std::array<int, 2> at = mesh::kEdges[edge.edge];
    if (elements.nodes == 10) at = {4 + edge.edge, 4 + edge.edge};
    const std::int32_t a = recovery.place[local.tets[first + at[0]]], b = recovery.place[local.tets[first + at[1]]];
    const std::int32_t material = material_of_tet.empty() ? 0 : material_of_tet[edge.tet];
    volumes[{std::min(a, b), std::max(a, b), 2 * material + (edge.is_fixed ? 1 : 0)}] += edge.gap_m * edge.third_m2;
  }
  std::vector<Shift> shifts;
  for (const auto& [key, volume] : volumes) {
    const std::int32_t material = key[2] / 2;
    const bool is_fixed = key[2] % 2 == 1;
    Shift shift;
    for (int end = 0; end < 2; ++end) {
      shift.node[end] = key[end];
      shift.value[end] = key[end] * elements.materials + material;
    }
    shift.volume_m3 = static_cast<float>(is_fixed ? -volume : volume);
    shift.density = is_fixed ? 0.0F : elements.density[material];
    shifts.push_back(shift);
  }
  return shifts;
}

/// Traction parts of a scaled strain on a face with this normal: an orthonormal basis of U N, N v being the strain of a displacement v that
/// grows along the normal.
Eigen::Matrix<double, 6, 3> find_traction_parts(const std::array<float, 36>& root, const std::array<float, 3>& n) {
  Eigen::Matrix<double, 6, 3> strain;
  strain << n[0], 0, 0, 0, n[1], 0, 0, 0, n[2], 0, n[2], n[1], n[2], 0, n[0], n[1], n[0], 0;
  return la::calc_qr(Eigen::Map<const Eigen::Matrix<float, 6, 6, Eigen::RowMajor>>(root.data()).cast<double>() * strain, 3).q;
}

/// For T10, at the middles of the edges, where three points integrate squares of linear fields exactly. Neighbours on one smooth surface
/// share points.
void find_tractions(const std::vector<FreeFace>& faces, const mesh::LocalMesh& local, std::span<const std::int32_t> material_of_tet,
                    Recovery& recovery) {
  const Elements& elements = recovery.elements;
  struct Point {
    std::int32_t value, material;
    std::array<float, 3> normal;
    auto operator<=>(const Point&) const = default;
  };
  std::map<Point, double> volumes;
  for (const FreeFace& face : faces) {
    const std::int32_t material = material_of_tet.empty() ? 0 : material_of_tet[face.tet];
    const double depth = kLayer * std::min(face.height_m, std::sqrt(face.area_m2));
    for (int i = 0; i < 3; ++i) {
      const int edge = mesh::find_edge(mesh::kFaces[face.face][i], mesh::kFaces[face.face][(i + 1) % 3]);
      const std::int32_t node = local.tets[static_cast<std::size_t>(face.tet) * elements.nodes + 4 + edge];
      const Vec3& n = face.normal[i];
      volumes[{recovery.place[node] * elements.materials + material,
               material,
               {static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])}}] += depth * face.area_m2 / 3;
    }
  }
  for (const auto& [point, volume] : volumes) {
    const Eigen::Matrix<double, 6, 3> parts = find_traction_parts(elements.root[point.material], point.normal);
    Traction traction{point.value, {}};
    for (int k = 0; k < 3; ++k)
      for (int r = 0; r < 6; ++r) traction.part[6 * k + r] = static_cast<float>(std::sqrt(volume) * parts(r, k));
    recovery.tractions.push_back(traction);
  }
}

/// Exchange of values at nodes with a place on any rank: place (nodes), -1: none. Collective.
comm::HaloExchange make_exchange(const comm::Communicator& comm, const mesh::LocalMesh& local, const std::vector<std::int32_t>& place) {
  if (comm.size() == 1) return {};
  const auto own_end = local.node_in_mesh.begin() + local.owned_nodes;
  comm::Halo halo;
  const auto owned = comm.agree([&] {
    for (std::size_t n = local.owned_nodes; n < place.size(); ++n) {
      if (place[n] < 0) continue;
      halo.number.push_back(local.node_in_mesh[n]);
      halo.place.push_back(place[n]);
    }
    return std::vector(local.node_in_mesh.begin(), own_end);
  });
  halo.owner = comm::find_owners(comm, owned, halo.number);
  const auto place_of = comm.agree([&] {
    std::unordered_map<std::int32_t, std::int32_t> places;
    for (std::size_t n = 0; n < owned.size(); ++n) places[owned[n]] = place[n];
    return places;
  });
  return {comm, halo, [&](std::int32_t number) { return place_of.at(number); }};
}

}  // namespace

Recovery make_recovery(const comm::Communicator& comm, const mesh::LocalMesh& local, std::span<const Solid> solids,
                       std::span<const std::int32_t> material_of_tet, job::Mass mass_kind) {
  const std::vector<std::int32_t> order = order_elements(local), place = find_places(local, order, false),
                                  vertex_place = find_places(local, order, true);
  Recovery recovery{
      {}, order, place, vertex_place, {}, {}, {}, {}, {}, {}, make_exchange(comm, local, place), make_exchange(comm, local, vertex_place)};
  Elements& elements = recovery.elements;
  elements.nodes = local.nodes_per_tet();
  elements.samples = local.order == 1 ? 1 : 4;
  elements.terms = local.order == 1 ? 1 : 10;
  elements.materials = static_cast<int>(solids.size());
  elements.count = local.tet_count();
  const Surface surface = find_surface(comm, local);
  // Volume, elements, single-layer elements, doubtful facets, vertices at rims of fixed faces.
  std::array<double, 5> size{0.0, static_cast<double>(elements.count), 0.0, static_cast<double>(surface.doubts.size()), 0.0};
  comm.agree([&] {
    recovery.vertex_node.resize(*std::max_element(vertex_place.begin(), vertex_place.end()) + 1);
    for (std::size_t n = 0; n < place.size(); ++n)
      if (vertex_place[n] >= 0) recovery.vertex_node[vertex_place[n]] = place[n];
    fill_elements(local, solids, material_of_tet, surface, recovery);
    for (const float volume : elements.volume) size[0] += volume;
    size[2] = count_one_layer(local, surface.is_outer);
    size[4] = static_cast<double>(std::ranges::count_if(surface.singular, [](char s) { return (s & kRim) != 0; }));
  });
  comm.sum(size);
  recovery.one_layer = size[2] / size[1];
  recovery.is_guessed = size[3] > 0.0;
  recovery.has_rims = size[4] > 0.0;

  std::unique_ptr<Patches> patches;
  comm.agree([&] {
    patches =
        std::make_unique<Patches>(local.order == 1 ? 4 : 10, recovery.vertex_node.size() * solids.size(), std::cbrt(size[0] / size[1]));
    for_each_sample(local, recovery, *patches, [&](std::size_t, int, int, std::size_t patch, const auto& p) { patches->add(patch, p); });
  });
  patches->sum(recovery.vertices, elements.materials);
  // An element with no other in any of its patches has nothing to be compared with: its whole strain counts as error.
  std::vector<char> is_alone(elements.count);
  for (std::size_t e = 0; e < elements.count && local.order == 1; ++e)
    is_alone[e] = std::all_of(&elements.patch[4 * e], &elements.patch[4 * e] + 4, [&](auto patch) { return patches->count(patch) < 1.5; });
  std::vector<SurfaceEdge> doubtful = find_doubtful_edges(comm, local);
  doubtful.insert(doubtful.end(), surface.doubts.begin(), surface.doubts.end());
  comm.agree([&] {
    patches->invert();
    elements.weight.resize(elements.count * 4 * elements.samples * elements.terms);
    for_each_sample(local, recovery, *patches, [&](std::size_t e, int v, int s, std::size_t patch, const auto& p) {
      float* weight = &elements.weight[((e * 4 + v) * elements.samples + s) * elements.terms];
      for (int t = 0; t < elements.terms; ++t) weight[t] = is_alone[e] != 0 ? 0.0F : static_cast<float>(patches->weight(patch, p, t));
    });
    if (local.order == 2) find_middles(local, *patches, recovery);
    recovery.shifts = find_shifts(surface.edges, local, material_of_tet, recovery);
    recovery.doubts = find_shifts(doubtful, local, material_of_tet, recovery);
    if (local.order == 2 && mass_kind == job::Mass::consistent) find_tractions(surface.free_faces, local, material_of_tet, recovery);
  });
  return recovery;
}

}  // namespace carillon::error_bars
