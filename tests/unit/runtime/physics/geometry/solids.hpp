// Meshes and frames for the tests and the benchmark of shapes.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "runtime/physics/geometry/touch.hpp"

namespace carillon::geometry::tests {

struct Solid {
  std::vector<Vec3> vertices;
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::unique_ptr<Shape> make() const { return std::make_unique<Shape>(vertices, triangles); }
  void turn_inside_out() {
    for (auto& t : triangles) std::swap(t[1], t[2]);
  }
  void add(const Solid& other, const Vec3& at) {
    const auto first = static_cast<std::int32_t>(vertices.size());
    for (const Vec3& x : other.vertices) vertices.push_back(x + at);
    for (const auto& t : other.triangles) triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
};

/// A box about the origin, cut into n[k] cells along axis k, two triangles a square.
inline Solid make_box(const Vec3& sides, const std::array<int, 3>& n) {
  Solid s;
  std::map<std::array<int, 3>, std::int32_t> made;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [found, fresh] = made.try_emplace(at, static_cast<std::int32_t>(s.vertices.size()));
    if (fresh) {
      Vec3 x{};
      for (int k = 0; k < 3; ++k) x[k] = sides[k] * (static_cast<double>(at[k]) / n[k] - 0.5);
      s.vertices.push_back(x);
    }
    return found->second;
  };
  for (int k = 0; k < 3; ++k) {
    const int u = (k + 1) % 3, v = (k + 2) % 3;
    for (const int end : {0, n[k]}) {
      for (int i = 0; i < n[u]; ++i) {
        for (int j = 0; j < n[v]; ++j) {
          const auto at = [&](int p, int q) {
            std::array<int, 3> c{};
            c[k] = end, c[u] = p, c[v] = q;
            return vertex(c);
          };
          const auto a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
          if (end > 0)
            s.triangles.insert(s.triangles.end(), {{a, b, c}, {a, c, d}});
          else
            s.triangles.insert(s.triangles.end(), {{a, c, b}, {a, d, c}});
        }
      }
    }
  }
  return s;
}

inline Solid make_box(const Vec3& sides, int n = 1) { return make_box(sides, std::array{n, n, n}); }

/// A ball from an icosahedron with n parts an edge: 20 n^2 triangles.
inline Solid make_ball(double radius, int n) {
  const double g = 0.5 * (1.0 + std::sqrt(5.0));
  const std::vector<Vec3> p = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                               {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  const std::vector<std::array<int, 3>> faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                                                 {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                                                 {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  Solid s;
  std::map<std::array<long, 3>, std::int32_t> made;
  for (const auto& f : faces) {
    const auto at = [&](int i, int j) {
      const double u = static_cast<double>(i) / n, v = static_cast<double>(j) / n;
      const Vec3 x = radius * normalise((1.0 - u - v) * p[f[0]] + u * p[f[1]] + v * p[f[2]]);
      const std::array<long, 3> key{std::lround(x[0] / radius * 1e7), std::lround(x[1] / radius * 1e7), std::lround(x[2] / radius * 1e7)};
      const auto [found, fresh] = made.try_emplace(key, static_cast<std::int32_t>(s.vertices.size()));
      if (fresh) s.vertices.push_back(x);
      return found->second;
    };
    for (int i = 0; i < n; ++i) {
      for (int j = 0; i + j < n; ++j) {
        s.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        if (i + j + 1 < n) s.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  }
  return s;
}

/// A solid of revolution about z: the outline (radius, height) goes counterclockwise as seen with the radius to the right, from below to
/// above on its outer side. Ends on the axis (radius 0) are points; `closed` joins the last point to the first.
inline Solid make_lathe(const std::vector<std::array<double, 2>>& outline, int around, bool closed) {
  Solid s;
  std::vector<std::int32_t> first;
  for (const auto& [r, z] : outline) {
    first.push_back(static_cast<std::int32_t>(s.vertices.size()));
    for (int i = 0; i < (r > 0.0 ? around : 1); ++i) {
      const double angle = 2.0 * std::numbers::pi * i / around;
      s.vertices.push_back({r * std::cos(angle), r * std::sin(angle), z});
    }
  }
  const std::size_t rings = outline.size();
  for (std::size_t k = 0; k + (closed ? 0 : 1) < rings; ++k) {
    const std::size_t l = (k + 1) % rings;
    const bool point_k = !(outline[k][0] > 0.0), point_l = !(outline[l][0] > 0.0);
    for (int i = 0; i < around; ++i) {
      const int j = (i + 1) % around;
      const std::int32_t a = first[k] + (point_k ? 0 : i), b = first[k] + (point_k ? 0 : j);
      const std::int32_t c = first[l] + (point_l ? 0 : j), d = first[l] + (point_l ? 0 : i);
      if (!point_k) s.triangles.push_back({a, b, c});
      if (!point_l) s.triangles.push_back({a, c, d});
    }
  }
  return s;
}

inline Solid make_cylinder(double radius, double height, int around) {
  return make_lathe({{0, -height / 2}, {radius, -height / 2}, {radius, height / 2}, {0, height / 2}}, around, false);
}

/// A ring (torus) about z.
inline Solid make_ring(double radius, double wire, int around, int about) {
  std::vector<std::array<double, 2>> outline;
  for (int i = 0; i < about; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / about;
    outline.push_back({radius + wire * std::cos(angle), wire * std::sin(angle)});
  }
  return make_lathe(outline, around, true);
}

/// A ball with lumps.
inline Solid make_lumpy(double radius, int n, double lump = 0.08) {
  Solid s = make_ball(radius, n);
  for (Vec3& x : s.vertices) {
    const Vec3 u = (1.0 / radius) * x;
    x = (1.0 + lump * std::sin(5.0 * u[0] + 1.0) * std::sin(6.0 * u[1]) * std::cos(4.0 * u[2] + 0.5)) * x;
  }
  return s;
}

inline Mat3 multiply(const Mat3& a, const Mat3& b) {
  Mat3 c{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) c[i][j] += a[i][k] * b[k][j];
  return c;
}

/// A turn about an axis.
inline Mat3 make_turn(const Vec3& about, double angle) {
  const Vec3 u = normalise(about);
  const double c = std::cos(angle), s = std::sin(angle);
  const Mat3 skew = {Vec3{0, -u[2], u[1]}, Vec3{u[2], 0, -u[0]}, Vec3{-u[1], u[0], 0}};
  Mat3 m{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m[i][j] = (i == j ? c : 0.0) + (1.0 - c) * u[i] * u[j] + s * skew[i][j];
  return m;
}

/// Numbers between 0 and 1, the same everywhere.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed) {}
  double roll() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 11) / 9007199254740992.0;
  }
  double roll(double low, double high) { return low + (high - low) * roll(); }
  Vec3 roll_way() {
    for (;;) {
      const Vec3 x{roll(-1, 1), roll(-1, 1), roll(-1, 1)};
      if (norm2(x) < 1.0 && norm2(x) > 0.01) return normalise(x);
    }
  }
  Mat3 roll_turn() { return make_turn(roll_way(), roll(0, 6.28)); }

 private:
  std::uint64_t state_;
};

/// The touches of two bodies, without a memory of earlier searches.
inline std::vector<Touch> find(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double margin) {
  PairMemory memory;
  std::vector<Touch> out;
  find_touches(a, fa, b, fb, margin, memory, out);
  return out;
}

}  // namespace carillon::geometry::tests
