// Method:     Galerkin with hat functions; midpoint rule for all pairs of facets, sixteen test facets against one patch at a time
//   (tile.hpp), plus the sparse static part (static_part.hpp). The right-hand side is applied to the velocities while the kernels are in
//   the cache and never stored as a matrix.
// Source:     A. Burton, G. Miller (1971); integration by parts: A. Maue (1949), docs/equations.md E10.
// Deviations: alpha is capped at low wave numbers, where i / k would degrade the surface pressure.
#include "precompute/air/equations.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>

namespace carillon::air {
namespace {

constexpr std::size_t kPatchFacets = 192;  // rows of its midpoints fit into the L2 cache

using ComplexMatrix = Eigen::Matrix<std::complex<float>, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Free {
  void operator()(float* memory) const { std::free(memory); }
};
using Room = std::unique_ptr<float[], Free>;

/// Floats aligned to a cache line.
Room make_room(std::size_t count) {
  const std::size_t bytes = (count * sizeof(float) + 63) / 64 * 64;
  Room room(static_cast<float*>(std::aligned_alloc(64, std::max<std::size_t>(bytes, 64))));
  if (!room) throw std::bad_alloc();
  return room;
}

/// Numbers the distinct values of `items` in order; `local`: number of each item.
std::vector<std::int32_t> number_locally(std::span<const std::int32_t> items, std::vector<std::int32_t>& local) {
  std::vector<std::int32_t> distinct(items.begin(), items.end());
  std::sort(distinct.begin(), distinct.end());
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  local.clear();
  for (const std::int32_t item : items)
    local.push_back(static_cast<std::int32_t>(std::lower_bound(distinct.begin(), distinct.end(), item) - distinct.begin()));
  return distinct;
}

}  // namespace

void LinearSystem::multiply(const Sides& x, Sides& y) const {
  multiply_rows(reinterpret_cast<const float*>(matrix.data()), count_rows(), unknowns, x.values.data(), x.padded / kSideLanes,
                y.values.data());
}

BlockInverse::BlockInverse(const LinearSystem& system) {
  for (std::size_t first = system.first; first < system.last; first += kBlockRows) {
    const auto rows = static_cast<Eigen::Index>(std::min(kBlockRows, system.last - first));
    const Eigen::Map<const ComplexMatrix, 0, Eigen::OuterStride<>> block(&system.matrix[(first - system.first) * system.unknowns + first],
                                                                         rows, rows,
                                                                         Eigen::OuterStride<>(static_cast<Eigen::Index>(system.unknowns)));
    ComplexMatrix inverse = ComplexMatrix(block).partialPivLu().inverse();
    if (!inverse.allFinite()) inverse.setIdentity();
    blocks_.emplace_back(inverse.data(), inverse.data() + inverse.size());
  }
}

double solve_directly(const LinearSystem& system, Sides& solution) {
  const auto unknowns = static_cast<Eigen::Index>(system.unknowns), sides = static_cast<Eigen::Index>(system.sides);
  const Eigen::Map<const ComplexMatrix> matrix(system.matrix.data(), unknowns, unknowns), right(system.right.data(), unknowns, sides);
  const Eigen::PartialPivLU<ComplexMatrix> factors(matrix);
  ComplexMatrix found = factors.solve(right);
  found += factors.solve(ComplexMatrix(right - matrix * found));
  solution = Sides(std::span(found.data(), static_cast<std::size_t>(found.size())), system.unknowns, system.sides);
  const ComplexMatrix left = right - matrix * found;
  double worst = 0.0;
  for (Eigen::Index m = 0; m < sides; ++m)
    if (const double size = right.col(m).norm(); size > 0.0) worst = std::max(worst, static_cast<double>(left.col(m).norm()) / size);
  return found.allFinite() ? worst : std::numeric_limits<double>::infinity();
}

void BlockInverse::apply(Sides& rows) const {
  std::vector<float> result(kBlockRows * 2 * rows.padded);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const std::size_t count = std::min(kBlockRows, rows.unknowns - b * kBlockRows), size = count * 2 * rows.padded;
    float* at = rows.get_real(b * kBlockRows);
    multiply_rows(reinterpret_cast<const float*>(blocks_[b].data()), count, count, at, rows.padded / kSideLanes, result.data());
    std::copy_n(result.begin(), size, at);
  }
}

double calc_coupling(double k, double radius_m) { return 1.0 / std::max(k, 1.0 / radius_m); }

BoundaryEquations::BoundaryEquations(const RadiatingSurface& surface, const Sphere& sphere, std::vector<float> velocity, std::size_t count,
                                     StaticPart static_part)
    : surface_(surface),
      velocity_(std::move(velocity)),
      count_(count),
      sphere_(sphere),
      static_(std::move(static_part)),
      mass_(surface.count_nodes()) {
  for (const Facet& facet : surface_.get_facets())
    for (const std::int32_t node : facet.corners) mass_[node] += facet.area_m2 / 3.0;
  for (std::size_t first = 0; first < surface_.count_facets(); first += kPatchFacets)
    patches_.push_back(make_patch(first, std::min(first + kPatchFacets, surface_.count_facets())));
}

BoundaryEquations::PatchData BoundaryEquations::make_patch(std::size_t first, std::size_t last) const {
  const std::vector<Facet>& facets = surface_.get_facets();
  PatchData patch;
  patch.first_facet = first;
  patch.last_facet = last;
  std::vector<std::int32_t> points, nodes, node_of_corner;
  for (std::size_t t = first; t < last; ++t) {
    points.insert(points.end(), facets[t].points.begin(), facets[t].points.end());
    nodes.insert(nodes.end(), facets[t].corners.begin(), facets[t].corners.end());
    patch.size_m = std::max(patch.size_m, facets[t].size_m);
  }
  patch.point_number = number_locally(points, patch.facet_points);
  patch.node_number = number_locally(nodes, node_of_corner);
  for (const std::int32_t p : patch.point_number) {
    const EdgePoint& point = surface_.get_points()[p];
    PatchPoint made{};
    for (std::size_t axis = 0; axis < 3; ++axis) made.place[axis] = static_cast<float>(point.place_m[axis] - sphere_.centre_m[axis]);
    made.reach = kNearPoints * static_cast<float>(point.size_m);
    patch.points.push_back(made);
  }
  std::vector<std::vector<std::int32_t>> next_points(patch.node_number.size()), next_facets(patch.node_number.size());
  std::vector<std::vector<float>> curls(patch.node_number.size());
  for (std::size_t t = first; t < last; ++t) {
    for (std::size_t c = 0; c < 3; ++c) {
      PatchPoint& point = patch.points[patch.facet_points[(t - first) * 3 + c]];
      for (std::size_t axis = 0; axis < 3; ++axis)
        point.normal[axis] += static_cast<float>(facets[t].area_m2 / 6.0 * facets[t].normal[axis]);
      const std::size_t node = node_of_corner[(t - first) * 3 + c];
      next_facets[node].push_back(static_cast<std::int32_t>(t - first));
      for (const double x : facets[t].curl[c]) curls[node].push_back(static_cast<float>(facets[t].area_m2 / 3.0 * x));
      for (const std::size_t other : {(c + 1) % 3, (c + 2) % 3}) next_points[node].push_back(patch.facet_points[(t - first) * 3 + other]);
    }
  }
  patch.first_point.push_back(0);
  patch.first_facet_of_node.push_back(0);
  for (std::size_t node = 0; node < patch.node_number.size(); ++node) {
    auto& row = next_points[node];
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    patch.node_points.insert(patch.node_points.end(), row.begin(), row.end());
    patch.node_facets.insert(patch.node_facets.end(), next_facets[node].begin(), next_facets[node].end());
    patch.node_curls.insert(patch.node_curls.end(), curls[node].begin(), curls[node].end());
    patch.first_point.push_back(static_cast<std::int32_t>(patch.node_points.size()));
    patch.first_facet_of_node.push_back(static_cast<std::int32_t>(patch.node_facets.size()));
  }
  std::vector<Vec3> places;
  for (const std::int32_t node : patch.node_number) places.push_back(surface_.get_nodes()[node]);
  patch.sphere = find_enclosing_sphere(places);
  return patch;
}

TestBlock BoundaryEquations::make_block(std::size_t first) const {
  TestBlock block{};
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const bool fills_up = first + lane >= surface_.count_facets();
    const Facet& facet = surface_.get_facets()[fills_up ? first : first + lane];
    block.weight[lane] = fills_up ? 0.0F : static_cast<float>(facet.area_m2 / (12.0 * std::numbers::pi));
    for (std::size_t c = 0; c < 3; ++c) {
      const EdgePoint& point = surface_.get_points()[facet.points[c]];
      block.reach[c][lane] = kNearPoints * static_cast<float>(point.size_m);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        block.place[c][axis][lane] = static_cast<float>(point.place_m[axis] - sphere_.centre_m[axis]);
        block.curl[c][axis][lane] = static_cast<float>(facet.curl[c][axis]);
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis) block.normal[axis][lane] = static_cast<float>(facet.normal[axis]);
  }
  return block;
}

/// (points, padded) sources: a third of the area times the velocity at the midpoint, summed over the facets of the patch.
std::vector<float> BoundaryEquations::make_sources(const PatchData& patch, std::span<const std::int32_t> sides, std::size_t padded) const {
  std::vector<float> sources(patch.points.size() * padded);
  for (std::size_t t = patch.first_facet; t < patch.last_facet; ++t) {
    const auto share = static_cast<float>(surface_.get_facets()[t].area_m2 / 6.0);
    for (std::size_t c = 0; c < 3; ++c) {
      float* at = &sources[static_cast<std::size_t>(patch.facet_points[(t - patch.first_facet) * 3 + c]) * padded];
      const float *a = &velocity_[(t * 3 + (c + 1) % 3) * count_], *b = &velocity_[(t * 3 + (c + 2) % 3) * count_];
      for (std::size_t m = 0; m < sides.size(); ++m) at[m] += share * (a[sides[m]] + b[sides[m]]);
    }
  }
  return sources;
}

void BoundaryEquations::assemble(double k, std::span<const std::int32_t> sides, std::size_t first, std::size_t last,
                                 LinearSystem& system) const {
  const std::size_t unknowns = surface_.count_nodes(), padded = (sides.size() + kSources - 1) / kSources * kSources;
  system.unknowns = unknowns;
  system.first = first;
  system.last = last;
  system.sides = sides.size();
  system.matrix.assign((last - first) * unknowns, {});
  system.right.assign((last - first) * sides.size(), {});
  const double coupling = calc_coupling(k, sphere_.radius_m);
  const WaveNumber wave{static_cast<float>(k), static_cast<float>(coupling)};
  std::size_t points = 0, nodes = 0, facets = 0;
  std::vector<std::vector<float>> sources;
  for (const PatchData& patch : patches_) {
    points = std::max(points, patch.points.size());
    nodes = std::max(nodes, patch.node_number.size());
    facets = std::max(facets, patch.last_facet - patch.first_facet);
    sources.push_back(make_sources(patch, sides, padded));
  }
  const Room point_room = make_room(points * 8 * kLanes), facet_room = make_room(facets * 2 * kLanes),
             matrix_room = make_room(nodes * 6 * kLanes), right_room = make_room(padded * 6 * kLanes);
  const auto is_mine = [&](std::int32_t node) { return static_cast<std::size_t>(node) >= first && static_cast<std::size_t>(node) < last; };
  for (std::size_t block_first = 0; block_first < surface_.count_facets(); block_first += kLanes) {
    const std::size_t lanes = std::min<std::size_t>(kLanes, surface_.count_facets() - block_first);
    const std::span<const Facet> block_facets = std::span(surface_.get_facets()).subspan(block_first, lanes);
    const bool has_rows = std::any_of(block_facets.begin(), block_facets.end(),
                                      [&](const Facet& facet) { return std::any_of(facet.corners.begin(), facet.corners.end(), is_mine); });
    if (!has_rows) continue;
    const TestBlock block = make_block(block_first);
    std::vector<Vec3> corners;
    double size = 0.0;
    for (const Facet& facet : block_facets) {
      for (const std::int32_t node : facet.corners) corners.push_back(surface_.get_nodes()[node]);
      size = std::max(size, facet.size_m);
    }
    Sphere around{corners[0], 0.0};  // approximate
    for (const Vec3& corner : corners) around.radius_m = std::max(around.radius_m, norm(corner - around.centre_m));
    std::fill(right_room.get(), right_room.get() + padded * 6 * kLanes, 0.0F);
    for (std::size_t p = 0; p < patches_.size(); ++p) {
      const PatchData& data = patches_[p];
      const double gap = norm(data.sphere.centre_m - around.centre_m) - data.sphere.radius_m - around.radius_m;
      const Patch patch{.points = static_cast<int>(data.points.size()),
                        .facets = static_cast<int>(data.last_facet - data.first_facet),
                        .nodes = static_cast<int>(data.node_number.size()),
                        .point = data.points.data(),
                        .facet_points = data.facet_points.data(),
                        .first_point = data.first_point.data(),
                        .node_points = data.node_points.data(),
                        .first_facet = data.first_facet_of_node.data(),
                        .node_facets = data.node_facets.data(),
                        .node_curls = data.node_curls.data(),
                        .source = sources[p].data(),
                        .sources = static_cast<int>(padded),
                        .may_be_near = gap < std::max(size, data.size_m)};
      calc_tile(block, patch, wave, {point_room.get(), facet_room.get()}, matrix_room.get(), right_room.get());
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        for (std::size_t c = 0; c < 3; ++c) {
          const std::int32_t row = block_facets[lane].corners[c];
          if (!is_mine(row)) continue;
          std::complex<float>* to = &system.matrix[(static_cast<std::size_t>(row) - first) * unknowns];
          const float* from = matrix_room.get() + 2 * c * kLanes + lane;
          for (std::size_t j = 0; j < data.node_number.size(); ++j, from += 6 * kLanes)
            to[data.node_number[j]] += std::complex<float>(from[0], from[kLanes]);
        }
      }
    }
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      for (std::size_t c = 0; c < 3; ++c) {
        const std::int32_t row = block_facets[lane].corners[c];
        if (!is_mine(row)) continue;
        std::complex<float>* to = &system.right[(static_cast<std::size_t>(row) - first) * sides.size()];
        const float* from = right_room.get() + 2 * c * kLanes + lane;
        for (std::size_t m = 0; m < sides.size(); ++m, from += 6 * kLanes) to[m] += std::complex<float>(from[0], from[kLanes]);
      }
    }
  }
  add_sparse(k, coupling, sides, system);
}

/// Adds the static part and the terms 1/2 p and alpha 1/2 q, then scales each row.
void BoundaryEquations::add_sparse(double k, double coupling, std::span<const std::int32_t> sides, LinearSystem& system) const {
  using Complex = std::complex<double>;
  const Complex alpha(0.0, coupling);
  for (const Facet& facet : surface_.get_facets()) {
    const std::size_t t = &facet - surface_.get_facets().data();
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t row = facet.corners[i];
      if (row < system.first || row >= system.last) continue;
      for (std::size_t j = 0; j < 3; ++j) {
        const double mass = facet.area_m2 / (i == j ? 6.0 : 12.0);
        system.matrix[(row - system.first) * system.unknowns + static_cast<std::size_t>(facet.corners[j])] +=
            static_cast<float>(0.5 * mass);
        const float* v = &velocity_[(t * 3 + j) * count_];
        const Complex by_velocity = -0.5 * mass * alpha;
        std::complex<float>* right = &system.right[(row - system.first) * system.sides];
        for (std::size_t m = 0; m < sides.size(); ++m) right[m] += std::complex<float>(by_velocity * static_cast<double>(v[sides[m]]));
      }
    }
  }
  for (std::size_t row = system.first; row < system.last; ++row) {
    std::complex<float>* matrix = &system.matrix[(row - system.first) * system.unknowns];
    for (std::size_t at = static_.first[row]; at < static_.first[row + 1]; ++at)
      matrix[static_.column[at]] +=
          std::complex<float>(-static_.double_layer[at] + alpha * (static_.curls[at] - k * k * static_.normals[at]));
    std::complex<float>* right = &system.right[(row - system.first) * system.sides];
    const double *single = static_.single.data() + row * count_, *adjoint = static_.adjoint.data() + row * count_;
    for (std::size_t m = 0; m < sides.size(); ++m) right[m] -= std::complex<float>(single[sides[m]] + alpha * adjoint[sides[m]]);
    const auto scale = static_cast<float>(2.0 / mass_[row]);
    for (std::size_t j = 0; j < system.unknowns; ++j) matrix[j] *= scale;
    for (std::size_t m = 0; m < sides.size(); ++m) right[m] *= scale;
  }
}

std::size_t BoundaryEquations::calc_bytes() const {
  std::size_t bytes = velocity_.size() * sizeof(float) + static_.calc_bytes();
  for (const PatchData& patch : patches_)
    bytes += patch.points.size() * sizeof(PatchPoint) +
             4 * (patch.node_points.size() + patch.node_facets.size() + patch.facet_points.size()) + 4 * patch.node_curls.size();
  return bytes;
}

}  // namespace carillon::air
