// Bodies with a round section: cylinder, disc, cone and ring.
//
// Method: the disc is a lattice of six sectors (five, seven or eight for other counts) whose ring i of 6 i points maps to a circle; its
//   triangles are nearly regular. It is swept along the axis (around the circle for the ring) in layers of prisms. Layers of a truncated
//   cone grow with its radius to keep their aspect ratio. A pointed cone is six refined tetrahedra around its axis, so that level i has i
//   rings; layers of prisms may follow, so that levels and rings are independent. Mid-side nodes lie at the mean radius of their corners
//   about the section axis: exact on the surface, and the bulge fades with the square of the radius.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "precompute/mesh/shapes/lattice.hpp"
#include "precompute/mesh/shapes/plan.hpp"

namespace carillon::shapes {
namespace {

constexpr double kPi = std::numbers::pi;
/// A node in sweep coordinates: section (x along a, y along b, from its centre) [m], and position along the sweep.
struct Local {
  double a = 0.0, b = 0.0, along = 0.0;
};

/// Sweep: section radius and mapping. `place` preserves the orientation of (a, b, along).
struct Sweep {
  std::function<double(double)> radius;
  std::function<Vec3(const Local&)> place;
  double period = 0.0;  // of `along`, for a ring
  int sectors = 6;      // of the section
};

int count_points(int sectors, int rings) { return 1 + sectors * rings * (rings + 1) / 2; }

/// Index of point `at` of a sector of ring `ring`.
std::int32_t find_point(int sectors, int ring, int sector, int at) {
  if (ring == 0) return 0;
  return static_cast<std::int32_t>(count_points(sectors, ring - 1) + (sector * ring + at) % (sectors * ring));
}

/// Points of a section of `rings` rings at a sweep position.
void append_section(std::vector<Local>& nodes, int sectors, int rings, double radius, double along) {
  nodes.push_back({0.0, 0.0, along});
  for (int ring = 1; ring <= rings; ++ring) {
    const double r = ring == rings ? radius : radius * ring / rings;
    for (int p = 0; p < sectors * ring; ++p) {
      const double angle = 2.0 * kPi * p / (sectors * ring);
      nodes.push_back({r * std::cos(angle), r * std::sin(angle), along});
    }
  }
}

/// Triangles of the section, counter-clockwise in (a, b).
std::vector<std::array<std::int32_t, 3>> make_triangles(int sectors, int rings) {
  std::vector<std::array<std::int32_t, 3>> triangles;
  for (int sector = 0; sector < sectors; ++sector) {
    for (int ring = 0; ring < rings; ++ring) {
      for (int at = 0; at <= ring; ++at) {
        triangles.push_back({find_point(sectors, ring, sector, at), find_point(sectors, ring + 1, sector, at),
                             find_point(sectors, ring + 1, sector, at + 1)});
        if (at < ring)
          triangles.push_back({find_point(sectors, ring, sector, at), find_point(sectors, ring + 1, sector, at + 1),
                               find_point(sectors, ring, sector, at + 1)});
      }
    }
  }
  return triangles;
}

/// Mesh under construction.
struct Built {
  mesh::TetMesh mesh;
  std::vector<Local> nodes;
  std::vector<std::int32_t> first, last, round;  // nodes of the first and last section, and the rim of all sections
};

void append_layer(Built& built, const std::vector<std::array<std::int32_t, 3>>& triangles, std::int32_t low, std::int32_t high) {
  for (const auto& t : triangles) append_prism(built.mesh, {low + t[0], low + t[1], low + t[2]}, {high + t[0], high + t[1], high + t[2]});
}

/// Sections at the given positions, joined by prisms; for a ring the last joins the first.
Built sweep_sections(const Sweep& sweep, int rings, const std::vector<double>& along) {
  Built built;
  const std::vector<std::array<std::int32_t, 3>> triangles = make_triangles(sweep.sectors, rings);
  const auto per_section = static_cast<std::int32_t>(count_points(sweep.sectors, rings));
  for (const double s : along) append_section(built.nodes, sweep.sectors, rings, sweep.radius(s), s);
  const auto sections = static_cast<std::int32_t>(along.size());
  for (std::int32_t k = 0; k + 1 < sections; ++k) append_layer(built, triangles, k * per_section, (k + 1) * per_section);
  if (sweep.period > 0.0) append_layer(built, triangles, (sections - 1) * per_section, 0);
  for (std::int32_t n = 0; n < sections * per_section; ++n) {
    if (n % per_section >= count_points(sweep.sectors, rings - 1)) built.round.push_back(n);
    if (n < per_section) built.first.push_back(n);
    if (n >= (sections - 1) * per_section) built.last.push_back(n);
  }
  return built;
}

/// Cone with its tip at 0: `rings` refined levels, then layers of prisms up to `levels`.
Built make_point(const Sweep& sweep, double height, int rings, int levels) {
  Built built;
  std::vector<std::int32_t> first_of_level;
  for (int level = 0; level <= levels; ++level) {
    const double s = level == levels ? height : height * level / levels;
    first_of_level.push_back(static_cast<std::int32_t>(built.nodes.size()));
    append_section(built.nodes, sweep.sectors, std::min(level, rings), sweep.radius(s), s);
    const int outer = std::min(level, rings);
    for (int p = level == 0 ? 0 : count_points(sweep.sectors, outer - 1); p < count_points(sweep.sectors, outer); ++p)
      built.round.push_back(first_of_level.back() + p);
  }
  for (const Local& node : built.nodes) built.mesh.nodes_m.push_back(sweep.place(node));  // the refinement compares lengths
  for (int sector = 0; sector < sweep.sectors; ++sector) {
    append_refined(built.mesh, rings,
                   [&](int centre, int a, int b) { return first_of_level[centre + a + b] + find_point(sweep.sectors, a + b, sector, b); });
  }
  const std::vector<std::array<std::int32_t, 3>> triangles = make_triangles(sweep.sectors, rings);
  for (int level = rings; level < levels; ++level) append_layer(built, triangles, first_of_level[level], first_of_level[level + 1]);
  built.first = {0};
  for (std::int32_t n = first_of_level.back(); n < static_cast<std::int32_t>(built.nodes.size()); ++n) built.last.push_back(n);
  return built;
}

Local find_middle(const Sweep& sweep, Local p, Local q) {
  if (sweep.period > 0.0 && std::abs(p.along - q.along) > 0.5 * sweep.period) (p.along < q.along ? p : q).along += sweep.period;
  Local middle{0.5 * (p.a + q.a), 0.5 * (p.b + q.b), 0.5 * (p.along + q.along)};
  const double mean = 0.5 * (std::hypot(p.a, p.b) + std::hypot(q.a, q.b)), straight = std::hypot(middle.a, middle.b);
  if (!(straight > 0.0)) return middle;
  const double fraction = mean / sweep.radius(middle.along);
  const double weight = fraction > 1.0 - 1e-9 ? 1.0 : fraction * fraction;
  const double stretch = 1.0 + weight * (mean / straight - 1.0);
  return {middle.a * stretch, middle.b * stretch, middle.along};
}

mesh::TetMesh finish(const Sweep& sweep, Built built, int order, const std::array<std::string, 3>& names) {
  built.mesh.nodes_m.clear();
  for (const Local& node : built.nodes) built.mesh.nodes_m.push_back(sweep.place(node));
  if (!names[0].empty()) built.mesh.node_sets[names[0]] = built.first;
  if (!names[1].empty()) built.mesh.node_sets[names[1]] = built.last;
  built.mesh.node_sets[names[2]] = built.round;
  if (order == 2) {
    raise_order(built.mesh,
                [&](std::int32_t p, std::int32_t q) { return sweep.place(find_middle(sweep, built.nodes[p], built.nodes[q])); });
  }
  return std::move(built.mesh);
}

std::vector<double> divide_evenly(double length, int layers) {
  std::vector<double> along(layers + 1);
  for (int k = 0; k <= layers; ++k) along[k] = k == layers ? length : length * k / layers;
  return along;
}

/// One body per number of sectors, six first; others serve counts that six cannot give. `make_body` takes the sweep.
template <typename MakeBody>
std::vector<Body> plan_sectors(Sweep sweep, const MakeBody& make_body) {
  std::vector<Body> bodies;
  for (const int sectors : {6, 7, 5, 8}) {
    sweep.sectors = sectors;
    Body body = make_body(sweep);
    body.reluctance = 0.2 * std::abs(sectors - 6);
    bodies.push_back(std::move(body));
  }
  return bodies;
}

/// Common part of cylinder, disc and truncated cone: rings, layers. `divide` gives the section positions for a number of layers.
std::vector<Body> plan_swept(const Sweep& swept, double radius, double length, int order, const std::array<std::string, 3>& names,
                             const std::function<std::vector<double>(int)>& divide) {
  return plan_sectors(swept, [&](const Sweep& sweep) {
    Body body;
    body.lengths = {radius, length, 0.0, 0.0};
    body.wanted = {2, order == 1 ? 2 : 1, 1, 1};
    body.calc_counts = [sectors = sweep.sectors](const Divisions& d) {
      const long long n = d[0], layers = d[1], triangles = sectors * n * n;
      return Counts{(1 + sectors * n * (n + 1) / 2) * (layers + 1), 3 * triangles * layers, 2 * triangles + 2 * sectors * n * layers, 1};
    };
    body.make = [=](const Divisions& d) { return finish(sweep, sweep_sections(sweep, d[0], divide(d[1])), order, names); };
    return body;
  });
}

}  // namespace

std::vector<Body> plan_cylinder(double length_m, double radius_m, int order) {
  const Sweep sweep{[=](double) { return radius_m; }, [=](const Local& n) { return Vec3{n.along - 0.5 * length_m, n.a, n.b}; }};
  return plan_swept(sweep, radius_m, length_m, order, {"end-min", "end-max", "side"}, [=](int n) { return divide_evenly(length_m, n); });
}

std::vector<Body> plan_disc(double radius_m, double thickness_m, int order) {
  const Sweep sweep{[=](double) { return radius_m; }, [=](const Local& n) { return Vec3{n.a, n.b, n.along - 0.5 * thickness_m}; }};
  return plan_swept(sweep, radius_m, thickness_m, order, {"z-min", "z-max", "edge"}, [=](int n) { return divide_evenly(thickness_m, n); });
}

std::vector<Body> plan_cone(double radius_m, double top_radius_m, double height_m, int order) {
  // Along the axis from the top down, so that sections grow.
  const Sweep cone{[=](double s) { return s >= height_m ? radius_m : top_radius_m + (radius_m - top_radius_m) * (s / height_m); },
                   [=](const Local& n) {
                     return Vec3{n.b, n.a, 0.5 * height_m - n.along};
                   }};
  const std::array<std::string, 3> names{"top", "base", "side"};
  if (top_radius_m == 0.0) {
    return plan_sectors(cone, [&](const Sweep& sweep) {
      Body body;
      body.lengths = {radius_m, height_m, 0.0, 0.0};
      body.wanted = {2, 2, 1, 1};
      body.calc_counts = [sectors = sweep.sectors](const Divisions& d) {
        const long long f = d[0], more = std::max(0, d[1] - d[0]);  // at least as many levels as rings
        const long long triangles = sectors * f * f;
        return Counts{f + 1 + sectors * f * (f + 1) * (f + 2) / 6 + more * (1 + sectors * f * (f + 1) / 2), triangles * (f + 3 * more),
                      2 * triangles + 2 * sectors * f * more, 1};
      };
      body.make = [=](const Divisions& d) { return finish(sweep, make_point(sweep, height_m, d[0], std::max(d[0], d[1])), order, names); };
      return body;
    });
  }
  // Layers as thick as the triangles there are wide: their number is the integral of 1 / radius.
  const double ratio = std::log(radius_m / top_radius_m), spread = radius_m / top_radius_m - 1.0;
  const bool is_cylinder = std::abs(spread) < 1e-6;
  const double widest = std::max(radius_m, top_radius_m);
  return plan_swept(cone, widest, is_cylinder ? height_m : height_m * widest * ratio / (radius_m - top_radius_m), order, names,
                    [=](int layers) {
                      std::vector<double> along = divide_evenly(height_m, layers);
                      if (!is_cylinder) {
                        for (std::size_t k = 1; k + 1 < along.size(); ++k)
                          along[k] = height_m * std::expm1(ratio * along[k] / height_m) / spread;
                      }
                      return along;
                    });
}

std::vector<Body> plan_ring(double radius_m, double thickness_m, int order) {
  const double section = 0.5 * thickness_m;
  const Sweep ring{[=](double) { return section; },
                   [=](const Local& n) {
                     const double r = radius_m + n.b;
                     return Vec3{r * std::cos(n.along), r * std::sin(n.along), n.a};
                   },
                   2.0 * kPi};
  return plan_sectors(ring, [&](const Sweep& sweep) {
    Body body;
    body.lengths = {section, 2.0 * kPi * radius_m, 0.0, 0.0};
    body.coarsest = {1, 6, 1, 1};
    body.wanted = {2, 12, 1, 1};
    body.calc_counts = [sectors = sweep.sectors](const Divisions& d) {
      const long long n = d[0], around = d[1];
      return Counts{(1 + sectors * n * (n + 1) / 2) * around, 3 * sectors * n * n * around, 2 * sectors * n * around, 0};
    };
    body.make = [=](const Divisions& d) {
      std::vector<double> along = divide_evenly(2.0 * kPi, d[1]);
      along.pop_back();
      return finish(sweep, sweep_sections(sweep, d[0], along), order, {"", "", "surface"});
    };
    return body;
  });
}

}  // namespace carillon::shapes
