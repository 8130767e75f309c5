// Delaunay body of a distance field. Method and source: delaunay.cpp.
#include <CGAL/Labeled_mesh_domain_3.h>

#include <cmath>
#include <set>
#include <stdexcept>

#include "precompute/mesher/body_queries.hpp"

namespace carillon::mesher {
namespace {

using Domain = CGAL::Labeled_mesh_domain_3<Kernel>;

class FieldQueries final : public DomainQueries<Domain> {
 public:
  FieldQueries(const DistanceField& field, double wall_m) : field_(field), wall_m_(wall_m) {}

  void restart(std::size_t max_nodes) override {
    max_refining_ = kEvaluationsAtLeast + kEvaluationsPerNode * max_nodes;
    max_evaluations_ = max_refining_ + kEvaluationsToOptimise * max_nodes;
    // Refinement can loop at touching points without adding nodes, so the node limit does not end it.
    evaluations_ = 0;
    const auto body = [this](const Kernel::Point_3& p) {
      if (++evaluations_ > (is_refining ? max_refining_ : max_evaluations_))
        throw std::runtime_error("parts of its surface touch, or nearly so");
      return calc_body(field_, wall_m_, {p.x(), p.y(), p.z()});
    };
    const Vec3 low = field_.origin;
    Vec3 high = low;
    for (int c = 0; c < 3; ++c) high[c] += field_.voxel_m * (field_.size[c] - 1);
    const CGAL::Bbox_3 box(low[0], low[1], low[2], high[0], high[1], high[2]);
    // Bisection to a hundredth of a voxel; CGAL's bound is relative to the body's radius.
    const double radius = 0.5 * norm(high - low);
    domain_ = std::make_unique<Domain>(
        Domain::create_implicit_mesh_domain(body, box, CGAL::parameters::relative_error_bound = 0.01 * field_.voxel_m / radius));
  }

  std::vector<Vec3> find_first_points(double spacing_m) override {
    // Crossings of sample rows with the skins, thinned to one per cube of the spacing.
    std::vector<Vec3> points;
    std::set<std::array<std::int32_t, 4>> taken;
    const int skins = wall_m_ > 0 ? 2 : 1;
    for (std::int32_t k = 0; k < field_.size[2]; ++k)
      for (std::int32_t j = 0; j < field_.size[1]; ++j)
        for (std::int32_t i = 0; i + 1 < field_.size[0]; ++i)
          for (int skin = 0; skin < skins; ++skin) {
            const double a = field_.sample(i, j, k) + skin * wall_m_, b = field_.sample(i + 1, j, k) + skin * wall_m_;
            if ((a < 0) == (b < 0)) continue;
            const Vec3 p{field_.origin[0] + field_.voxel_m * (i + a / (a - b)), field_.origin[1] + field_.voxel_m * j,
                         field_.origin[2] + field_.voxel_m * k};
            std::array<std::int32_t, 4> cube{0, 0, 0, skin};
            for (int c = 0; c < 3; ++c) cube[c] = static_cast<std::int32_t>(std::floor((p[c] - field_.origin[c]) / spacing_m));
            if (taken.contains(cube)) continue;
            bool close = false;
            for (const Vec3& q : points) close = close || norm(q - p) < 0.5 * spacing_m;
            if (close) continue;
            taken.insert(cube);
            points.push_back(p);
          }
    return points;
  }

 private:
  // Sound bodies take 180 (hollow bunny of 37,000 nodes) to 280 evaluations per node (box with a wall of one element), up to 900 with
  // sliver removal; the node limit is at least four times their count.
  static constexpr std::size_t kEvaluationsAtLeast = 1'000'000, kEvaluationsPerNode = 120, kEvaluationsToOptimise = 400;

  const DistanceField& field_;
  double wall_m_;
  std::size_t evaluations_ = 0, max_refining_ = 0, max_evaluations_ = 0;
};

}  // namespace

std::unique_ptr<DelaunayBody> make_field_body(const DistanceField& field, double wall_m, const std::vector<Polyline>& curves) {
  return make_delaunay_body(std::make_unique<FieldQueries>(field, wall_m), curves);
}

}  // namespace carillon::mesher
