// Round bodies: solid ball, bowl and closed spherical shell.
//
// Method: Ball: the icosahedron's 20 tetrahedra (centre and a face) are nearly regular; each is refined into frequency^3 parts, nodes of
//   equal centre weight map to a sphere, and layers of prisms may follow outside, so that radial and tangential divisions are independent.
//   No flat-folded cube edges, hence no slivers. Octahedra of the refinement are cut along their shortest diagonal. Shell: rings of points
//   around a pole, six sectors; the points of a ring follow its circumference, neighbouring rings are joined by the shorter diagonal, the
//   triangles are extruded through the wall into prisms. Radii grow geometrically. Mid-side nodes: mean radius of their corners, exact on
//   the spheres; in the ball the bulge fades with the square of the radius.
// Source: Bey 1995, Computing 55, 355 (refinement).
#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include "precompute/mesh/shapes/lattice.hpp"
#include "precompute/mesh/shapes/plan.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::shapes {
namespace {

// ---------------------------------------------------------------- ball

// Triangulated polyhedron with vertices on the unit sphere.
struct Polyhedron {
  std::vector<Vec3> vertices;
  std::vector<std::array<int, 3>> faces;  // counter-clockwise from outside
};

// Two poles and two rings of `sides` points each, staggered by half a step: sides 5 is the icosahedron, 0 the octahedron.
Polyhedron make_polyhedron(int sides) {
  Polyhedron body;
  if (sides == 0) {
    body.vertices = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
    body.faces = {{0, 1, 2}, {1, 3, 2}, {3, 4, 2}, {4, 0, 2}, {1, 0, 5}, {3, 1, 5}, {4, 3, 5}, {0, 4, 5}};
    return body;
  }
  // Polar angle of the upper ring: icosahedron, and least Coulomb energy for the others.
  const double polar = sides == 5 ? std::acos(1.0 / std::sqrt(5.0)) : (sides == 4 ? 65.1 : 58.7) * std::numbers::pi / 180.0;
  body.vertices = {{0, 0, 1}, {0, 0, -1}};
  for (int ring = 0; ring < 2; ++ring) {
    for (int i = 0; i < sides; ++i) {
      const double angle = 2.0 * std::numbers::pi * (i + 0.5 * ring) / sides;
      body.vertices.push_back(
          {std::sin(polar) * std::cos(angle), std::sin(polar) * std::sin(angle), (ring == 0 ? 1.0 : -1.0) * std::cos(polar)});
    }
  }
  for (int i = 0; i < sides; ++i) {
    const int next = (i + 1) % sides;
    const int upper = 2 + i, upper_next = 2 + next, lower = 2 + sides + i, lower_next = 2 + sides + next;
    body.faces.push_back({0, upper, upper_next});
    body.faces.push_back({1, lower_next, lower});
    body.faces.push_back({upper, lower, upper_next});
    body.faces.push_back({lower, lower_next, upper_next});
  }
  return body;
}

// Solid core of the ball: frequency levels up to `radius`, and the triangles of its surface.
class Core {
 public:
  Core(const Polyhedron& solid, int frequency, double radius) : frequency_(frequency), radius_(radius), solid_(solid) {
    for (const auto& face : solid_.faces) refine(face);
  }
  mesh::TetMesh mesh;
  std::vector<std::array<std::int32_t, 3>> skin;

 private:
  // Node of face weights (a, b, c); the centre has the weight frequency - a - b - c.
  std::int32_t find_node(const std::array<int, 3>& face, const std::array<int, 3>& weights) {
    std::array<std::uint64_t, 3> parts{};
    for (int i = 0; i < 3; ++i) {
      parts[i] = weights[i] == 0 ? 0 : (static_cast<std::uint64_t>(weights[i]) << 4) | static_cast<std::uint64_t>(face[i]);
    }
    std::sort(parts.begin(), parts.end());
    const std::uint64_t key = (parts[0] << 42) | (parts[1] << 21) | parts[2];
    const auto [entry, is_new] = node_of_.try_emplace(key, static_cast<std::int32_t>(mesh.nodes_m.size()));
    if (is_new) {
      Vec3 sum{};
      for (int i = 0; i < 3; ++i) {
        for (int axis = 0; axis < 3; ++axis) sum[axis] += weights[i] * solid_.vertices[face[i]][axis];
      }
      const int level = weights[0] + weights[1] + weights[2];
      mesh.nodes_m.push_back(level == 0 ? Vec3{} : ((radius_ * level / frequency_ / norm(sum)) * sum));
    }
    return entry->second;
  }

  void refine(const std::array<int, 3>& face) {
    append_refined(
        mesh, frequency_,
        [&](int a, int b, int c) {
          return find_node(face, {a, b, c});
        },
        &skin);
  }

  int frequency_;
  double radius_;
  Polyhedron solid_;
  std::unordered_map<std::uint64_t, std::int32_t> node_of_;
};

mesh::TetMesh make_ball(double radius, int sides, int frequency, int levels, int order) {
  Core core(make_polyhedron(sides), frequency, radius * frequency / levels);
  mesh::TetMesh mesh = std::move(core.mesh);
  std::vector<std::int32_t> skin_nodes;
  for (const auto& triangle : core.skin) skin_nodes.insert(skin_nodes.end(), triangle.begin(), triangle.end());
  std::sort(skin_nodes.begin(), skin_nodes.end());
  skin_nodes.erase(std::unique(skin_nodes.begin(), skin_nodes.end()), skin_nodes.end());
  std::unordered_map<std::int32_t, std::int32_t> place_in_skin;
  for (std::size_t i = 0; i < skin_nodes.size(); ++i) place_in_skin[skin_nodes[i]] = static_cast<std::int32_t>(i);

  std::vector<std::int32_t> below = skin_nodes;
  for (int level = frequency + 1; level <= levels; ++level) {
    std::vector<std::int32_t> above;
    for (std::int32_t node : skin_nodes) {
      above.push_back(static_cast<std::int32_t>(mesh.nodes_m.size()));
      mesh.nodes_m.push_back((static_cast<double>(level) / frequency) * mesh.nodes_m[node]);
    }
    for (const auto& triangle : core.skin) {
      std::array<std::int32_t, 3> bottom{}, top{};
      for (int i = 0; i < 3; ++i) {
        bottom[i] = below[place_in_skin[triangle[i]]];
        top[i] = above[place_in_skin[triangle[i]]];
      }
      append_prism(mesh, bottom, top);
    }
    below = std::move(above);
  }
  for (std::int32_t node : below) mesh.nodes_m[node] = (radius / norm(mesh.nodes_m[node])) * mesh.nodes_m[node];
  mesh.node_sets["surface"] = below;
  if (order == 2) {
    raise_order(mesh, [&](std::int32_t a, std::int32_t b) {
      const Vec3 straight = calc_middle(mesh.nodes_m[a], mesh.nodes_m[b]);
      const double mean = 0.5 * (norm(mesh.nodes_m[a]) + norm(mesh.nodes_m[b]));
      const double fraction = mean / radius;
      const double bulge = mean / norm(straight) - 1.0;
      const double weight = fraction > 1.0 - 1e-9 ? 1.0 : fraction * fraction;
      return (1.0 + weight * bulge) * straight;
    });
  }
  return mesh;
}

// ---------------------------------------------------------------- shell

constexpr int kSectors = 6;

// Points per sector on each ring from the pole (0) to the rim; a closed shell ends in the other pole (0).
std::vector<int> calc_rings(double half_angle, int rings, int widest) {
  const bool closed = half_angle >= std::numbers::pi;
  const double largest = half_angle > 0.5 * std::numbers::pi ? 1.0 : std::sin(half_angle);
  std::vector<int> points(rings + 1, 0);
  for (int i = 1; i <= rings; ++i) {
    if (closed && i == rings) break;
    const int asked = static_cast<int>(std::lround(widest * std::sin(half_angle * i / rings) / largest));
    points[i] = std::clamp(asked, 1, closed ? std::min(i, rings - i) : i);
  }
  return points;
}

struct Cap {
  std::vector<Vec3> directions;
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::int32_t first_of_rim = -1;  // first direction on the rim; -1 when closed
};

// Joins two rings within every sector by the shorter diagonal.
void join_rings(Cap& cap, std::int32_t inner_first, int inner, std::int32_t outer_first, int outer) {
  const auto on = [](std::int32_t first, int count, int sector, int at) {
    return count == 0 ? first : first + static_cast<std::int32_t>((sector * count + at) % (kSectors * count));
  };
  for (int sector = 0; sector < kSectors; ++sector) {
    int a = 0, b = 0;
    while (a < inner || b < outer) {
      const double step_inner = inner == 0 ? HUGE_VAL : std::abs((a + 1.0) / inner - (outer == 0 ? 0.0 : b / (1.0 * outer)));
      const double step_outer = outer == 0 ? HUGE_VAL : std::abs((b + 1.0) / outer - (inner == 0 ? 0.0 : a / (1.0 * inner)));
      const bool tie = std::abs(step_inner - step_outer) < 1e-9;
      const bool take_outer = a == inner || (b < outer && (tie ? 2 * b < outer : step_outer < step_inner));
      const std::int32_t from_a = on(inner_first, inner, sector, a), from_b = on(outer_first, outer, sector, b);
      if (take_outer) {
        cap.triangles.push_back({from_a, from_b, on(outer_first, outer, sector, b + 1)});
        ++b;
      } else {
        cap.triangles.push_back({from_a, from_b, on(inner_first, inner, sector, a + 1)});
        ++a;
      }
    }
  }
}

Cap make_cap(double half_angle, int rings, int widest) {
  const std::vector<int> points = calc_rings(half_angle, rings, widest);
  Cap cap;
  std::int32_t previous_first = 0;
  for (int i = 0; i <= rings; ++i) {
    const std::int32_t first = static_cast<std::int32_t>(cap.directions.size());
    const double polar = half_angle * i / rings;
    if (points[i] == 0) {
      cap.directions.push_back({0.0, 0.0, i == 0 ? -1.0 : 1.0});
    } else {
      for (int p = 0; p < kSectors * points[i]; ++p) {
        const double angle = 2.0 * std::numbers::pi * p / (kSectors * points[i]);
        cap.directions.push_back({std::sin(polar) * std::cos(angle), std::sin(polar) * std::sin(angle), -std::cos(polar)});
      }
    }
    if (i > 0) join_rings(cap, previous_first, points[i - 1], first, points[i]);
    previous_first = first;
  }
  for (auto& t : cap.triangles) {
    if (calc_det(cap.directions[t[0]], cap.directions[t[1]], cap.directions[t[2]]) < 0.0) std::swap(t[1], t[2]);
  }
  if (points[rings] > 0) cap.first_of_rim = previous_first;
  return cap;
}

mesh::TetMesh make_shell(double outer_radius, double wall, double half_angle, int rings, int layers, int widest, int order) {
  const Cap cap = make_cap(half_angle, rings, widest);
  const std::int32_t per_layer = static_cast<std::int32_t>(cap.directions.size());
  const double inner_radius = outer_radius - wall;
  const auto radius = [&](int layer) {
    if (layer == layers) return outer_radius;
    return inner_radius * std::pow(outer_radius / inner_radius, static_cast<double>(layer) / layers);
  };
  mesh::TetMesh mesh;
  const auto on_rim = [&](std::int32_t node) { return cap.first_of_rim >= 0 && node % per_layer >= cap.first_of_rim; };
  for (int layer = 0; layer <= layers; ++layer) {
    for (std::int32_t p = 0; p < per_layer; ++p) {
      const auto node = static_cast<std::int32_t>(mesh.nodes_m.size());
      if (layer == 0) mesh.node_sets["inner"].push_back(node);
      if (layer == layers) mesh.node_sets["outer"].push_back(node);
      if (on_rim(node)) mesh.node_sets["rim"].push_back(node);
      mesh.nodes_m.push_back(radius(layer) * cap.directions[p]);
    }
  }
  for (int layer = 0; layer < layers; ++layer) {
    const std::int32_t low = layer * per_layer, high = low + per_layer;
    for (const auto& t : cap.triangles) append_prism(mesh, {low + t[0], low + t[1], low + t[2]}, {high + t[0], high + t[1], high + t[2]});
  }
  if (order == 1) return mesh;
  raise_order(mesh, [&](std::int32_t a, std::int32_t b) {
    const double mean = 0.5 * (radius(a / per_layer) + radius(b / per_layer));
    Vec3 middle = calc_middle(cap.directions[a % per_layer], cap.directions[b % per_layer]);
    if (on_rim(a) && on_rim(b)) {  // on the rim cone: halve only the angle about the axis
      const double across = std::sin(half_angle) / std::hypot(middle[0], middle[1]);
      middle = {middle[0] * across, middle[1] * across, -std::cos(half_angle)};
    }
    return (mean / norm(middle)) * middle;
  });
  return mesh;
}

}  // namespace

std::vector<Body> plan_ball(double radius_m, int order) {
  std::vector<Body> bodies;
  for (int sides : {5, 4, 6, 0}) {
    const int faces = sides == 0 ? 8 : 4 * sides;
    Body body;
    // Edge of a regular triangle with the mean face area.
    body.lengths = {radius_m * std::sqrt(16.0 * std::numbers::pi / (std::sqrt(3.0) * faces)), radius_m, 0.0, 0.0};
    body.calc_counts = [faces](const Divisions& d) {
      const long long f = d[0], more = std::max(0, d[1] - d[0]);  // at least as many levels as the frequency
      const long long half = faces / 2;                           // the sphere of frequency i has half i^2 + 2 vertices
      const long long core = 1 + half * (f * (f + 1) * (2 * f + 1) / 6) + 2 * f;
      return Counts{core + more * (half * f * f + 2), faces * f * f * (f + 3 * more), faces * f * f, 1};
    };
    body.make = [=](const Divisions& d) { return make_ball(radius_m, sides, d[0], std::max(d[0], d[1]), order); };
    body.reluctance = sides == 5 ? 0.0 : sides == 0 ? 0.6 : 0.3;
    bodies.push_back(std::move(body));
  }
  return bodies;
}

Body plan_shell(double outer_radius_m, double wall_m, double half_angle_rad, int order) {
  const bool closed = half_angle_rad >= std::numbers::pi;
  const double mean_radius = outer_radius_m - 0.5 * wall_m;
  const double widest = half_angle_rad > 0.5 * std::numbers::pi ? 1.0 : std::sin(half_angle_rad);
  Body body;
  body.lengths = {mean_radius * half_angle_rad, mean_radius * std::log(outer_radius_m / (outer_radius_m - wall_m)),
                  2.0 * std::numbers::pi / kSectors * mean_radius * widest, 0.0};
  body.coarsest = {closed ? 4 : 2, 1, closed ? 1 : 1, 1};
  body.wanted = {closed ? 6 : 3, order == 1 ? 2 : 1, 2, 1};
  body.calc_counts = [=](const Divisions& d) {
    long long points = 1, triangles = 0;
    const std::vector<int> rings = calc_rings(half_angle_rad, d[0], d[2]);
    for (std::size_t i = 1; i < rings.size(); ++i) {
      points += rings[i] == 0 ? 1 : kSectors * rings[i];
      triangles += kSectors * (rings[i - 1] + rings[i]);
    }
    const long long rim = kSectors * rings.back(), layers = d[1];
    return Counts{points * (layers + 1), 3 * layers * triangles, 2 * (triangles + rim * layers), closed ? 2 : 1};
  };
  body.make = [=](const Divisions& d) { return make_shell(outer_radius_m, wall_m, half_angle_rad, d[0], d[1], d[2], order); };
  return body;
}

}  // namespace carillon::shapes
