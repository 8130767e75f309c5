// Queries of CGAL's Mesh_3 as an interface: its templates compile slowly, so they are instantiated for one domain (delaunay.cpp) only.
// Included by the delaunay files only.
#pragma once

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include <boost/optional.hpp>
#include <boost/variant.hpp>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include "precompute/mesher/delaunay.hpp"

namespace carillon::mesher {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

/// Surface of one body, for CGAL's concept MeshDomain_3. Invariant: after restart() the same queries in the same order give the same
/// answers. restart() comes before any query. A query may throw std::runtime_error beyond its limit on the number of queries.
class BodyQueries {
 public:
  using Inside = boost::optional<int>;  // 1 inside, none outside
  using PatchIndex = std::pair<int, int>;
  using Patch = boost::optional<PatchIndex>;
  using Index = boost::variant<int, PatchIndex>;
  using Crossing = std::tuple<Kernel::Point_3, Index, int>;
  static constexpr PatchIndex kPatch{0, 1};  // the only patch: between outside and inside

  virtual ~BodyQueries() = default;
  /// Called before each refinement; `max_nodes` scales the query limit.
  virtual void restart(std::size_t max_nodes) = 0;
  /// Points on every part of the boundary, about `spacing_m` apart.
  virtual std::vector<Vec3> find_first_points(double spacing_m) = 0;

  virtual CGAL::Bbox_3 calc_box() const = 0;
  virtual Inside find_inside(const Kernel::Point_3& point) const = 0;
  virtual Patch find_patch(const Kernel::Segment_3& query) const = 0;
  virtual Patch find_patch(const Kernel::Ray_3& query) const = 0;
  virtual Patch find_patch(const Kernel::Line_3& query) const = 0;
  /// Intersection of the query with the boundary; valid only directly after find_patch() found a patch for the same query.
  virtual Crossing find_crossing(const Kernel::Segment_3& query) const = 0;
  virtual Crossing find_crossing(const Kernel::Ray_3& query) const = 0;
  virtual Crossing find_crossing(const Kernel::Line_3& query) const = 0;

  /// True during refinement; sliver removal has a higher query limit.
  bool is_refining = false;
};

/// Query count of CGAL's domain, reset by restart().
template <class Domain>
class DomainQueries : public BodyQueries {
 public:
  CGAL::Bbox_3 calc_box() const override { return domain_->bbox(); }
  Inside find_inside(const Kernel::Point_3& point) const override { return domain_->is_in_domain_object()(point); }
  Patch find_patch(const Kernel::Segment_3& query) const override { return domain_->do_intersect_surface_object()(query); }
  Patch find_patch(const Kernel::Ray_3& query) const override { return domain_->do_intersect_surface_object()(query); }
  Patch find_patch(const Kernel::Line_3& query) const override { return domain_->do_intersect_surface_object()(query); }
  Crossing find_crossing(const Kernel::Segment_3& query) const override { return domain_->construct_intersection_object()(query); }
  Crossing find_crossing(const Kernel::Ray_3& query) const override { return domain_->construct_intersection_object()(query); }
  Crossing find_crossing(const Kernel::Line_3& query) const override { return domain_->construct_intersection_object()(query); }

 protected:
  std::unique_ptr<Domain> domain_;
};

/// Mesh of a body by Delaunay refinement. `curves` lie on its boundary and become edges of the mesh.
std::unique_ptr<DelaunayBody> make_delaunay_body(std::unique_ptr<BodyQueries> queries, const std::vector<Polyline>& curves);

}  // namespace carillon::mesher
