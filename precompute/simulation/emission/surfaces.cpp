// Method: vertices and triangles of a rank in the order of their numbers; global indices by binary search. docs/equations.md E14.
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

/// A triangle in global terms.
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
        if (one < 0 || static_cast<std::size_t>(one) >= nodes) throw InputError(fmt::format("a {} names a node that does not exist", name));
  };
  check_corners(part.triangles, "triangle of a surface");
  check_corners(part.silent, "silent triangle");
}

/// Triangles of all ranks, by number. Collective.
std::vector<Gathered> gather_triangles(const comm::Communicator& comm, const SurfacePart& part) {
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
  return all;
}

void check(const std::vector<Gathered>& all) {
  const Gathered* last = nullptr;
  for (const Gathered& one : all) {
    if (last != nullptr && last->number == one.number)
      throw InputError(fmt::format("triangle {} is on two ranks, or there twice", one.number));
    if (one.body < 0 || one.body > 1000000)
      throw InputError(fmt::format("triangle {} is of body {}, which cannot be", one.number, one.body));
    if (!(one.area_m2 > 0.0)) throw InputError(fmt::format("triangle {} of a surface has no area; repair the mesh", one.number));
    last = &one;
  }
  if (all.empty()) throw InputError("no surface sounds; set \"sounds\" of a body");
}

/// Numbers of the nodes of all triangles, ascending.
std::vector<std::int64_t> list_vertices(const std::vector<Gathered>& all) {
  std::vector<std::int64_t> vertices;
  for (const Gathered& one : all) vertices.insert(vertices.end(), one.nodes.begin(), one.nodes.end());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

std::ptrdiff_t find_place(const std::vector<std::int64_t>& list, std::int64_t number) {
  return std::lower_bound(list.begin(), list.end(), number) - list.begin();
}

SurfaceTables make_tables(const std::vector<Gathered>& all, const std::vector<std::int64_t>& vertices) {
  SurfaceTables tables;
  std::vector<double> body_area;
  tables.vertex_body.assign(vertices.size(), 0);
  for (const Gathered& one : all) {
    Triangle corner;
    for (std::size_t c = 0; c < 3; ++c) {
      corner[c] = static_cast<std::int32_t>(find_place(vertices, one.nodes[c]));
      tables.vertex_body[corner[c]] = one.body;
    }
    tables.triangles.push_back(corner);
    tables.triangle_body.push_back(one.body);
    tables.area_m2.push_back(one.area_m2);
    body_area.resize(std::max(body_area.size(), static_cast<std::size_t>(one.body) + 1), 0.0);
    body_area[one.body] += one.area_m2;
  }
  for (const double whole : body_area) tables.radius_m.push_back(std::sqrt(std::max(whole, 1e-12) / (4.0 * std::numbers::pi)));
  return tables;
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
  const std::vector<Gathered> all = gather_triangles(comm, part);
  check(all);
  triangle_total = all.size();
  const std::vector<std::int64_t> vertices = list_vertices(all);
  vertex_total = vertices.size();
  tables = make_tables(all, vertices);
  std::vector<std::int64_t> vertex_place, numbers;
  for (const std::int32_t one : node) vertex_place.push_back(find_place(vertices, part.node_number[one]));
  gathered_vertices = comm.all_gather(vertex_place);

  for (const Gathered& one : all) numbers.push_back(one.number);
  fill_slots(part, used.number, numbers);
  std::vector<std::int64_t> own_places;
  for (const std::int64_t one : place)
    if (one >= 0) own_places.push_back(one);
  gathered_places = comm.all_gather(own_places);
}

void Surfaces::add_slot(const Triangle& corner, std::int64_t at, std::int32_t of_twin) {
  corners.push_back(corner);
  place.push_back(at);
  area.push_back(tables.area_m2[at]);
  twin.push_back(of_twin);
}

std::size_t Surfaces::pad() {
  const std::size_t end = round_up(corners.size());
  corners.resize(end, Triangle{});
  place.resize(end, -1);
  area.resize(end, 0.0);
  twin.resize(end, -1);
  return end;
}

void Surfaces::fill_slots(const SurfacePart& part, const std::vector<std::int32_t>& vertex_of, const std::vector<std::int64_t>& numbers) {
  std::vector<std::size_t> order(part.triangles.size());  // by body
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(part.body[a], part.triangle_number[a]) < std::pair(part.body[b], part.triangle_number[b]);
  });
  const auto add = [&](std::size_t t, std::int32_t of_twin) {
    Triangle corner;
    for (std::size_t c = 0; c < 3; ++c) corner[c] = row[vertex_of[part.triangles[t][c]]];
    add_slot(corner, find_place(numbers, part.triangle_number[t]), of_twin);
  };
  for (std::size_t i = 0; i < order.size();) {
    const std::int32_t body = part.body[order[i]];
    Run run{corners.size(), 0, 0, body};
    // Second sides of thin sheets follow all other triangles.
    std::map<Triangle, std::size_t> sides;  // corners, lowest first -> slot
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
      add(order[i], -1);
    }
    run.middle = pad();
    for (const auto& [t, of_twin] : second) add(t, of_twin);
    run.end = pad();
    runs.push_back(run);
  }
  has_twin.assign(corners.size(), false);
  for (const std::int32_t one : twin)
    if (one >= 0) has_twin[one] = true;
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
