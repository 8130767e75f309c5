// Method:     vertices and triangles of a rank in the order of their numbers; places among all by binary search.
// Source:     docs/equations.md E14.
// Deviations: none.
#include "precompute/simulation/emission/surfaces.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/base/used_points.hpp"

namespace carillon::emission {
namespace {

/// A triangle as all ranks know it.
struct Gathered {
  std::int64_t number;
  std::int32_t body;
  std::array<std::int64_t, 3> nodes;
  double area_m2;
};

std::size_t round_up(std::size_t n) { return (n + kLane - 1) / kLane * kLane; }

void check(const SurfacePart& part) {
  const std::size_t nodes = part.nodes_m.size();
  if (part.node_number.size() != nodes || part.triangle_number.size() != part.triangles.size() || part.body.size() != part.triangles.size())
    throw InputError("lists of nodes or triangles of a surface have different lengths");
  const auto check_corners = [&](const std::vector<Triangle>& triangles, const char* name) {
    for (const Triangle& corner : triangles)
      for (const std::int32_t one : corner)
        if (one < 0 || static_cast<std::size_t>(one) >= nodes) throw InputError(fmt::format("a {} names a node that is not there", name));
  };
  check_corners(part.triangles, "triangle of a surface");
  check_corners(part.silent, "silent triangle");
}

}  // namespace

Surfaces::Surfaces(const comm::Communicator& communicator, const SurfacePart& part) : comm(communicator) {
  comm.agree([&] { check(part); });

  base::UsedPoints used = base::find_used_points(part.triangles, part.nodes_m.size());
  node = std::move(used.points);
  rest = Rows(get_rows());
  for (std::size_t v = 0; v < node.size(); ++v) {
    row.push_back(static_cast<std::int32_t>(v / kVertices * kLane + v % kVertices * 3));
    const Vec3& place_m = part.nodes_m[node[v]];
    std::copy(place_m.begin(), place_m.end(), rest.get() + row.back());
  }

  // The triangles of all ranks.
  auto all = comm.all_gather([&] {
    std::vector<Gathered> own;
    for (std::size_t t = 0; t < part.triangles.size(); ++t) {
      const auto at = [&](std::size_t c) { return static_cast<std::size_t>(part.triangles[t][c]); };
      const Vec3& a = part.nodes_m[at(0)];
      own.push_back({part.triangle_number[t],
                     part.body[t],
                     {part.node_number[at(0)], part.node_number[at(1)], part.node_number[at(2)]},
                     0.5 * norm(cross(part.nodes_m[at(1)] - a, part.nodes_m[at(2)] - a))});
    }
    return own;
  });
  std::sort(all.begin(), all.end(), [](const Gathered& a, const Gathered& b) { return a.number < b.number; });
  triangle_total = all.size();
  std::vector<std::int64_t> numbers;
  std::vector<double> body_area;
  for (const Gathered& one : all) {
    if (!numbers.empty() && numbers.back() == one.number)
      throw InputError(fmt::format("triangle {} is on two ranks, or there twice", one.number));
    if (one.body < 0 || one.body > 1000000)
      throw InputError(fmt::format("triangle {} is of body {}, which cannot be", one.number, one.body));
    if (!(one.area_m2 > 0.0)) throw InputError(fmt::format("triangle {} of a surface has no area; repair the mesh", one.number));
    numbers.push_back(one.number);
    body_area.resize(std::max(body_area.size(), static_cast<std::size_t>(one.body) + 1), 0.0);
    body_area[one.body] += one.area_m2;
  }
  if (numbers.empty()) throw InputError("no surface sounds; set \"sounds\" of a body");
  const auto find_place = [](const std::vector<std::int64_t>& list, std::int64_t number) {
    return std::lower_bound(list.begin(), list.end(), number) - list.begin();
  };
  std::vector<std::int64_t> vertices;
  for (const Gathered& one : all) vertices.insert(vertices.end(), one.nodes.begin(), one.nodes.end());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  vertex_total = vertices.size();
  tables.vertex_body.assign(vertex_total, 0);
  for (const Gathered& one : all) {
    Triangle corner;
    for (std::size_t c = 0; c < 3; ++c) {
      corner[c] = static_cast<std::int32_t>(find_place(vertices, one.nodes[c]));
      tables.vertex_body[corner[c]] = one.body;
    }
    tables.triangles.push_back(corner);
    tables.triangle_body.push_back(one.body);
    tables.area_m2.push_back(one.area_m2);
  }
  for (const double whole : body_area) tables.radius_m.push_back(std::sqrt(std::max(whole, 1e-12) / (4.0 * std::numbers::pi)));
  std::vector<std::int64_t> vertex_place;
  for (const std::int32_t one : node) vertex_place.push_back(find_place(vertices, part.node_number[one]));
  gathered_vertices = comm.all_gather(vertex_place);

  // Own triangles, body after body.
  std::vector<std::size_t> order(part.triangles.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(part.body[a], part.triangle_number[a]) < std::pair(part.body[b], part.triangle_number[b]);
  });
  const auto add_slot = [&](std::size_t t, std::int32_t of_twin) {
    Triangle corner;
    for (std::size_t c = 0; c < 3; ++c) corner[c] = row[used.number[part.triangles[t][c]]];
    corners.push_back(corner);
    place.push_back(find_place(numbers, part.triangle_number[t]));
    area.push_back(tables.area_m2[place.back()]);
    twin.push_back(of_twin);
  };
  const auto pad = [&] {
    const std::size_t end = round_up(corners.size());
    corners.resize(end, Triangle{});
    place.resize(end, -1);
    area.resize(end, 0.0);
    twin.resize(end, -1);
    return end;
  };
  for (std::size_t i = 0; i < order.size();) {
    const std::int32_t body = part.body[order[i]];
    Run run{corners.size(), 0, 0, body};
    // Of the two sides of a thin sheet the second one is behind all others.
    std::map<Triangle, std::size_t> sides;  // corners from the lowest on, slot
    std::vector<std::pair<std::size_t, std::int32_t>> second;
    for (; i < order.size() && part.body[order[i]] == body; ++i) {
      Triangle turned = part.triangles[order[i]];
      std::rotate(turned.begin(), std::min_element(turned.begin(), turned.end()), turned.end());
      if (const auto other = sides.find({turned[0], turned[2], turned[1]}); other != sides.end()) {
        second.emplace_back(order[i], static_cast<std::int32_t>(other->second));
        sides.erase(other);
        continue;
      }
      sides.emplace(turned, corners.size());
      add_slot(order[i], -1);
    }
    run.middle = pad();
    for (const auto& [t, of_twin] : second) add_slot(t, of_twin);
    run.end = pad();
    runs.push_back(run);
  }
  has_twin.assign(corners.size(), false);
  for (const std::int32_t one : twin)
    if (one >= 0) has_twin[one] = true;

  std::vector<std::int64_t> own_places;
  for (const std::int64_t one : place)
    if (one >= 0) own_places.push_back(one);
  gathered_places = comm.all_gather(own_places);
}

std::vector<Vec3> Surfaces::gather_vertices(const double* x) const {
  std::vector<Vec3> own;
  for (const std::int32_t one : row) own.push_back(get_vertex(x, one));
  const std::vector<Vec3> all = comm.all_gather(own);
  std::vector<Vec3> vertices(vertex_total);
  for (std::size_t i = 0; i < all.size(); ++i) vertices[gathered_vertices[i]] = all[i];
  return vertices;
}

}  // namespace carillon::emission
