// Element strains, scaled so that the product of two is an energy.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/fem/materials.hpp"
#include "precompute/la/lapack.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "runtime/bank/quartic_energy.hpp"

namespace carillon::coupling {

/// N (N + 1) / 2 pairs, in the order of bank::QuarticEnergy: columns of the upper triangle.
struct Pairs {
  std::ptrdiff_t modes = 0;

  std::ptrdiff_t count() const { return static_cast<std::ptrdiff_t>(bank::count_pairs(static_cast<std::size_t>(modes))); }
  /// Pre: 0 <= i <= j < modes.
  std::ptrdiff_t find(std::ptrdiff_t i, std::ptrdiff_t j) const {
    return static_cast<std::ptrdiff_t>(bank::find_pair(static_cast<std::size_t>(i), static_cast<std::size_t>(j)));
  }
};

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Components of a symmetric tensor: xx, yy, zz, yz, xz, xy.
inline constexpr std::array<std::array<int, 2>, 6> kComponents{{{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}};

/// One element at the integration points of its stiffness: one of a T4, four of a straight T10, fourteen of a curved one.
struct ElementPoints {
  int nodes = 0;                              // 4 or 10
  std::vector<double> volume_m3;              // (points) weights
  std::vector<std::array<double, 30>> slope;  // (points) d N_i / d x_k at 3 i + k
  std::vector<std::array<double, 4>> at;      // (points) barycentric coordinates
  int point_count() const { return static_cast<int>(volume_m3.size()); }
};

/// Scaled strains of this rank's elements by rows. A point has six rows, sqrt(w) U E with E in Mandel notation and U^T U = C; an element
/// with a mean dilatation modulus (fem::Solid) has one more, sqrt(kappa / V) times its integral. The product of two such columns, summed
/// over all elements, is <E_a, C E_b>, and B^T B is the element's stiffness matrix as in fem. References the mesh, which must outlive it.
/// Not collective.
class Strains {
 public:
  /// Pre: the Jacobians of all elements are positive (checked by fem::assemble()).
  Strains(const mesh::LocalMesh& local, const fem::Materials& materials);

  std::int32_t element_count() const { return static_cast<std::int32_t>(first_row_.size()) - 1; }
  /// Rows of the elements before e; with element_count(): all rows of this rank.
  std::int64_t first_row(std::int32_t e) const { return first_row_[e]; }
  int row_count(std::int32_t e) const { return static_cast<int>(first_row(e + 1) - first_row(e)); }
  std::span<const std::int32_t> nodes(std::int32_t e) const;

  void calc_points(std::int32_t e, ElementPoints& out) const;

  /// b: (rows, 3 nodes): linear strain of nodal displacements.
  void calc_linear(std::int32_t e, const ElementPoints& points, RowMatrix& b) const;
  /// Values at the nodes of the element, (3 nodes, width), of an array (local nodes, 3, width).
  void gather(std::int32_t e, const double* nodal, std::ptrdiff_t width, RowMatrix& values) const;
  /// Gradients d u_a / d x_k at row 9 point + 3 a + k, (9 points, columns).
  static void calc_gradients(const ElementPoints& points, const RowMatrix& values, RowMatrix& gradients);
  /// z: (rows, count): Green's quadratic strain of the pairs first ... first + count - 1 of the columns of `gradients`:
  /// E = 1/2 (H_i^T H_j + H_j^T H_i) for i < j, 1/2 H_i^T H_i for i = j, so that E2(q) = sum over the pairs of q_i q_j E.
  void calc_pair_strains(std::int32_t e, const ElementPoints& points, const RowMatrix& gradients, const Pairs& pairs, std::ptrdiff_t first,
                         std::ptrdiff_t count, RowMatrix& z) const;
  /// z: (rows, columns): 1/2 H^T H of every column.
  void calc_square_strains(std::int32_t e, const ElementPoints& points, const RowMatrix& gradients, RowMatrix& z) const;
  /// Stress of scaled rows at a point, times its volume: its product with engineering strains (kComponents) is the point's contribution to
  /// the product of the rows. values: (rows, columns) of the element; returns (6, columns).
  la::Matrix calc_stress(std::int32_t e, const ElementPoints& points, int point, const Eigen::Ref<const la::Matrix>& values) const;

 private:
  struct ScaledSolid {
    Matrix6 root = Matrix6::Zero();
    double mean_dilatation_modulus_pa = 0;
  };
  std::size_t material(std::int32_t e) const { return materials_->find(e); }
  /// Scales rows of Mandel strains in place and adds the row of the mean.
  void scale(std::int32_t e, const ElementPoints& points, RowMatrix& strains) const;

  const mesh::LocalMesh* local_;
  const fem::Materials* materials_;
  std::vector<ScaledSolid> solids_;
  std::vector<std::int64_t> first_row_;  // (elements + 1)
  std::vector<char> is_curved_;
};

}  // namespace carillon::coupling
