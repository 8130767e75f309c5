// Closed surfaces for codec tests.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "runtime/bank/packed/levels.hpp"
#include "runtime/bank/packed/surface.hpp"
#include "tests/unit/runtime/acoustics/radiation/sphere_bank.hpp"

namespace carillon::packed::example {

struct Mesh {
  std::vector<Vec3> vertices_m;
  std::vector<Triangle> triangles;
};

inline Mesh make_tetrahedron() { return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}}; }

/// Sphere of 10 * 4^divisions + 2 vertices.
inline Mesh make_ball(int divisions, double radius_m = 1.0) {
  const bank::Bank bank = testing::make_sphere_surface(radius_m, divisions);
  return {bank.vertices_m, bank.triangles};
}

inline Mesh make_torus(std::int32_t around, std::int32_t across) {
  Mesh mesh;
  constexpr double kTurn = 6.283185307179586;
  for (std::int32_t i = 0; i < around; ++i)
    for (std::int32_t j = 0; j < across; ++j) {
      const double a = kTurn * i / around, b = kTurn * j / across, r = 1.0 + 0.4 * std::cos(b);
      mesh.vertices_m.push_back({r * std::cos(a), r * std::sin(a), 0.4 * std::sin(b)});
      const auto at = [&](std::int32_t u, std::int32_t v) { return (u % around) * across + v % across; };
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

/// Ball with a spherical cavity: two shells, the inner one inward.
inline Mesh make_hollow_ball(int divisions) {
  Mesh mesh = make_ball(divisions);
  const Mesh inner = make_ball(divisions, 0.6);
  const auto first = static_cast<std::int32_t>(mesh.vertices_m.size());
  mesh.vertices_m.insert(mesh.vertices_m.end(), inner.vertices_m.begin(), inner.vertices_m.end());
  for (const auto& [a, b, c] : inner.triangles) mesh.triangles.push_back({first + a, first + c, first + b});
  return mesh;
}

/// Two balls sharing an edge, which belongs to four triangles, twice per direction.
inline Mesh make_touching_balls(int divisions) {
  Mesh mesh = make_ball(divisions);
  const std::size_t count = mesh.vertices_m.size(), triangles = mesh.triangles.size();
  const std::int32_t a = mesh.triangles[0][0], b = mesh.triangles[0][1];
  const Vec3 start = mesh.vertices_m[a], along = normalise(mesh.vertices_m[b] - start);
  std::vector<std::int32_t> turned(count);
  for (std::size_t v = 0; v < count; ++v) {  // half a turn about the edge
    if (static_cast<std::int32_t>(v) == a || static_cast<std::int32_t>(v) == b) {
      turned[v] = static_cast<std::int32_t>(v);
      continue;
    }
    const Vec3 x = mesh.vertices_m[v] - start;
    turned[v] = static_cast<std::int32_t>(mesh.vertices_m.size());
    mesh.vertices_m.push_back(start + 2.0 * dot(x, along) * along - x);
  }
  for (std::size_t t = 0; t < triangles; ++t) {
    const Triangle corners = mesh.triangles[t];
    mesh.triangles.push_back({turned[corners[0]], turned[corners[1]], turned[corners[2]]});
  }
  return mesh;
}

/// Closed plate of n x n squares with a thickness of 1/200 of its side.
inline Mesh make_plate(std::int32_t n) {
  Mesh mesh;
  for (std::int32_t side = 0; side < 2; ++side)
    for (std::int32_t i = 0; i <= n; ++i)
      for (std::int32_t j = 0; j <= n; ++j) mesh.vertices_m.push_back({1.0 * i / n, 1.0 * j / n, side / 200.0});
  const auto at = [&](std::int32_t side, std::int32_t i, std::int32_t j) { return (side * (n + 1) + i) * (n + 1) + j; };
  const auto add = [&](std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  for (std::int32_t i = 0; i < n; ++i)
    for (std::int32_t j = 0; j < n; ++j) {
      add(at(1, i, j), at(1, i + 1, j), at(1, i + 1, j + 1), at(1, i, j + 1));
      add(at(0, i, j), at(0, i, j + 1), at(0, i + 1, j + 1), at(0, i + 1, j));
    }
  for (std::int32_t i = 0; i < n; ++i) {
    add(at(0, i, 0), at(0, i + 1, 0), at(1, i + 1, 0), at(1, i, 0));
    add(at(0, i + 1, n), at(0, i, n), at(1, i, n), at(1, i + 1, n));
    add(at(0, 0, i + 1), at(0, 0, i), at(1, 0, i), at(1, 0, i + 1));
    add(at(0, n, i), at(0, n, i + 1), at(1, n, i + 1), at(1, n, i));
  }
  return mesh;
}

/// The same surface with shuffled vertices, triangles and first corners.
inline Mesh shuffle(const Mesh& mesh, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::int32_t> order(mesh.vertices_m.size());
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), random);
  Mesh shuffled = mesh;
  for (std::size_t v = 0; v < order.size(); ++v) shuffled.vertices_m[order[v]] = mesh.vertices_m[v];
  for (Triangle& triangle : shuffled.triangles) {
    for (std::int32_t& corner : triangle) corner = order[corner];
    std::rotate(triangle.begin(), triangle.begin() + random() % 3, triangle.end());
  }
  std::shuffle(shuffled.triangles.begin(), shuffled.triangles.end(), random);
  return shuffled;
}

inline double calc_area_m2(const Mesh& mesh) {
  double area = 0.0;
  for (const auto& [a, b, c] : mesh.triangles)
    area += 0.5 * norm(cross(mesh.vertices_m[b] - mesh.vertices_m[a], mesh.vertices_m[c] - mesh.vertices_m[a]));
  return area;
}

inline std::vector<Place> find_places(const Mesh& mesh, double step_m) {
  std::vector<Place> places;
  for (const Vec3& x : mesh.vertices_m)
    places.push_back({static_cast<std::int32_t>(std::lround(x[0] / step_m)), static_cast<std::int32_t>(std::lround(x[1] / step_m)),
                      static_cast<std::int32_t>(std::lround(x[2] / step_m))});
  return places;
}

inline std::span<const std::byte> as_bytes(const std::vector<std::uint8_t>& bytes) { return std::as_bytes(std::span(bytes)); }

inline std::vector<std::uint8_t> write_mesh(const Mesh& mesh, double step_m = 1.0 / 8192.0) {
  return write_surface({}, step_m, find_places(mesh, step_m), mesh.triangles, find_levels(mesh.vertices_m, calc_area_m2(mesh))).bytes;
}

inline Surface make_surface(const Mesh& mesh, double step_m = 1.0 / 8192.0) {
  return read_surface(as_bytes(write_mesh(mesh, step_m)), "mesh");
}

}  // namespace carillon::packed::example
