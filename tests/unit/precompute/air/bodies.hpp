// Closed surface meshes of bodies, oriented outward.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "precompute/air/surface.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::air::testing {

struct Skin {
  std::vector<Vec3> nodes_m;
  std::vector<Triangle> triangles;

  RadiatingSurface make_surface() const { return RadiatingSurface(nodes_m, triangles); }
};

inline double calc_volume(const Skin& skin) {
  double volume = 0.0;
  for (const Triangle& t : skin.triangles) volume += dot(skin.nodes_m[t[0]], cross(skin.nodes_m[t[1]], skin.nodes_m[t[2]])) / 6.0;
  return volume;
}

/// Reverses the triangles if they face inward.
inline Skin face_outward(Skin skin) {
  if (calc_volume(skin) < 0.0)
    for (Triangle& t : skin.triangles) std::swap(t[1], t[2]);
  return skin;
}

/// Merges nodes at the same position, to 1e-9.
class Joiner {
 public:
  std::int32_t add(const Vec3& place) {
    const std::array<std::int64_t, 3> key{std::llround(place[0] * 1e9), std::llround(place[1] * 1e9), std::llround(place[2] * 1e9)};
    const auto [found, is_new] = numbers_.try_emplace(key, static_cast<std::int32_t>(nodes_m.size()));
    if (is_new) nodes_m.push_back(place);
    return found->second;
  }
  std::vector<Vec3> nodes_m;

 private:
  std::map<std::array<std::int64_t, 3>, std::int32_t> numbers_;
};

/// An icosahedron of 10 n^2 + 2 nodes on a sphere, scaled to the volume of the ball of this radius.
inline Skin make_ball(int n, double radius_m) {
  const double g = std::numbers::phi;
  const std::array<Vec3, 12> corners{Vec3{-1, g, 0},  Vec3{1, g, 0},  Vec3{-1, -g, 0}, Vec3{1, -g, 0}, Vec3{0, -1, g},  Vec3{0, 1, g},
                                     Vec3{0, -1, -g}, Vec3{0, 1, -g}, Vec3{g, 0, -1},  Vec3{g, 0, 1},  Vec3{-g, 0, -1}, Vec3{-g, 0, 1}};
  const std::array<Triangle, 20> faces{{{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                                        {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                                        {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};
  Joiner joiner;
  Skin skin;
  for (const Triangle& face : faces) {
    const auto at = [&](int a, int b) {
      return joiner.add(normalise((n - a - b) * corners[face[0]] + static_cast<double>(a) * corners[face[1]] +
                                  static_cast<double>(b) * corners[face[2]]));
    };
    for (int i = 0; i < n; ++i)
      for (int j = 0; i + j < n; ++j) {
        skin.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        if (i + j + 1 < n) skin.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  }
  skin.nodes_m = joiner.nodes_m;
  const double factor = radius_m * std::cbrt(4.0 * std::numbers::pi / 3.0 / calc_volume(skin));
  for (Vec3& node : skin.nodes_m) node = factor * node;
  return skin;
}

/// A box around the origin with equal cells of two triangles.
inline Skin make_box(const Vec3& size_m, const std::array<int, 3>& cells) {
  Joiner joiner;
  Skin skin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const double side : {-0.5, 0.5}) {
      const auto at = [&](int i, int j) {
        Vec3 place{};
        place[axis] = side * size_m[axis];
        place[u] = (static_cast<double>(i) / cells[u] - 0.5) * size_m[u];
        place[v] = (static_cast<double>(j) / cells[v] - 0.5) * size_m[v];
        return joiner.add(place);
      };
      for (int i = 0; i < cells[u]; ++i)
        for (int j = 0; j < cells[v]; ++j) {
          Triangle one{at(i, j), at(i + 1, j), at(i + 1, j + 1)}, two{at(i, j), at(i + 1, j + 1), at(i, j + 1)};
          if ((i + j) % 2 == 1) {
            one = {at(i, j), at(i + 1, j), at(i, j + 1)};
            two = {at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
          }
          for (Triangle& t : std::array{one, two}) {
            if (side < 0.0) std::swap(t[1], t[2]);
            skin.triangles.push_back(t);
          }
        }
    }
  }
  skin.nodes_m = joiner.nodes_m;
  return skin;
}

/// A point of a meridian: distance from the axis, height.
using Place = std::array<double, 2>;

/// Inserts points into a meridian at a spacing of about `spacing_m`.
inline std::vector<Place> divide(const std::vector<Place>& corners, double spacing_m) {
  std::vector<Place> divided{corners[0]};
  for (std::size_t i = 1; i < corners.size(); ++i) {
    const Place &a = corners[i - 1], &b = corners[i];
    const int parts = std::max(1, static_cast<int>(std::lround(std::hypot(b[0] - a[0], b[1] - a[1]) / spacing_m)));
    for (int k = 1; k <= parts; ++k) {
      const double t = static_cast<double>(k) / parts;
      divided.push_back({(1.0 - t) * a[0] + t * b[0], (1.0 - t) * a[1] + t * b[1]});
    }
  }
  return divided;
}

/// Surface of revolution of a meridian around the z axis, where it begins and ends; ring nodes are about `spacing_m` apart.
inline Skin revolve(const std::vector<Place>& meridian, double spacing_m) {
  Skin skin;
  std::vector<std::vector<std::int32_t>> rings;
  for (std::size_t i = 0; i < meridian.size(); ++i) {
    const auto [r, z] = meridian[i];
    const bool is_pole = i == 0 || i + 1 == meridian.size();
    const int count = is_pole ? 1 : std::max(6, static_cast<int>(std::lround(2.0 * std::numbers::pi * r / spacing_m)));
    rings.emplace_back();
    for (int k = 0; k < count; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / count;
      rings.back().push_back(static_cast<std::int32_t>(skin.nodes_m.size()));
      skin.nodes_m.push_back(is_pole ? Vec3{0, 0, z} : Vec3{r * std::cos(angle), r * std::sin(angle), z});
    }
  }
  for (std::size_t n = 1; n < rings.size(); ++n) {
    const auto &a = rings[n - 1], &b = rings[n];
    const std::size_t to_a = a.size() > 1 ? a.size() : 0, to_b = b.size() > 1 ? b.size() : 0;
    std::size_t i = 0, j = 0;
    while (i < to_a || j < to_b) {
      const bool is_a = j == to_b || (i < to_a && (2 * i + 1) * b.size() <= (2 * j + 1) * a.size());
      if (is_a) {
        skin.triangles.push_back({a[i % a.size()], a[(i + 1) % a.size()], b[j % b.size()]});
        ++i;
      } else {
        skin.triangles.push_back({a[i % a.size()], b[(j + 1) % b.size()], b[j % b.size()]});
        ++j;
      }
    }
  }
  return face_outward(std::move(skin));
}

/// An open bowl of outer radius 1: half a spherical shell with a flat rim.
inline Skin make_bowl(double wall_m, double spacing_m) {
  std::vector<Place> meridian;
  const auto add_arc = [&](double radius, bool is_upward) {
    const int parts = static_cast<int>(std::lround(0.5 * std::numbers::pi * radius / spacing_m));
    for (int k = 0; k <= parts; ++k) {
      const double angle = 0.5 * std::numbers::pi * (is_upward ? k : parts - k) / parts;
      meridian.push_back({k == (is_upward ? 0 : parts) ? 0.0 : radius * std::sin(angle), -radius * std::cos(angle)});
    }
  };
  add_arc(1.0, true);
  const int across = static_cast<int>(std::lround(wall_m / spacing_m));
  for (int k = 1; k < across; ++k) meridian.push_back({1.0 - wall_m * k / across, 0.0});
  add_arc(1.0 - wall_m, false);
  return revolve(meridian, spacing_m);
}

/// A bell of height 1 and mouth radius 0.55 whose wall thickens towards the lip.
inline std::vector<Place> get_bell_outside() {
  return {{0.0, 1.0}, {0.17, 0.99}, {0.27, 0.93}, {0.31, 0.8}, {0.34, 0.6}, {0.38, 0.4}, {0.44, 0.2}, {0.55, 0.0}};
}
inline std::vector<Place> get_bell_inside() {
  return {{0.47, 0.0}, {0.38, 0.19}, {0.33, 0.38}, {0.29, 0.58}, {0.26, 0.78}, {0.23, 0.88}, {0.15, 0.93}, {0.0, 0.94}};
}
inline Skin make_bell(double spacing_m) {
  std::vector<Place> meridian = get_bell_outside();
  const std::vector<Place> inside = get_bell_inside();
  meridian.insert(meridian.end(), inside.begin(), inside.end());
  return revolve(divide(meridian, spacing_m), spacing_m);
}

/// Merges two disjoint surfaces.
inline Skin join(Skin a, const Skin& b, const Vec3& shift_m) {
  const auto offset = static_cast<std::int32_t>(a.nodes_m.size());
  for (const Vec3& node : b.nodes_m) a.nodes_m.push_back(node + shift_m);
  for (const Triangle& t : b.triangles) a.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  return a;
}

/// True if each edge has two triangles that traverse it in opposite directions.
inline bool is_closed(const Skin& skin) {
  std::map<std::pair<std::int32_t, std::int32_t>, int> passes;
  for (const Triangle& t : skin.triangles)
    for (std::size_t c = 0; c < 3; ++c) ++passes[{t[c], t[(c + 1) % 3]}];
  return std::all_of(passes.begin(), passes.end(), [&](const auto& pass) {
    const auto back = passes.find({pass.first.second, pass.first.first});
    return pass.second == 1 && back != passes.end();
  });
}

}  // namespace carillon::air::testing
