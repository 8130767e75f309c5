// Method: restricted Delaunay refinement, then sliver perturbation and exudation, with balls protecting the sharp curves. Initial surface
//   points are sampled here: CGAL shoots random lines from a centre and can miss a part of the body.
// Source: Boissonnat and Oudot 2005 (refinement); Cheng, Dey, Edelsbrunner, Facello and Teng 2000 (exudation); Tournois, Srinivasan and
//   Alliez 2009 (perturbation); all in CGAL 5.5 Mesh_3.

// On a duplicate point CGAL throws, after writing dump-bug.mesh and dump-bug.binary.cgal to the working directory. Marking its header as
// included and defining empty functions suppresses the files.
#define CGAL_MESH_3_DUMP_C3T3_H
#include <string>
namespace CGAL {
template <class Complex>
void dump_c3t3(const Complex&, const std::string&) {}
template <class Complex>
void dump_c3t3_edges(const Complex&, const std::string&) {}
}  // namespace CGAL

#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_domain_with_polyline_features_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/exude_mesh_3.h>
#include <CGAL/make_mesh_3.h>
#include <CGAL/perturb_mesh_3.h>
#include <CGAL/refine_mesh_3.h>

#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "precompute/mesher/body_queries.hpp"
#include "precompute/mesher/tet_quality.hpp"

namespace carillon::mesher {
namespace {

constexpr std::int64_t kMaxPinches = 10;
constexpr double kPerturbedAngleRatio = 0.75;  // of the requested angle: smooth.cpp does the rest faster
// Limit on surface queries by refinement: CGAL's can loop without end at touching skins. Sound bodies take at most 12 queries per node,
// self-touching ones 50.
constexpr std::int64_t kQueries = 500000;
constexpr std::int64_t kQueriesPerNode = 100;

/// BodyQueries as CGAL's concept MeshDomain_3. Only finite points are passed on: circumcentres of nearly flat tetrahedra may be infinite,
/// and GMP aborts the process on non-finite numbers.
class QueriedDomain {
 public:
  using R = Kernel;
  using FT = Kernel::FT;
  using Point_3 = Kernel::Point_3;
  using Segment_3 = Kernel::Segment_3;
  using Ray_3 = Kernel::Ray_3;
  using Line_3 = Kernel::Line_3;
  using Vector_3 = Kernel::Vector_3;
  using Sphere_3 = Kernel::Sphere_3;
  using Has_features = CGAL::Tag_false;
  using Subdomain_index = int;
  using Subdomain = BodyQueries::Inside;
  using Surface_patch_index = BodyQueries::PatchIndex;
  using Surface_patch = BodyQueries::Patch;
  using Index = BodyQueries::Index;
  using Intersection = BodyQueries::Crossing;

  explicit QueriedDomain(const BodyQueries* queries) : queries_(queries) {}

  /// Decremented by every query; a query at 0 throws.
  mutable std::int64_t queries_left = std::numeric_limits<std::int64_t>::max();

  struct Construct_initial_points {  // required by the concept; initial points are sampled elsewhere
    template <class Out>
    Out operator()(Out out, int = 0) const {
      return out;
    }
  };
  Construct_initial_points construct_initial_points_object() const { return {}; }
  CGAL::Bbox_3 bbox() const { return queries_->calc_box(); }

  struct Is_in_domain {
    const QueriedDomain& domain;
    Subdomain operator()(const Point_3& point) const {
      return std::isfinite(point.x() + point.y() + point.z()) ? domain.get_queries().find_inside(point) : Subdomain();
    }
  };
  Is_in_domain is_in_domain_object() const { return {*this}; }

  struct Do_intersect_surface {
    const QueriedDomain& domain;
    template <class Query>
    Surface_patch operator()(const Query& query) const {
      return is_finite(query) ? domain.get_queries().find_patch(query) : Surface_patch();
    }
  };
  Do_intersect_surface do_intersect_surface_object() const { return {*this}; }

  struct Construct_intersection {
    const QueriedDomain& domain;
    template <class Query>
    Intersection operator()(const Query& query) const {
      return is_finite(query) ? domain.get_queries().find_crossing(query) : Intersection();
    }
  };
  Construct_intersection construct_intersection_object() const { return {*this}; }

 private:
  /// Segment, ray or line through two of its points.
  template <class Query>
  static bool is_finite(const Query& query) {
    double sum = 0;
    for (int n = 0; n < 2; ++n)
      for (int c = 0; c < 3; ++c) sum += query.point(n)[c];
    return std::isfinite(sum);
  }

  const BodyQueries& get_queries() const {
    if (queries_left-- == 0) throw std::runtime_error("parts of the surface touch, or nearly so");
    return *queries_;
  }

  const BodyQueries* queries_;
};

/// Domain with sharp curves, and a limit on the protecting balls: for inseparable curves CGAL places ever smaller balls without checking
/// its own limit on vertices.
class BoundedCurves : public CGAL::Mesh_domain_with_polyline_features_3<QueriedDomain> {
  using Base = CGAL::Mesh_domain_with_polyline_features_3<QueriedDomain>;

 public:
  using Base::Base;

  std::size_t max_balls = 0;
  Point_3 construct_point_on_curve(const Point_3& start, const Curve_index& curve, FT distance) const {
    if (++balls_ > max_balls) throw std::runtime_error("the sharp edges lie too close to each other");
    return Base::construct_point_on_curve(start, curve, distance);
  }

 private:
  mutable std::size_t balls_ = 0;
};

/// DelaunayBody by Mesh_3. Invariant: a mesh depends only on its sizes and on whether an earlier one touched itself: refine() restarts
/// CGAL's random numbers and the queries.
class Mesh3Body final : public DelaunayBody {
  using Domain = BoundedCurves;
  using Triangulation = CGAL::Mesh_triangulation_3<Domain, CGAL::Default, CGAL::Sequential_tag>::type;
  using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation, Domain::Corner_index, Domain::Curve_index>;
  using Criteria = CGAL::Mesh_criteria_3<Triangulation>;
  using Point = Kernel::Point_3;
  using WeightedPoint = Triangulation::Weighted_point;
  using TriangulationIndex = Triangulation::Vertex::Index;

 public:
  Mesh3Body(std::unique_ptr<BodyQueries> queries, const std::vector<Polyline>& curves) : queries_(std::move(queries)), polylines_(curves) {
    for (const Polyline& curve : curves) {
      curves_.emplace_back();
      for (const Vec3& p : curve) curves_.back().emplace_back(p[0], p[1], p[2]);
    }
  }

  mesh::TetMesh refine(const DelaunaySizes& sizes) override {
    namespace p = CGAL::parameters;
    // Restart the random numbers: equal sizes give equal meshes.
    CGAL::get_default_random() = CGAL::Random(0);
    queries_->is_refining = false;
    queries_->restart(sizes.max_nodes);
    domain_ = std::make_unique<Domain>(queries_.get());
    if (!curves_.empty()) domain_->add_features(curves_.begin(), curves_.end());
    // Nodes on the sharp edges and twice as many more: part of a fifth of max_nodes.
    domain_->max_balls = 2000 + sizes.max_nodes / 8;
    complex_ = Complex();
    const double radius = kRadiusPerEdge * sizes.edge_m;
    narrow_ = calc_curve_sizes(polylines_, sizes.edge_m);
    const auto calc_edge = [this, edge_m = sizes.edge_m](const Point& at, int, const TriangulationIndex&) -> double {
      return calc_size(narrow_, edge_m, {at.x(), at.y(), at.z()});
    };
    criteria_.emplace(p::edge_size = calc_edge, p::facet_angle = 25, p::facet_size = radius, p::facet_distance = sizes.distance_m,
                      p::cell_radius_edge_ratio = 2, p::cell_size = radius);
    // The node limit stops endless ball insertion between curves that nearly touch.
    CGAL::Mesh_error_code unused = CGAL::CGAL_MESH_3_NO_ERROR;
    if (!curves_.empty()) CGAL::Mesh_3::internal::init_c3t3_with_features(complex_, *domain_, *criteria_, false, sizes.max_nodes, &unused);
    insert_first_points(sizes.edge_m);
    max_nodes_ = sizes.max_nodes;
    // CGAL's manifold criterion tests every edge repeatedly, although most of the boundary is a manifold. A few pinches are cheaper to
    // repair; bodies that touch themselves have many, at every size.
    refine_complex(touches_ ? p::manifold() : p::non_manifold());
    if (!touches_ && count_pinches() > kMaxPinches) {
      touches_ = true;
      refine_complex(p::manifold());
    }
    // Faces are refined before cells: if faces alone reached the limit there are no cells, which does not mean too few nodes.
    if (complex_.number_of_cells_in_complex() == 0 && complex_.triangulation().number_of_vertices() >= sizes.max_nodes)
      throw std::runtime_error("its faces meet in angles too sharp for elements of this size");
    return extract();
  }

  mesh::TetMesh optimise(double angle_deg) override {
    namespace p = CGAL::parameters;
    if (angle_deg <= 0) return extract();
    // Exudation removes nine of ten slivers in a tenth of the time; the rest is left to perturbation, followed by another exudation.
    CGAL::exude_mesh_3(complex_, p::time_limit = 0, p::sliver_bound = angle_deg);
    CGAL::perturb_mesh_3(complex_, *domain_, p::time_limit = 0, p::sliver_bound = kPerturbedAngleRatio * angle_deg);
    CGAL::exude_mesh_3(complex_, p::time_limit = 0, p::sliver_bound = angle_deg);
    return extract();
  }

 private:
  std::unique_ptr<BodyQueries> queries_;
  std::unique_ptr<Domain> domain_;
  std::vector<Polyline> polylines_;         // sharp curves
  std::vector<std::vector<Point>> curves_;  // the same for CGAL

  // Mesh_3 bounds circumradii; the mean tetrahedron edge is about 1.1 times that bound.
  static constexpr double kRadiusPerEdge = 0.9;

  void refine_complex(const CGAL::parameters::internal::Manifold_options& topology) {
    namespace p = CGAL::parameters;
    CGAL::Mesh_error_code unused = CGAL::CGAL_MESH_3_NO_ERROR;
    queries_->is_refining = true;
    domain_->queries_left = kQueries + kQueriesPerNode * static_cast<std::int64_t>(max_nodes_);
    CGAL::refine_mesh_3(complex_, *domain_, *criteria_, p::no_perturb(), p::no_exude(), topology,
                        p::mesh_3_options(p::maximal_number_of_vertices = max_nodes_, p::pointer_to_error_code = &unused));
    domain_->queries_left = std::numeric_limits<std::int64_t>::max();
    queries_->is_refining = false;
  }

  /// Number of edges and nodes at which the boundary touches itself.
  std::int64_t count_pinches() const {
    std::unordered_map<const void*, std::int32_t> number;
    std::vector<Triangle> faces;
    for (auto facet = complex_.facets_in_complex_begin(); facet != complex_.facets_in_complex_end(); ++facet) {
      faces.emplace_back();
      for (int c = 0; c < 3; ++c) {
        const void* const v = &*facet->first->vertex((facet->second + 1 + c) % 4);
        faces.back()[c] = number.try_emplace(v, static_cast<std::int32_t>(number.size())).first->second;
      }
    }
    return mesher::count_pinches(faces);
  }

  void insert_first_points(double edge_m) {
    auto& triangulation = complex_.triangulation();
    // A point in or near a curve's ball would be hidden by it, or give it a needlessly short neighbour.
    std::vector<WeightedPoint> balls;
    for (auto v = triangulation.finite_vertices_begin(); v != triangulation.finite_vertices_end(); ++v)
      balls.push_back(triangulation.point(v));
    for (const Vec3& position : queries_->find_first_points(3 * edge_m)) {
      const Point point(position[0], position[1], position[2]);
      if (!balls.empty() && triangulation.dimension() == 3) {
        const auto nearest = triangulation.nearest_power_vertex(point);
        const auto& ball = triangulation.point(nearest);
        if (CGAL::squared_distance(ball.point(), point) < 2 * ball.weight()) continue;
      }
      const auto v = triangulation.insert(WeightedPoint(point));
      if (v == Triangulation::Vertex_handle()) continue;
      complex_.set_dimension(v, 2);
      complex_.set_index(v, domain_->index_from_surface_patch_index(BodyQueries::kPatch));
    }
  }

  mesh::TetMesh extract() const {
    mesh::TetMesh out;
    std::unordered_map<const void*, std::int32_t> number;
    number.reserve(complex_.triangulation().number_of_vertices());
    for (auto cell = complex_.cells_in_complex_begin(); cell != complex_.cells_in_complex_end(); ++cell)
      for (int c = 0; c < 4; ++c) {
        const auto v = cell->vertex(c);
        const auto [found, fresh] = number.try_emplace(static_cast<const void*>(&*v), static_cast<std::int32_t>(out.nodes_m.size()));
        if (fresh)
          out.nodes_m.push_back({CGAL::to_double(v->point().x()), CGAL::to_double(v->point().y()), CGAL::to_double(v->point().z())});
        out.tets.push_back(found->second);
      }
    out.regions.assign(out.tets.size() / 4, 0);
    return out;
  }

  Complex complex_;
  std::optional<Criteria> criteria_;
  std::size_t max_nodes_ = 0;
  bool touches_ = false;            // parts of the boundary touch unless kept apart
  std::vector<SizedPoint> narrow_;  // curves closer together than the edge length
};

}  // namespace

std::unique_ptr<DelaunayBody> make_delaunay_body(std::unique_ptr<BodyQueries> queries, const std::vector<Polyline>& curves) {
  return std::make_unique<Mesh3Body>(std::move(queries), curves);
}

}  // namespace carillon::mesher
