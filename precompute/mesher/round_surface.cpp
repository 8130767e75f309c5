// Method: a cubic patch over each triangle from its corners and the normals there. Normals are estimated from the facets of one side of the
//   sharp edges, with weights that are exact on a sphere; sharp edges get cubics along the tangent of the circle through their points.
//   Faces that are flat by design keep their normal at all their corners: polygons of more than four corners or with sharp edges all
//   around, faces much wider than their neighbours (a plane beside a fillet), and the two sides of a single bend; two such meet in a line.
// Source: Vlachos, Peters, Boyd and Mitchell, "Curved PN triangles", I3D 2001, section 3 (the patch); Max, "Weights for computing vertex
//   normals from facet normals", J. Graphics Tools 4(2), 1999 (the normals).
// Deviations: they take normals from the modeller and leave creases open; the creases' own curves close them.
#include "precompute/mesher/round_surface.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <set>

namespace carillon::mesher {
namespace {

constexpr double kFlatDeg = 0.1;     // faces that turn by less are one plane
constexpr double kWider = 3;         // a face this many times wider than its neighbour is flat
constexpr double kMostBulge = 0.15;  // of an edge's length; more is no estimate of a smooth surface
constexpr double kFinePart = 0.95;   // of the edges must bulge by less than the tolerance
constexpr std::size_t kMostTriangles = 100'000;
constexpr int kMostPieces = 16;

using Ends = std::array<std::int32_t, 2>;

Vec3 calc_unit(const Vec3& a) {
  const double length = norm(a);
  return length > 0 ? (1 / length) * a : Vec3{};
}

struct Edge {
  std::array<std::int32_t, 2> faces{-1, -1};
  int count = 0;
  double turn_deg = 180;
  bool sharp = true;
  std::array<Vec3, 2> control{};  // of the cubic: near the lower and near the higher end
};

class Rounding {
 public:
  Rounding(const TriangleSurface& surface, double sharp_angle_deg) : surface_(surface), corner_(3 * surface.triangles.size()) {
    for (const Triangle& t : surface.triangles) normals_.push_back(calc_unit(cross(at(t[1]) - at(t[0]), at(t[2]) - at(t[0]))));
    find_edges(sharp_angle_deg);
    find_flat_faces();
    find_corner_normals();
    find_edge_curves(sharp_angle_deg);
  }

  /// How far the middles of the edges bulge, ascending.
  std::vector<double> calc_bulges() const {
    std::vector<double> bulges;
    for (const auto& [ends, edge] : edges_) bulges.push_back(norm(calc_on_edge(ends, edge, 0.5) - 0.5 * (at(ends[0]) + at(ends[1]))));
    std::sort(bulges.begin(), bulges.end());
    return bulges;
  }

  TriangleSurface cut(int pieces) const {
    TriangleSurface out;
    out.points = surface_.points;
    std::map<Ends, std::int32_t> first_of;  // the first inner point of each edge, from its lower end on
    for (const auto& [ends, edge] : edges_) {
      first_of[ends] = static_cast<std::int32_t>(out.points.size());
      for (int n = 1; n < pieces; ++n) out.points.push_back(calc_on_edge(ends, edge, static_cast<double>(n) / pieces));
    }
    std::vector<std::vector<std::int32_t>> row(static_cast<std::size_t>(pieces) + 1);
    for (const Triangle& t : surface_.triangles) {
      const auto on_edge = [&](int from, int to, int n) {  // the n-th point from corner `from` to corner `to`
        if (n == 0) return t[from];
        if (n == pieces) return t[to];
        const bool up = t[from] < t[to];
        return first_of.at(up ? Ends{t[from], t[to]} : Ends{t[to], t[from]}) + (up ? n : pieces - n) - 1;
      };
      const auto patch = make_patch(t);
      for (int j = 0; j <= pieces; ++j) {  // towards corner 2
        auto& points = row[static_cast<std::size_t>(j)];
        points.clear();
        for (int i = 0; i + j <= pieces; ++i) {  // towards corner 1
          const int k = pieces - i - j;
          if (j == 0) {
            points.push_back(on_edge(0, 1, i));
          } else if (i == 0) {
            points.push_back(on_edge(0, 2, j));
          } else if (k == 0) {
            points.push_back(on_edge(1, 2, j));
          } else {
            points.push_back(static_cast<std::int32_t>(out.points.size()));
            out.points.push_back(calc_on_patch(patch, {1.0 * k / pieces, 1.0 * i / pieces, 1.0 * j / pieces}));
          }
        }
      }
      for (int j = 0; j < pieces; ++j)
        for (int i = 0; i + j < pieces; ++i) {
          out.triangles.push_back({row[j][i], row[j][i + 1], row[j + 1][i]});
          if (i + j + 1 < pieces) out.triangles.push_back({row[j][i + 1], row[j + 1][i + 1], row[j + 1][i]});
        }
    }
    return out;
  }

 private:
  const Vec3& at(std::int32_t v) const { return surface_.points[static_cast<std::size_t>(v)]; }
  static Ends make_ends(std::int32_t a, std::int32_t b) { return a < b ? Ends{a, b} : Ends{b, a}; }

  void find_edges(double sharp_angle_deg) {
    for (std::size_t f = 0; f < surface_.triangles.size(); ++f)
      for (int c = 0; c < 3; ++c) {
        Edge& edge = edges_[make_ends(surface_.triangles[f][c], surface_.triangles[f][(c + 1) % 3])];
        if (edge.count < 2) edge.faces[edge.count] = static_cast<std::int32_t>(f);
        ++edge.count;
      }
    for (auto& [ends, edge] : edges_) {
      if (edge.count != 2) continue;
      const Vec3 &a = normals_[edge.faces[0]], &b = normals_[edge.faces[1]];
      edge.turn_deg = std::atan2(norm(cross(a, b)), dot(a, b)) * 180 / std::numbers::pi;
      edge.sharp = edge.turn_deg > sharp_angle_deg || !(norm(a) > 0 && norm(b) > 0);
    }
  }

  /// Joins coplanar triangles to faces and decides which of these are flat by design; edges between two such are sharp.
  void find_flat_faces() {
    face_.resize(surface_.triangles.size());
    std::iota(face_.begin(), face_.end(), 0);
    const auto find = [&](std::int32_t f) {
      while (face_[f] != f) f = face_[f] = face_[face_[f]];
      return f;
    };
    for (const auto& [ends, edge] : edges_)
      if (edge.count == 2 && edge.turn_deg < kFlatDeg) {
        const std::int32_t a = find(edge.faces[0]), b = find(edge.faces[1]);
        face_[std::max(a, b)] = std::min(a, b);
      }
    std::map<std::int32_t, std::set<std::int32_t>> corners;
    for (std::size_t f = 0; f < face_.size(); ++f) {
      face_[f] = find(static_cast<std::int32_t>(f));
      corners[face_[f]].insert(surface_.triangles[f].begin(), surface_.triangles[f].end());
    }
    std::map<std::int32_t, int> bends;  // edges of a face that are neither sharp nor flat
    for (const auto& [ends, edge] : edges_)
      if (!edge.sharp && edge.turn_deg >= kFlatDeg) ++bends[face_[edge.faces[0]]], ++bends[face_[edge.faces[1]]];
    flat_.assign(face_.size(), 0);
    for (const auto& [face, own] : corners) flat_[face] = own.size() > 4 || bends[face] == 0;
    for (const auto& [ends, edge] : edges_) {
      if (edge.sharp || edge.turn_deg < kFlatDeg) continue;
      const Vec3 along = calc_unit(at(ends[1]) - at(ends[0]));
      std::array<double, 2> width{};
      for (int side = 0; side < 2; ++side)
        for (const std::int32_t v : corners[face_[edge.faces[side]]])
          width[side] = std::max(width[side], norm(cross(along, at(v) - at(ends[0]))));
      for (int side = 0; side < 2; ++side)
        if (width[side] > kWider * width[1 - side] || (bends[face_[edge.faces[0]]] == 1 && bends[face_[edge.faces[1]]] == 1))
          flat_[face_[edge.faces[side]]] = 1;
    }
    for (auto& [ends, edge] : edges_)
      if (!edge.sharp && edge.turn_deg >= kFlatDeg && flat_[face_[edge.faces[0]]] && flat_[face_[edge.faces[1]]]) edge.sharp = true;
  }

  /// One normal for all corners at a point that hang together by edges which are not sharp.
  void find_corner_normals() {
    std::vector<std::int32_t> root(corner_.size());
    std::iota(root.begin(), root.end(), 0);
    const auto find = [&](std::int32_t c) {
      while (root[c] != c) c = root[c] = root[root[c]];
      return c;
    };
    const auto get_corner = [&](std::int32_t f, std::int32_t v) {
      const Triangle& t = surface_.triangles[f];
      return 3 * f + (t[0] == v ? 0 : t[1] == v ? 1 : 2);
    };
    for (const auto& [ends, edge] : edges_)
      for (const std::int32_t v : ends)
        if (!edge.sharp) {
          const std::int32_t a = find(get_corner(edge.faces[0], v)), b = find(get_corner(edge.faces[1], v));
          root[std::max(a, b)] = std::min(a, b);
        }
    std::vector<Vec3> round(corner_.size(), Vec3{}), flat(corner_.size(), Vec3{});
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(corner_.size()); ++c) {
      const Triangle& t = surface_.triangles[c / 3];
      const Vec3 a = at(t[(c + 1) % 3]) - at(t[c % 3]), b = at(t[(c + 2) % 3]) - at(t[c % 3]);
      const double squares = dot(a, a) * dot(b, b);
      if (!(squares > 0)) continue;
      Vec3& sum = flat_[face_[c / 3]] ? flat[find(c)] : round[find(c)];
      sum = sum + (1 / squares) * cross(a, b);
    }
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(corner_.size()); ++c) {
      const std::int32_t r = find(c);
      corner_[c] = calc_unit(norm(flat[r]) > 0 ? flat[r] : round[r]);
    }
  }

  /// True for the line in which two flat faces meet.
  bool is_straight(const Edge& edge) const {
    return edge.sharp && edge.count == 2 && flat_[face_[edge.faces[0]]] && flat_[face_[edge.faces[1]]];
  }

  void find_edge_curves(double sharp_angle_deg) {
    std::map<std::int32_t, std::vector<std::int32_t>> along;  // points joined to each point by sharp edges
    for (const auto& [ends, edge] : edges_)
      if (edge.sharp) along[ends[0]].push_back(ends[1]), along[ends[1]].push_back(ends[0]);
    // The tangent at point v of the sharp curve that goes on to `next`: that of the circle through three points. Zero where it ends or
    // bends.
    const auto calc_tangent = [&](std::int32_t v, std::int32_t next) {
      const auto& others = along.at(v);
      if (others.size() != 2) return Vec3{};
      const std::int32_t before = others[0] == next ? others[1] : others[0];
      const Vec3 in = at(v) - at(before), out = at(next) - at(v);
      if (dot(in, out) < std::cos(sharp_angle_deg * std::numbers::pi / 180) * norm(in) * norm(out)) return Vec3{};
      if (is_straight(edges_.at(make_ends(before, v)))) return calc_unit(in);
      return calc_unit((norm(out) / norm(in)) * in + (norm(in) / norm(out)) * out);
    };
    for (auto& [ends, edge] : edges_) {
      const Vec3 &a = at(ends[0]), &b = at(ends[1]), chord = b - a;
      std::array<Vec3, 2> step{chord, chord};  // three times the way to the control points
      if (is_straight(edge)) {
      } else if (edge.sharp) {
        std::array<Vec3, 2> tangent{calc_tangent(ends[0], ends[1]), -1.0 * calc_tangent(ends[1], ends[0])};
        for (int side = 0; side < 2; ++side)  // a curve that ends here bends as it does at its other point
          if (!(norm(tangent[side]) > 0) && norm(tangent[1 - side]) > 0)
            tangent[side] = (2 * dot(tangent[1 - side], chord) / dot(chord, chord)) * chord - tangent[1 - side];
        for (int side = 0; side < 2; ++side)
          if (norm(tangent[side]) > 0) step[side] = dot(tangent[side], chord) * tangent[side];
      } else {
        const Triangle& t = surface_.triangles[edge.faces[0]];
        for (int side = 0; side < 2; ++side) {
          const int c = t[0] == ends[side] ? 0 : t[1] == ends[side] ? 1 : 2;
          const Vec3& normal = corner_[3 * edge.faces[0] + c];
          step[side] = chord - dot(chord, normal) * normal;
        }
      }
      edge.control = {a + (1.0 / 3) * step[0], b - (1.0 / 3) * step[1]};
      if (norm(calc_on_edge(ends, edge, 0.5) - 0.5 * (a + b)) > kMostBulge * norm(chord))
        edge.control = {a + (1.0 / 3) * chord, b - (1.0 / 3) * chord};
    }
  }

  Vec3 calc_on_edge(const Ends& ends, const Edge& edge, double t) const {
    const double s = 1 - t;
    return s * s * s * at(ends[0]) + 3 * s * s * t * edge.control[0] + 3 * s * t * t * edge.control[1] + t * t * t * at(ends[1]);
  }

  /// Corners 0 1 2, then the control points near the first and the second end of the sides 01, 12, 20, then the middle.
  using Patch = std::array<Vec3, 10>;
  Patch make_patch(const Triangle& t) const {
    Patch p{at(t[0]), at(t[1]), at(t[2])};
    Vec3 sides{};
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = t[c], b = t[(c + 1) % 3];
      const Edge& edge = edges_.at(make_ends(a, b));
      p[3 + 2 * c] = edge.control[a < b ? 0 : 1];
      p[4 + 2 * c] = edge.control[a < b ? 1 : 0];
      sides = sides + p[3 + 2 * c] + p[4 + 2 * c];
    }
    const Vec3 mean = (1.0 / 6) * sides, middle = (1.0 / 3) * (p[0] + p[1] + p[2]);
    p[9] = mean + 0.5 * (mean - middle);
    return p;
  }

  static Vec3 calc_on_patch(const Patch& p, const std::array<double, 3>& l) {
    Vec3 out = 6 * l[0] * l[1] * l[2] * p[9];
    for (int c = 0; c < 3; ++c) {
      const double a = l[c], b = l[(c + 1) % 3];
      out = out + a * a * a * p[c] + 3 * a * a * b * p[3 + 2 * c] + 3 * a * b * b * p[4 + 2 * c];
    }
    return out;
  }

  const TriangleSurface& surface_;
  std::vector<Vec3> normals_;       // (T) of the triangles
  std::map<Ends, Edge> edges_;      // ordered: the new points come in a fixed order
  std::vector<std::int32_t> face_;  // (T) the first triangle of the plane it belongs to
  std::vector<char> flat_;          // (T) by that first triangle: flat by design
  std::vector<Vec3> corner_;        // (T, 3) normal of the smooth surface
};

}  // namespace

TriangleSurface round_surface(const TriangleSurface& surface, double sharp_angle_deg, double tolerance_m, int& pieces) {
  pieces = 1;
  if (surface.triangles.empty() || 4 * surface.triangles.size() > kMostTriangles) return surface;
  const Rounding rounding(surface, sharp_angle_deg);
  // Of the edges that bulge at all: a few bulging ones on a large box count too.
  std::vector<double> bulges = rounding.calc_bulges();
  std::erase_if(bulges, [&](double bulge) { return bulge < 0.01 * tolerance_m; });
  if (bulges.empty()) return surface;
  const double bulge = bulges[static_cast<std::size_t>(kFinePart * static_cast<double>(bulges.size() - 1))];
  pieces = std::clamp(static_cast<int>(std::ceil(std::sqrt(bulge / tolerance_m))), 1, kMostPieces);
  while (pieces > 1 && surface.triangles.size() * pieces * pieces > kMostTriangles) --pieces;
  return pieces > 1 ? rounding.cut(pieces) : surface;
}

}  // namespace carillon::mesher
