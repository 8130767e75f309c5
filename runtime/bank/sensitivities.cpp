// Method: six-node faces where the triangles come in fours (T10), else flat ones; quadrature on the quarters of a face; densities at the
//   vertices are means weighted by the hat functions of the triangles, so a cut that is linear between vertices is integrated exactly.
// Source: Hadamard 1908; Sokolowski and Zolesio 1992, Introduction to Shape Optimization, 2.10 and 3.5.
#include "runtime/bank/sensitivities.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/edges.hpp"

namespace carillon::bank {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3>;
using Point = std::array<double, 3>;  // barycentric

constexpr double kSharpDeg = 50.0;   // edges that are less sharp belong to smooth surfaces,
constexpr double kInwardDeg = 15.0;  // but inward ones over this that are
constexpr double kSharper = 2.0;     // so much sharper than the next
constexpr int kDoubtfulRings = 2;    // elements around such an edge

/// Nodes of a face and its triangles between them: one, or four with the middles of the edges.
struct Face {
  std::array<std::int32_t, 6> node{};  // corners, then the middles of 01, 12, 20
  std::size_t nodes = 3;
};

/// Faces in the order of extract_boundary(): (0, 01, 20), (01, 1, 12), (20, 12, 2), (01, 12, 20).
std::vector<Face> find_faces(const Bank& bank) {
  const auto& t = bank.triangles;
  std::vector<Face> faces;
  bool is_quadratic = bank.element == "T10" && t.size() % 4 == 0;
  for (std::size_t i = 0; is_quadratic && i < t.size(); i += 4) {
    const Face face{{t[i][0], t[i + 1][1], t[i + 2][2], t[i][1], t[i + 1][2], t[i][2]}, 6};
    const auto [a, b, c, ab, bc, ca] = face.node;
    is_quadratic = t[i] == std::array{a, ab, ca} && t[i + 1] == std::array{ab, b, bc} && t[i + 2] == std::array{ca, bc, c} &&
                   t[i + 3] == std::array{ab, bc, ca};
    faces.push_back(face);
  }
  if (is_quadratic) return faces;
  faces.clear();
  for (const auto& corners : t) faces.push_back({{corners[0], corners[1], corners[2]}, 3});
  return faces;
}

/// Point of a face, with the hat functions of the triangle that contains it.
struct QuadraturePoint {
  std::array<double, 6> value{};                 // of the shape functions
  std::array<std::array<double, 2>, 6> slope{};  // by the first two barycentric coordinates
  std::array<std::size_t, 3> corner{};           // of the triangle, as places in Face::node
  Point hat{};
  double weight = 0.0;  // of the norm of the product of the tangents
};

std::vector<QuadraturePoint> make_rule(std::size_t nodes) {
  std::vector<QuadraturePoint> rule;
  const std::array<Point, 6> place{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.5, 0.5, 0}, {0, 0.5, 0.5}, {0.5, 0, 0.5}}};
  const std::vector<std::array<std::size_t, 3>> triangles =
      nodes == 6 ? std::vector<std::array<std::size_t, 3>>{{0, 3, 5}, {3, 1, 4}, {5, 4, 2}, {3, 4, 5}}
                 : std::vector<std::array<std::size_t, 3>>{{0, 1, 2}};
  for (const auto& triangle : triangles)
    for (std::size_t p = 0; p < 3; ++p) {
      QuadraturePoint point;
      point.corner = triangle;
      point.hat = {1.0 / 6, 1.0 / 6, 1.0 / 6};
      point.hat[p] = 2.0 / 3;
      point.weight = 1.0 / 6 / static_cast<double>(triangles.size());
      Point l{};
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t k = 0; k < 3; ++k) l[k] += point.hat[c] * place[triangle[c]][k];
      std::array<Point, 6> slope{};  // by l0, l1, l2
      for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t next = (c + 1) % 3;
        point.value[c] = nodes == 6 ? l[c] * (2 * l[c] - 1) : l[c];
        slope[c][c] = nodes == 6 ? 4 * l[c] - 1 : 1.0;
        if (nodes != 6) continue;
        point.value[3 + c] = 4 * l[c] * l[next];
        slope[3 + c][c] = 4 * l[next];
        slope[3 + c][next] = 4 * l[c];
      }
      for (std::size_t n = 0; n < nodes; ++n) point.slope[n] = {slope[n][0] - slope[n][2], slope[n][1] - slope[n][2]};
      rule.push_back(point);
    }
  return rule;
}

/// Stiffness (3, 3) of plane stress for the strains 11, 22 and 2 12 along the columns 0 and 1 of `axes`; column 2 is the normal.
Matrix3d calc_plane_stiffness(const material::Elasticity& elasticity, const Matrix3d& axes) {
  constexpr std::array<std::array<int, 2>, 6> kVoigt{{{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}};
  Eigen::Matrix<double, 6, 6> to_mesh;  // strains in local axes to those in mesh axes
  for (int column = 0; column < 6; ++column) {
    const auto [i, j] = kVoigt[column];
    Matrix3d local = Matrix3d::Zero();
    local(i, j) = local(j, i) = i == j ? 1.0 : 0.5;
    const Matrix3d strain = axes * local * axes.transpose();
    for (int row = 0; row < 6; ++row) {
      const auto [k, l] = kVoigt[row];
      to_mesh(row, column) = k == l ? strain(k, k) : 2 * strain(k, l);
    }
  }
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> c(elasticity.data());
  const Eigen::Matrix<double, 6, 6> local = to_mesh.transpose() * c * to_mesh;
  const std::array<int, 3> plane{0, 1, 5}, other{2, 3, 4};
  const Matrix3d coupling = local(plane, other);
  return local(plane, plane) - coupling * local(other, other).inverse() * coupling.transpose();
}

Vec3 find_normal(const Bank& bank, std::int32_t triangle) {
  const auto& [a, b, c] = bank.triangles[triangle];
  return normalise(cross(bank.vertices_m[b] - bank.vertices_m[a], bank.vertices_m[c] - bank.vertices_m[a]));
}

/// Vertices of sharp inward edges and fixed ones, with those of the elements around them. An inward edge is sharp over kSharpDeg, and over
/// kInwardDeg where it is much sharper than the next ones: those of a coarse smooth surface are about equal.
std::vector<std::uint8_t> find_doubtful(const Bank& bank, const std::vector<Face>& faces, std::span<const std::uint8_t> fixed) {
  struct Edge {
    std::array<std::int32_t, 2> end, opposite;
    double angle_deg;
  };
  std::vector<Edge> edges;
  std::vector<double> largest_deg(bank.vertex_count(), 0.0);  // of the inward edges of a vertex
  for_each_edge(bank.triangles, bank.vertex_count(), [&](std::int32_t lower, const HalfEdge* first, const HalfEdge* last) {
    if (last - first != 2) return;
    const auto find_opposite = [&](const HalfEdge& edge) { return bank.triangles[edge.number / 3][(edge.number % 3 + 2) % 3]; };
    const Vec3 normal = find_normal(bank, first->number / 3), other = find_normal(bank, (first + 1)->number / 3);
    const Edge edge{{lower, first->upper},
                    {find_opposite(*first), find_opposite(*(first + 1))},
                    std::acos(std::clamp(dot(normal, other), -1.0, 1.0)) * 180.0 / std::numbers::pi};
    if (!(dot(normal, bank.vertices_m[edge.opposite[1]] - bank.vertices_m[lower]) > 0.0)) return;
    for (const std::int32_t v : edge.end) largest_deg[v] = std::max(largest_deg[v], edge.angle_deg);
    if (edge.angle_deg > kInwardDeg) edges.push_back(edge);
  });
  std::vector<std::uint8_t> doubtful(fixed.begin(), fixed.end());
  doubtful.resize(bank.vertex_count(), 0);
  for (const Edge& edge : edges) {
    const double next_deg = std::max(largest_deg[edge.opposite[0]], largest_deg[edge.opposite[1]]);
    if (edge.angle_deg > kSharpDeg || edge.angle_deg > kSharper * next_deg) doubtful[edge.end[0]] = doubtful[edge.end[1]] = 1;
  }
  for (int ring = 0; ring < kDoubtfulRings; ++ring) {
    const std::vector<std::uint8_t> before = doubtful;
    for (const Face& face : faces) {
      const std::span nodes(face.node.data(), face.nodes);
      if (std::any_of(nodes.begin(), nodes.end(), [&](std::int32_t v) { return before[v] != 0; }))
        for (const std::int32_t v : nodes) doubtful[v] = 1;
    }
  }
  return doubtful;
}

/// Site of each corner (3 T), numbered by first use. Triangles around a vertex share a site across edges of less than kSharpDeg.
std::vector<std::int32_t> find_sites(const Bank& bank) {
  std::vector<std::int32_t> root(3 * bank.triangles.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](std::int32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  const auto unite = [&](std::int32_t a, std::int32_t b) {
    a = find(a);
    b = find(b);
    root[std::max(a, b)] = std::min(a, b);
  };
  const double least = std::cos(kSharpDeg * std::numbers::pi / 180.0);
  for_each_edge(bank.triangles, bank.vertex_count(), [&](std::int32_t, const HalfEdge* first, const HalfEdge* last) {
    if (last - first != 2) return;
    const std::int32_t a = first->number, b = (first + 1)->number, t = a / 3, other = b / 3;
    if (dot(find_normal(bank, t), find_normal(bank, other)) < least) return;
    unite(a, 3 * other + (b + 1) % 3);  // both run along the edge, in opposite directions
    unite(3 * t + (a + 1) % 3, b);
  });
  std::vector<std::int32_t> site(root.size());
  std::int32_t sites = 0;
  for (std::size_t i = 0; i < root.size(); ++i) {
    const std::int32_t first = find(static_cast<std::int32_t>(i));
    site[i] = first == static_cast<std::int32_t>(i) ? sites++ : site[first];
  }
  return site;
}

/// Motion of the modes on one face at a time.
class FaceMotion {
 public:
  explicit FaceMotion(Eigen::Index modes) : shape_(6, Rows(modes, 3)), by_0_(modes, 3), by_1_(modes, 3) {
    u.resize(modes, 3);
    strain.resize(modes, 3);
  }

  void read(const Bank& bank, const Face& face) {
    nodes_ = face.nodes;
    for (std::size_t n = 0; n < nodes_; ++n) {
      place_[n] = bank.vertices_m[face.node[n]];
      for (Eigen::Index m = 0; m < u.rows(); ++m) {
        const Vec3 phi = bank.shape_at(face.node[n], m);
        shape_[n].row(m) << phi[0], phi[1], phi[2];
      }
    }
  }

  /// False where the face has no area.
  bool find(const QuadraturePoint& point) {
    Vec3 t0{}, t1{};
    u.setZero();
    by_0_.setZero();
    by_1_.setZero();
    for (std::size_t n = 0; n < nodes_; ++n) {
      t0 = t0 + point.slope[n][0] * place_[n];
      t1 = t1 + point.slope[n][1] * place_[n];
      u += point.value[n] * shape_[n];
      by_0_ += point.slope[n][0] * shape_[n];
      by_1_ += point.slope[n][1] * shape_[n];
    }
    const Vec3 normal = cross(t0, t1);
    const double length = norm(t0);
    size = norm(normal);
    if (!(size > 0.0)) return false;
    const Vec3 e0 = (1.0 / length) * t0, e2 = (1.0 / size) * normal, e1 = cross(e2, e0);
    for (int k = 0; k < 3; ++k) axes.row(k) << e0[k], e1[k], e2[k];
    // Derivatives along e0 and e1: t0 = length e0, t1 = along e0 + across e1.
    const double along = dot(t1, e0), across = dot(t1, e1);
    by_1_ = (by_1_ - along / length * by_0_) / across;
    by_0_ /= length;
    strain.col(0) = by_0_ * axes.col(0);
    strain.col(1) = by_1_ * axes.col(1);
    strain.col(2) = by_0_ * axes.col(1) + by_1_ * axes.col(0);
    return true;
  }

  // At the point found last: displacements (m, 3); strains 11, 22 and 2 12 (m, 3) along the columns 0 and 1 of `axes`, column 2 is the
  // normal; area per area of the barycentric coordinates.
  Rows u, strain;
  Matrix3d axes;
  double size = 0.0;

 private:
  std::size_t nodes_ = 0;
  std::array<Vec3, 6> place_{};
  std::vector<Rows> shape_;
  Rows by_0_, by_1_;
};

/// Sites without densities, normals and areas.
Sensitivities make_sites(const Bank& bank, const std::vector<std::int32_t>& site_of_corner, const std::vector<std::uint8_t>& doubtful) {
  Sensitivities made;
  const std::size_t sites = site_of_corner.empty() ? 0 : 1 + *std::max_element(site_of_corner.begin(), site_of_corner.end());
  made.vertex.resize(sites);
  made.normal.resize(sites);
  made.area_m2.resize(sites);
  made.doubtful.resize(sites);
  for (std::size_t i = 0; i < site_of_corner.size(); ++i) {
    const std::int32_t v = bank.triangles[i / 3][i % 3];
    made.vertex[site_of_corner[i]] = v;
    made.doubtful[site_of_corner[i]] = doubtful[v];
  }
  return made;
}

/// Sets scale and density (S, C) from (C, S).
void round_densities(const MatrixXd& density, Sensitivities& result) {
  const std::size_t columns = result.modes.size(), sites = result.site_count();
  result.density.resize(sites * columns);
  for (std::size_t c = 0; c < columns; ++c) {
    const auto row = density.row(static_cast<Eigen::Index>(c));
    result.scale.push_back(calc_shape_scale(row.cwiseAbs().maxCoeff()));
    for (std::size_t s = 0; s < sites; ++s) result.density[s * columns + c] = find_step(row[static_cast<Eigen::Index>(s)], result.scale[c]);
  }
}

std::vector<std::array<std::int32_t, 2>> find_columns(const Bank& bank, std::size_t count) {
  std::vector<std::array<std::int32_t, 2>> columns;
  for (std::size_t i = 0; i < count; ++i) columns.push_back({static_cast<std::int32_t>(i), static_cast<std::int32_t>(i)});
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = i + 1; j < count && bank.freq_hz(j) < kPairRatio * bank.freq_hz(i); ++j)
      columns.push_back({static_cast<std::int32_t>(i), static_cast<std::int32_t>(j)});
  return columns;
}

}  // namespace

Sensitivities calc_sensitivities(const Bank& bank, const material::Elasticity& elasticity_pa, double density_kg_m3, std::size_t count,
                                 std::span<const std::uint8_t> fixed) {
  constexpr double kCentPerMm = 600.0 / std::numbers::ln2 * 1e-3;
  const std::vector<Face> faces = find_faces(bank);
  const std::vector<std::int32_t> site_of_corner = find_sites(bank);
  Sensitivities result = make_sites(bank, site_of_corner, find_doubtful(bank, faces, fixed));
  result.count = std::min(count, bank.mode_count());
  result.modes = find_columns(bank, result.count);
  if (result.modes.empty() || faces.empty()) return result;
  const std::vector<QuadraturePoint> rule = make_rule(faces.front().nodes);
  const auto columns = static_cast<Eigen::Index>(result.modes.size()), sites = static_cast<Eigen::Index>(result.site_count());
  MatrixXd density = MatrixXd::Zero(columns, sites);
  std::vector<Vec3> normals(result.site_count());  // times areas
  FaceMotion motion(static_cast<Eigen::Index>(result.count));
  Rows stress;
  Eigen::VectorXd found(columns);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    motion.read(bank, faces[f]);
    for (std::size_t p = 0; p < rule.size(); ++p) {
      if (!motion.find(rule[p])) continue;
      stress.noalias() = motion.strain * calc_plane_stiffness(elasticity_pa, motion.axes);
      for (Eigen::Index c = 0; c < columns; ++c) {
        const auto [i, j] = result.modes[static_cast<std::size_t>(c)];
        const double lambda = 0.5 * (bank.eigenvalue_rad2_s2[i] + bank.eigenvalue_rad2_s2[j]);
        found[c] = density_kg_m3 * motion.u.row(i).dot(motion.u.row(j)) - stress.row(i).dot(motion.strain.row(j)) / lambda;
      }
      for (std::size_t k = 0; k < 3; ++k) {
        const std::int32_t site = site_of_corner[f * rule.size() + p / 3 * 3 + k];  // three points a triangle
        const double share = rule[p].weight * motion.size * rule[p].hat[k];
        normals[site] = normals[site] + share * Vec3{motion.axes(0, 2), motion.axes(1, 2), motion.axes(2, 2)};
        density.col(site) += kCentPerMm * share * found;
        result.area_m2[site] += static_cast<float>(share);
      }
    }
  }
  for (Eigen::Index site = 0; site < sites; ++site) {
    if (!(result.area_m2[site] > 0.0F)) continue;
    density.col(site) /= result.area_m2[site];
    const Vec3 normal = normalise(normals[site]);
    for (std::size_t k = 0; k < 3; ++k) result.normal[site][k] = static_cast<float>(normal[k]);
  }
  round_densities(density, result);
  return result;
}

std::vector<double> calc_changes(const Bank& bank, std::span<const double> depth_mm) {
  const Sensitivities& s = bank.sensitivities;
  const std::size_t count = s.count, columns = s.column_count();
  std::vector<double> entry(columns);
  for (std::size_t site = 0; site < depth_mm.size(); ++site)
    if (depth_mm[site] != 0.0)
      for (std::size_t c = 0; c < columns; ++c) entry[c] += s.get_density(site, c) * s.area_m2[site] * depth_mm[site];
  std::vector<double> changes(count);
  for (std::size_t first = 0, last = 0; first < count; first = last) {
    for (last = first + 1; last < count && bank.freq_hz(last) < kPairRatio * bank.freq_hz(last - 1);) ++last;
    const auto size = static_cast<Eigen::Index>(last - first);
    MatrixXd matrix = MatrixXd::Zero(size, size);
    const auto find_cents = [&](std::size_t mode) { return 1200.0 * std::log2(bank.freq_hz(mode) / bank.freq_hz(first)); };
    for (std::size_t c = 0; c < columns; ++c) {
      const auto [i, j] = s.modes[c];
      if (static_cast<std::size_t>(i) < first || static_cast<std::size_t>(j) >= last) continue;
      const auto row = static_cast<Eigen::Index>(i) - static_cast<Eigen::Index>(first),
                 column = static_cast<Eigen::Index>(j) - static_cast<Eigen::Index>(first);
      matrix(row, column) = matrix(column, row) = entry[c] + (i == j ? find_cents(i) : 0.0);
    }
    const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
    for (std::size_t m = first; m < last; ++m) changes[m] = values[static_cast<Eigen::Index>(m - first)] - find_cents(m);
  }
  return changes;
}

std::vector<double> calc_depth(const Bank& bank, std::span<const Cut> cuts) {
  constexpr double kSameSide = 0.5;  // cosine of the largest angle between the normals of a spot
  const Sensitivities& s = bank.sensitivities;
  std::vector<double> depth_mm(s.site_count());
  const auto find_normal = [&](std::size_t site) { return Vec3{s.normal[site][0], s.normal[site][1], s.normal[site][2]}; };
  for (const Cut& cut : cuts) {
    std::size_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t site = 0; site < s.site_count(); ++site)
      if (const double distance = norm(bank.vertices_m[s.vertex[site]] - cut.at_m); distance < least) least = distance, nearest = site;
    for (std::size_t site = 0; site < s.site_count(); ++site) {
      const double share = norm(bank.vertices_m[s.vertex[site]] - bank.vertices_m[s.vertex[nearest]]) / cut.radius_m;
      if (share < 1.0 && dot(find_normal(site), find_normal(nearest)) > kSameSide)
        depth_mm[site] += 1e3 * cut.depth_m * (1.0 - share * share) * (1.0 - share * share);
    }
  }
  return depth_mm;
}

std::vector<float> calc_corner_density(const Bank& bank, std::size_t mode) {
  const Sensitivities& s = bank.sensitivities;
  std::vector<std::size_t> first(bank.vertex_count() + 1, 0), sites(s.site_count());  // by vertex
  for (const std::int32_t v : s.vertex) ++first[v + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<std::size_t> next(first.begin(), first.end() - 1);
  for (std::size_t site = 0; site < s.site_count(); ++site) sites[next[s.vertex[site]]++] = site;
  std::vector<float> density;
  for (std::size_t t = 0; t < bank.triangles.size(); ++t) {
    const Vec3 normal = find_normal(bank, static_cast<std::int32_t>(t));
    for (const std::int32_t v : bank.triangles[t]) {
      float found = std::numeric_limits<float>::quiet_NaN();
      double most = -2.0;
      for (std::size_t i = first[v]; i < first[v + 1]; ++i) {
        const auto& [x, y, z] = s.normal[sites[i]];
        const double along = dot(normal, Vec3{x, y, z});
        if (!(along > most)) continue;
        most = along;
        found = s.doubtful[sites[i]] != 0 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(s.get_density(sites[i], mode));
      }
      density.push_back(found);
    }
  }
  return density;
}

Sensitivities select_sensitive(const Sensitivities& sensitivities, std::span<const std::size_t> chosen) {
  const std::size_t count = sensitivities.count;
  std::size_t kept = 0;
  while (kept < chosen.size() && kept < count && chosen[kept] == kept) ++kept;
  if (kept == 0) return {};
  if (kept == count) return sensitivities;
  std::vector<std::size_t> columns;
  for (std::size_t c = 0; c < sensitivities.column_count(); ++c)
    if (static_cast<std::size_t>(sensitivities.modes[c][1]) < kept) columns.push_back(c);
  Sensitivities selected = sensitivities;
  selected.count = kept;
  selected.by_parameter.resize(sensitivities.by_parameter.size() / count * kept);
  if (!selected.own_error_cents.empty()) selected.own_error_cents.resize(kept);
  selected.modes.clear();
  selected.scale.clear();
  selected.density.clear();
  for (const std::size_t c : columns) {
    selected.modes.push_back(sensitivities.modes[c]);
    selected.scale.push_back(sensitivities.scale[c]);
  }
  for (std::size_t s = 0; s < sensitivities.site_count(); ++s)
    for (const std::size_t c : columns) selected.density.push_back(sensitivities.density[s * sensitivities.column_count() + c]);
  return selected;
}

std::string find_fault(const Sensitivities& sensitivities, std::size_t vertices, std::size_t modes) {
  if (sensitivities.is_empty()) return {};
  const std::size_t columns = sensitivities.column_count(), count = sensitivities.count, sites = sensitivities.site_count();
  if (sensitivities.scale.size() != columns || sensitivities.density.size() != sites * columns || sensitivities.normal.size() != sites ||
      sensitivities.area_m2.size() != sites || sensitivities.doubtful.size() != sites)
    return "the sizes of the arrays of sensitivity/ disagree";
  for (std::size_t s = 0; s < sites; ++s) {
    if (sensitivities.vertex[s] < 0 || static_cast<std::size_t>(sensitivities.vertex[s]) >= vertices)
      return "sensitivity/vertex is out of range in row " + std::to_string(s);
    const auto& [x, y, z] = sensitivities.normal[s];
    if (!std::isfinite(x + y + z) || !std::isfinite(sensitivities.area_m2[s]) || sensitivities.area_m2[s] < 0.0F)
      return "sensitivity/normal or area_m2 is not valid in row " + std::to_string(s);
  }
  if (count == 0 || count > modes || count > columns) return "sensitivity/by_parameter has no row for each of the lowest modes";
  for (std::size_t c = 0; c < columns; ++c) {
    const auto [i, j] = sensitivities.modes[c];
    const bool is_right = c < count ? static_cast<std::size_t>(i) == c && i == j : i >= 0 && i < j && static_cast<std::size_t>(j) < count;
    if (!is_right) return "sensitivity/modes names no pair of these modes in row " + std::to_string(c);
    if (!(std::isfinite(sensitivities.scale[c]) && sensitivities.scale[c] >= 0.0))
      return "sensitivity/scale is negative or not finite in row " + std::to_string(c);
  }
  const std::vector<double>& own = sensitivities.own_error_cents;
  if (!own.empty() && (own.size() != count || !std::all_of(own.begin(), own.end(), [](double cents) { return cents >= 0.0; })))
    return "sensitivity/own_error_cents has not one number for each of the lowest modes, or a negative one";
  for (const double value : sensitivities.by_parameter)
    if (!std::isfinite(value)) return "sensitivity/by_parameter has a number that is not finite";
  return {};
}

}  // namespace carillon::bank
