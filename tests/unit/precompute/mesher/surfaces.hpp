// Surfaces of known volume, and files of them.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher::testing {

struct Polygons {
  std::vector<std::array<double, 3>> points;
  std::vector<std::vector<int>> faces;
};

/// A box from the origin, twelve triangles facing outward.
inline Polygons make_box(double x, double y, double z) {
  Polygons box;
  for (int n = 0; n < 8; ++n) box.points.push_back({n & 1 ? x : 0, n & 2 ? y : 0, n & 4 ? z : 0});
  box.faces = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
               {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return box;
}

/// An octahedron divided `levels` times, its points on the sphere.
inline Polygons make_sphere(double radius, int levels) {
  Polygons s;
  s.points = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  s.faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::array<int, 2>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto [found, fresh] = middles.try_emplace(a < b ? std::array{a, b} : std::array{b, a}, static_cast<int>(s.points.size()));
      if (fresh) {
        std::array<double, 3> p;
        for (int c = 0; c < 3; ++c) p[c] = s.points[a][c] + s.points[b][c];
        const double length = std::hypot(p[0], p[1], p[2]);
        for (double& x : p) x /= length;
        s.points.push_back(p);
      }
      return found->second;
    };
    std::vector<std::vector<int>> faces;
    for (const auto& f : s.faces) {
      const int ab = middle(f[0], f[1]), bc = middle(f[1], f[2]), ca = middle(f[2], f[0]);
      faces.insert(faces.end(), {{f[0], ab, ca}, {ab, f[1], bc}, {ca, bc, f[2]}, {ab, bc, ca}});
    }
    s.faces = faces;
  }
  for (auto& p : s.points)
    for (double& x : p) x *= radius;
  return s;
}

/// Scan noise: displaces every point by `roughness` times the mean edge (RMS per axis).
inline Polygons roughen(Polygons s, double roughness, unsigned seed = 1) {
  double length = 0;
  std::size_t edges = 0;
  for (const auto& f : s.faces)
    for (std::size_t c = 0; c < f.size(); ++c, ++edges) {
      const auto &a = s.points[f[c]], &b = s.points[f[(c + 1) % f.size()]];
      length += std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    }
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, roughness * length / static_cast<double>(edges));
  for (auto& p : s.points)
    for (double& x : p) x += noise(random);
  return s;
}

inline TriangleSurface to_triangles(const Polygons& s) {
  TriangleSurface out;
  for (const auto& p : s.points) out.points.push_back({p[0], p[1], p[2]});
  for (const auto& f : s.faces)
    for (std::size_t c = 1; c + 1 < f.size(); ++c) out.triangles.push_back({f[0], f[c], f[c + 1]});
  return out;
}

/// A torus around z, its ring of radius `large` in n steps, its tube of radius `small` in m.
inline Polygons make_torus(double large, double small, int n, int m) {
  Polygons s;
  const double turn = 2 * std::acos(-1.0);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < m; ++j) {
      const double r = large + small * std::cos(turn * j / m);
      s.points.push_back({r * std::cos(turn * i / n), r * std::sin(turn * i / n), small * std::sin(turn * j / m)});
    }
  const auto at = [&](int i, int j) { return (i % n) * m + j % m; };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < m; ++j)
      s.faces.insert(s.faces.end(), {{at(i, j), at(i + 1, j), at(i + 1, j + 1)}, {at(i, j), at(i + 1, j + 1), at(i, j + 1)}});
  return s;
}

/// The letter N, 1 x 0.7 x 0.2, strokes of 0.2: corners of 27 degrees where the diagonal meets the posts.
inline Polygons make_letter_n() {
  const std::vector<std::array<double, 2>> outline = {{0, 0},   {0.2, 0}, {0.2, 0.55}, {0.5, 0}, {0.7, 0},
                                                      {0.7, 1}, {0.5, 1}, {0.5, 0.45}, {0.2, 1}, {0, 1}};
  const std::vector<std::array<int, 3>> front = {{0, 1, 2}, {0, 2, 9}, {2, 8, 9}, {2, 7, 8}, {2, 3, 7}, {3, 4, 7}, {4, 5, 7}, {5, 6, 7}};
  Polygons n;
  for (const double z : {0.0, 0.2})
    for (const auto& p : outline) n.points.push_back({p[0], p[1], z});
  for (const auto& t : front) n.faces.insert(n.faces.end(), {{t[2], t[1], t[0]}, {10 + t[0], 10 + t[1], 10 + t[2]}});
  for (int i = 0; i < 10; ++i) n.faces.insert(n.faces.end(), {{i, (i + 1) % 10, 10 + (i + 1) % 10}, {i, 10 + (i + 1) % 10, 10 + i}});
  return n;
}

/// A prism along z over a polygon around the origin: sides of two triangles, ends as fans.
inline Polygons make_prism(const std::vector<std::array<double, 2>>& outline, double length) {
  Polygons s;
  const int n = static_cast<int>(outline.size());
  for (const double z : {-length / 2, length / 2})
    for (const auto& [x, y] : outline) s.points.push_back({x, y, z});
  s.points.push_back({0, 0, -length / 2});
  s.points.push_back({0, 0, length / 2});
  for (int i = 0; i < n; ++i) {
    const int j = (i + 1) % n;
    s.faces.insert(s.faces.end(), {{i, j, n + j}, {i, n + j, n + i}, {2 * n, j, i}, {2 * n + 1, n + i, n + j}});
  }
  return s;
}

inline Polygons make_cylinder(double radius, double length, int n) {
  std::vector<std::array<double, 2>> outline;
  for (int i = 0; i < n; ++i)
    outline.push_back({radius * std::cos(2 * std::acos(-1.0) * i / n), radius * std::sin(2 * std::acos(-1.0) * i / n)});
  return make_prism(outline, length);
}

/// A bar of the half widths a and b along z whose four long edges are fillets in `steps` steps.
inline Polygons make_filleted_bar(double a, double b, double fillet, double length, int steps) {
  std::vector<std::array<double, 2>> outline;
  for (int corner = 0; corner < 4; ++corner)
    for (int k = 0; k <= steps; ++k) {
      const double angle = std::acos(-1.0) / 2 * (corner + 1.0 * k / steps);
      const double x = (corner == 0 || corner == 3 ? 1 : -1) * (a - fillet), y = (corner < 2 ? 1 : -1) * (b - fillet);
      outline.push_back({x + fillet * std::cos(angle), y + fillet * std::sin(angle)});
    }
  return make_prism(outline, length);
}

/// Triangulation of the panels of a body of revolution.
enum class Cut { kQuads, kDiagonal, kOtherDiagonal, kAlternating, kTurned };  // kTurned: every second ring by half a panel, triangles

/// The body of revolution around z of a profile (r, z) that runs upwards, in n panels; r = 0 is a pole. `is_closed`: the profile is a loop
/// (anticlockwise in the r-z plane), otherwise flat ends close it, each one polygon, or a fan of triangles when the panels are triangles.
inline Polygons make_lathe(const std::vector<std::array<double, 2>>& profile, int n, Cut cut, bool is_closed = false) {
  Polygons s;
  const int m = static_cast<int>(profile.size());
  std::vector<std::vector<int>> at(m);
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < n; ++j) {
      const auto [r, z] = profile[i];
      if (r > 0 || j == 0) {
        const double angle = 0.1 + 2 * std::acos(-1.0) * (j + (cut == Cut::kTurned ? 0.5 * (i % 2) : 0.0)) / n;
        s.points.push_back({r * std::cos(angle), r * std::sin(angle), z});
      }
      at[i].push_back(static_cast<int>(s.points.size()) - 1);
    }
  const auto add = [&](std::vector<int> face) {  // corners at a pole fall together
    face.erase(std::unique(face.begin(), face.end()), face.end());
    if (face.front() == face.back()) face.pop_back();
    if (face.size() > 2) s.faces.push_back(face);
  };
  for (int i = 0; i + (is_closed ? 0 : 1) < m; ++i)
    for (int j = 0; j < n; ++j) {
      const int k = (i + 1) % m, l = (j + 1) % n, a = at[i][j], b = at[i][l], c = at[k][l], d = at[k][j];
      const bool first = cut == Cut::kDiagonal || (cut == Cut::kAlternating && (i + j) % 2 == 0) || (cut == Cut::kTurned && i % 2 == 1);
      if (cut == Cut::kQuads || a == b || c == d) {
        add({a, b, c, d});
      } else if (first) {
        add({a, b, c});
        add({a, c, d});
      } else {
        add({a, b, d});
        add({b, c, d});
      }
    }
  for (const int end : {0, m - 1}) {
    if (is_closed || !(profile[end][0] > 0)) continue;
    std::vector<int> ring = at[end];
    if (end == 0) std::reverse(ring.begin(), ring.end());
    if (cut == Cut::kQuads) {
      s.faces.push_back(ring);
      continue;
    }
    s.points.push_back({0, 0, profile[end][1]});
    for (int j = 0; j < n; ++j) s.faces.push_back({ring[j], ring[(j + 1) % n], static_cast<int>(s.points.size()) - 1});
  }
  return s;
}

/// `steps` pieces of a line or an arc: f maps 0 ... 1 to (r, z).
template <class F>
std::vector<std::array<double, 2>> make_profile(int steps, const F& f) {
  std::vector<std::array<double, 2>> out;
  for (int i = 0; i <= steps; ++i) out.push_back(f(static_cast<double>(i) / steps));
  return out;
}

/// The elements of each face (corners ascending), each with the number of its corner that is opposite.
inline std::map<std::array<std::int32_t, 3>, std::vector<std::pair<std::int64_t, int>>> find_face_owners(const mesh::TetMesh& m) {
  std::map<std::array<std::int32_t, 3>, std::vector<std::pair<std::int64_t, int>>> owners;
  for (std::int64_t e = 0; e < m.tet_count(); ++e)
    for (int opposite = 0; opposite < 4; ++opposite) {
      std::array<std::int32_t, 3> face{};
      for (int c = 0, n = 0; c < 4; ++c)
        if (c != opposite) face[n++] = m.tet(e)[c];
      std::sort(face.begin(), face.end());
      owners[face].emplace_back(e, opposite);
    }
  return owners;
}

/// In a folder of this process, which is removed at its end.
inline std::filesystem::path get_path(const std::string& name) {
  struct Folder {
    pid_t owner = ::getpid();
    std::filesystem::path path =
        std::filesystem::temp_directory_path() / ("carillon_mesher_test_" + std::to_string(static_cast<long>(owner)));
    Folder() { std::filesystem::create_directories(path); }
    ~Folder() {
      std::error_code error;
      if (::getpid() == owner) std::filesystem::remove_all(path, error);
    }
  };
  static const Folder folder;
  return folder.path / name;
}

inline std::filesystem::path write_text(const std::string& name, const std::string& text) {
  const auto path = get_path(name);
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

inline std::string to_text(double x) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.17g", x);
  return buffer;
}

inline std::string to_off(const Polygons& s) {
  std::string out = "OFF\n" + std::to_string(s.points.size()) + " " + std::to_string(s.faces.size()) + " 0\n";
  for (const auto& p : s.points) out += to_text(p[0]) + " " + to_text(p[1]) + " " + to_text(p[2]) + "\n";
  for (const auto& f : s.faces) {
    out += std::to_string(f.size());
    for (const int v : f) out += " " + std::to_string(v);
    out += "\n";
  }
  return out;
}

inline std::string to_obj(const Polygons& s) {
  std::string out = "# a body\no body\n";
  for (const auto& p : s.points) out += "v " + to_text(p[0]) + " " + to_text(p[1]) + " " + to_text(p[2]) + "\n";
  for (const auto& f : s.faces) {
    out += "f";
    for (const int v : f) out += " " + std::to_string(v + 1);
    out += "\n";
  }
  return out;
}

inline std::string to_ply(const Polygons& s) {
  std::string out = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(s.points.size()) +
                    "\nproperty double x\nproperty double y\nproperty double z\nelement face " + std::to_string(s.faces.size()) +
                    "\nproperty list uchar int vertex_indices\nend_header\n";
  const std::string off = to_off(s);
  return out + off.substr(off.find('\n', 4) + 1);
}

inline std::string to_stl(const Polygons& s) {
  std::string out = "solid body\n";
  for (const auto& f : s.faces) {
    out += "facet normal 0 0 0\nouter loop\n";
    for (const int v : f) out += "vertex " + to_text(s.points[v][0]) + " " + to_text(s.points[v][1]) + " " + to_text(s.points[v][2]) + "\n";
    out += "endloop\nendfacet\n";
  }
  return out + "endsolid body\n";
}

template <class T>
void append(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

inline std::string to_binary_stl(const Polygons& s) {
  std::string out(80, ' ');
  append(out, static_cast<std::uint32_t>(s.faces.size()));
  for (const auto& f : s.faces) {
    for (int n = 0; n < 3; ++n) append(out, 0.0f);
    for (const int v : f)
      for (const double x : s.points[v]) append(out, static_cast<float>(x));
    append(out, std::uint16_t{0});
  }
  return out;
}

inline std::string to_binary_ply(const Polygons& s) {
  std::string out = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(s.points.size()) +
                    "\nproperty float x\nproperty float y\nproperty float z\nelement face " + std::to_string(s.faces.size()) +
                    "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const auto& p : s.points)
    for (const double x : p) append(out, static_cast<float>(x));
  for (const auto& f : s.faces) {
    append(out, static_cast<std::uint8_t>(f.size()));
    for (const int v : f) append(out, static_cast<std::int32_t>(v));
  }
  return out;
}

}  // namespace carillon::mesher::testing
