// Method: a cubic patch per triangle from its corners and normals. Normals are estimated from the facets on one side of the sharp edges,
//   with weights that are exact on a sphere; at the rim of a smooth part, where half of the facets is missing, the normal is tilted until
//   the curves to its inner neighbours are arcs. A plane next to a curved part keeps its normal up to the common edge. Edge cubics
//   approximate circles if the end normals are consistent with one (handles of a third of the projected chord would lose 3 % of the height
//   of an arc of 22.5 degrees); sharp edges follow the tangents of circles through their points, which closes creases. At a cone tip the
//   patch is ruled.
// Source: Vlachos, Peters, Boyd and Mitchell, "Curved PN triangles", I3D 2001, section 3 (patch); Max, "Weights for computing vertex
//   normals from facet normals", J. Graphics Tools 4(2), 1999 (normals); Goldapp, "Approximation of circular arcs by cubic polynomials",
//   CAGD 8, 1991 (length of the handles).
#include "precompute/mesher/round_surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "precompute/mesh/parts.hpp"
#include "precompute/mesher/bends.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesher {
namespace {

constexpr double kMaxBulge = 0.15;              // over the edge length; larger bulges are not a smooth surface
constexpr double kDefaultPart = 0.95;           // percentile of the bulging edges
constexpr double kMaxNormalAngleRad = 3e-3;     // radians
constexpr double kMaxRimTilt = 0.35;            // of the normal at a rim, radians
constexpr double kBarycentricTolerance = 1e-8;  // barycentric
constexpr int kMaxPieces = 16;

using Weights = std::array<double, 3>;  // barycentric

}  // namespace

struct RoundSurface::Place {
  std::int32_t facet = 0;
  Weights at{};
};

struct RoundSurface::Patches {
  Patches(const TriangleSurface& facets, Bends given, double sharp_angle_deg)
      : surface(facets), bends(std::move(given)), corner(3 * facets.triangles.size()), control(bends.edges.size()) {
    find_corner_normals();
    find_edge_curves(sharp_angle_deg);
  }

  const Vec3& at(std::int32_t v) const { return surface.points[v]; }

  std::int32_t get_corner(std::int32_t f, std::int32_t v) const {
    const Triangle& t = surface.triangles[f];
    return 3 * f + (t[0] == v ? 0 : t[1] == v ? 1 : 2);
  }

  /// One normal for all corners at a point connected by edges that are not sharp.
  void find_corner_normals() {
    mesh::Parts parts(corner.size());
    std::vector<char> rules(corner.size(), 0), yields(corner.size(), 0);  // face keeps its normal at this point, or yields
    for (const Bend& edge : bends.edges) {
      if (edge.sharp) continue;
      for (const std::int32_t v : edge.ends) {
        parts.join(get_corner(edge.faces[0], v), get_corner(edge.faces[1], v));
        if (edge.straight < 0) continue;
        for (const std::int32_t c : bends.corners_at[v]) {
          if (bends.pane[c / 3] == bends.pane[edge.faces[edge.straight]]) rules[c] = 1;
          if (bends.pane[c / 3] == bends.pane[edge.faces[1 - edge.straight]]) yields[c] = 1;
        }
      }
    }
    std::vector<Vec3> sum(corner.size(), Vec3{}), all(corner.size(), Vec3{});
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(corner.size()); ++c) {
      const Triangle& t = surface.triangles[c / 3];
      const Vec3 a = at(t[(c + 1) % 3]) - at(t[c % 3]), b = at(t[(c + 2) % 3]) - at(t[c % 3]);
      const double squares = dot(a, a) * dot(b, b);
      if (!(squares > 0)) continue;
      const Vec3 part = (1 / squares) * cross(a, b);
      const std::int32_t r = parts.find(c);
      all[r] = all[r] + part;
      if (rules[c] != 0 && yields[c] == 0) sum[r] = sum[r] + part;
    }
    std::vector<std::int32_t> root(corner.size());
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(corner.size()); ++c) {
      const std::int32_t r = root[c] = parts.find(c);
      corner[c] = calc_unit(norm(sum[r]) > 0 ? sum[r] : all[r]);
    }
    find_tips();
    tilt_rims(root);
  }

  /// At the end of a smooth part the facets on one side bias the normal: it is rotated about the rim until it and the inner neighbours'
  /// normals fit an arc over the common edge. A single strip without inner points is taken as straight across.
  void tilt_rims(const std::vector<std::int32_t>& root) {
    struct Rim {
      std::vector<Vec3> along;                        // from the point, on the sharp edges
      std::vector<std::pair<Vec3, Vec3>> in, across;  // to inner points, to other rims: direction, normal there
    };
    std::map<std::int32_t, Rim> rims;  // by root
    std::vector<char> on_rim(surface.points.size(), 0);
    for (const Bend& edge : bends.edges) {
      if (!edge.sharp) continue;
      for (int end = 0; end < 2; ++end) {
        on_rim[edge.ends[end]] = 1;
        for (int side = 0; side < std::min(edge.count, 2); ++side)
          rims[root[get_corner(edge.faces[side], edge.ends[end])]].along.push_back(calc_unit(at(edge.ends[1 - end]) - at(edge.ends[end])));
      }
    }
    for (const Bend& edge : bends.edges) {
      if (edge.sharp) continue;
      for (int end = 0; end < 2; ++end) {
        const std::int32_t v = edge.ends[end], other = edge.ends[1 - end];
        if (on_rim[v] == 0 || tip[other] != 0) continue;
        Rim& rim = rims[root[get_corner(edge.faces[0], v)]];
        (on_rim[other] != 0 ? rim.across : rim.in).emplace_back(at(other) - at(v), corner[get_corner(edge.faces[0], other)]);
      }
    }
    std::vector<Vec3> turned(corner.size(), Vec3{});
    for (const auto& [r, rim] : rims) {
      if (rim.along.size() != 2) continue;
      const Vec3 normal = corner[r], rim_way = rim.along[1] - rim.along[0];
      if (norm(rim_way) < 1.7) continue;  // a corner
      const Vec3 sideways = calc_unit(cross(rim_way, normal)), along = cross(normal, sideways);
      double gap = 0, squares = 0;
      for (const auto& [way, other] : rim.in.empty() ? rim.across : rim.in) {
        const Vec3 unit = calc_unit(way);
        const double reach = dot(unit, sideways);
        // Drop below the tangent plane, relative to an arc, or a part that bends along the rim only.
        const double arc =
            rim.in.empty() ? dot(unit, along) * std::tan(0.5 * std::atan2(dot(other, along), dot(other, normal))) : dot(other, unit);
        gap += (dot(normal, unit) + arc) * reach;
        squares += reach * reach;
      }
      if (!(squares > 1e-6)) continue;
      const double tilt = std::atan2(-gap, squares);
      if (std::abs(tilt) < kMaxRimTilt) turned[r] = std::cos(tilt) * normal + std::sin(tilt) * sideways;
    }
    for (std::size_t c = 0; c < corner.size(); ++c)
      if (norm(turned[root[c]]) > 0) corner[c] = turned[root[c]];
  }

  void find_tips() {
    tip.assign(surface.points.size(), 0);
    std::vector<char> on_rim(surface.points.size(), 0);
    for (const Bend& edge : bends.edges)
      if (edge.sharp) on_rim[edge.ends[0]] = on_rim[edge.ends[1]] = 1;
    for (std::size_t v = 0; v < tip.size(); ++v)
      if (on_rim[v] == 0 && bends.corners_at[v].size() > 2)
        tip[v] = is_tip(surface, bends, static_cast<std::int32_t>(v), corner[bends.corners_at[v][0]]) ? 1 : 0;
  }

  /// True for the intersection line of two flat faces.
  bool is_straight(const Bend& edge) const {
    for (int side = 0; side < 2; ++side)
      for (const std::int32_t v : edge.ends)
        if (norm(corner[get_corner(edge.faces[side], v)] - bends.normals[edge.faces[side]]) > kMaxNormalAngleRad) return false;
    return true;
  }

  void find_edge_curves(double sharp_angle_deg) {
    std::map<std::int32_t, std::vector<std::int32_t>> along;  // sharp edges at each point
    for (std::size_t e = 0; e < bends.edges.size(); ++e)
      if (bends.edges[e].sharp)
        for (const std::int32_t v : bends.edges[e].ends) along[v].push_back(static_cast<std::int32_t>(e));
    const auto is_line = [&](const Bend& edge) { return edge.count == 2 && is_straight(edge); };
    // Tangent at point v of the sharp curve that continues along `edge`: of the circle through three points. Zero at ends and corners.
    const auto calc_tangent = [&](std::int32_t v, std::int32_t e) {
      const auto& others = along.at(v);
      if (others.size() != 2) return Vec3{};
      const Bend &edge = bends.edges[e], &last = bends.edges[others[0] == e ? others[1] : others[0]];
      const Vec3 in = at(v) - at(last.ends[last.ends[0] == v ? 1 : 0]), out = at(edge.ends[edge.ends[0] == v ? 1 : 0]) - at(v);
      if (dot(in, out) < std::cos(sharp_angle_deg * std::numbers::pi / 180) * norm(in) * norm(out)) return Vec3{};
      if (is_line(last)) return calc_unit(in);
      return calc_unit((norm(out) / norm(in)) * in + (norm(in) / norm(out)) * out);
    };
    for (std::size_t e = 0; e < bends.edges.size(); ++e) {
      const Bend& edge = bends.edges[e];
      const Vec3 &a = at(edge.ends[0]), &b = at(edge.ends[1]), chord = b - a;
      std::array<Vec3, 2> step{chord, chord};  // three times the vector to the control points
      const auto mirror = [&](int side) {      // bends at this end as at the other
        step[side] = (2 * dot(step[1 - side], chord) / dot(chord, chord)) * chord - step[1 - side];
      };
      if (edge.sharp) {
        if (!is_line(edge)) {
          const auto number = static_cast<std::int32_t>(e);
          const std::array<Vec3, 2> tangent{calc_tangent(edge.ends[0], number), -1.0 * calc_tangent(edge.ends[1], number)};
          for (int side = 0; side < 2; ++side)  // length as for a circle
            if (norm(tangent[side]) > 0)
              step[side] = (2 * dot(chord, chord) / (norm(chord) + std::abs(dot(tangent[side], chord)))) * tangent[side];
          for (int side = 0; side < 2; ++side)
            if (!(norm(tangent[side]) > 0) && norm(tangent[1 - side]) > 0) mirror(side);
        }
      } else {
        std::array<Vec3, 2> normal;
        for (int side = 0; side < 2; ++side) normal[side] = corner[get_corner(edge.faces[0], edge.ends[side])];
        const bool tips[2] = {tip[edge.ends[0]] != 0, tip[edge.ends[1]] != 0};
        const Vec3 axis = calc_unit(cross(normal[0], normal[1]));
        const double half = 0.5 * std::atan2(norm(cross(normal[0], normal[1])), dot(normal[0], normal[1]));
        for (int side = 0; side < 2; ++side) {
          step[side] = chord - dot(chord, normal[side]) * normal[side];
          if (tips[0] || tips[1] || half > 0.8) continue;
          const Vec3 forth = cross(axis, normal[side]);
          const double longer = 1 / (std::cos(half) * std::pow(std::cos(half / 2), 2));
          step[side] = step[side] + ((longer - 1) * dot(step[side], forth)) * forth;
        }
        if (tips[0] && tips[1]) step = {chord, chord};
        if (tips[0] != tips[1]) mirror(tips[0] ? 0 : 1);
      }
      control[e] = {a + (1.0 / 3) * step[0], b - (1.0 / 3) * step[1]};
      if (norm(calc_on_edge(e, 0.5) - 0.5 * (a + b)) > kMaxBulge * norm(chord)) control[e] = {a + (1.0 / 3) * chord, b - (1.0 / 3) * chord};
    }
  }

  /// t: from the lower end of the edge.
  Vec3 calc_on_edge(std::size_t e, double t) const {
    const double s = 1 - t;
    const Bend& edge = bends.edges[e];
    return s * s * s * at(edge.ends[0]) + 3 * s * s * t * control[e][0] + 3 * s * t * t * control[e][1] + t * t * t * at(edge.ends[1]);
  }

  Vec3 calc(const Place& place) const {
    const Triangle& t = surface.triangles[place.facet];
    const Weights& l = place.at;
    const auto& sides = bends.edges_of[place.facet];
    const auto calc_on_side = [&](int c, double towards_next) {
      return calc_on_edge(sides[c], t[c] < t[(c + 1) % 3] ? towards_next : 1 - towards_next);
    };
    for (int c = 0; c < 3; ++c) {
      if (tip[t[c]] == 0 || !is_ruled(sides[c]) || !is_ruled(sides[(c + 2) % 3])) continue;
      const double rest = l[(c + 1) % 3] + l[(c + 2) % 3];
      return rest > 0 ? l[c] * at(t[c]) + rest * calc_on_side((c + 1) % 3, l[(c + 2) % 3] / rest) : at(t[c]);
    }
    Vec3 edges{}, out{}, middle{};
    for (int c = 0; c < 3; ++c) {
      const auto& ends = control[sides[c]];
      const bool up = t[c] < t[(c + 1) % 3];
      const double a = l[c], b = l[(c + 1) % 3];
      edges = edges + ends[0] + ends[1];
      middle = middle + (1.0 / 3) * at(t[c]);
      out = out + a * a * a * at(t[c]) + 3 * a * a * b * ends[up ? 0 : 1] + 3 * a * b * b * ends[up ? 1 : 0];
    }
    const Vec3 mean = (1.0 / 6) * edges;
    return out + 6 * l[0] * l[1] * l[2] * (mean + 0.5 * (mean - middle));
  }

  bool is_ruled(std::int32_t e) const {
    const Bend& edge = bends.edges[e];
    const Vec3 chord = at(edge.ends[1]) - at(edge.ends[0]);
    return norm(calc_on_edge(e, 0.5) - 0.5 * (at(edge.ends[0]) + at(edge.ends[1]))) < 1e-3 * norm(chord);
  }

  const TriangleSurface& surface;
  Bends bends;
  std::vector<Vec3> corner;                  // (T, 3) normal of the smooth surface
  std::vector<std::array<Vec3, 2>> control;  // edge cubics: near the lower and the higher end
  std::vector<char> tip;                     // (P) of a cone
};

RoundSurface::RoundSurface(TriangleSurface facets, double sharp_angle_deg) : facets_(std::make_unique<TriangleSurface>(std::move(facets))) {
  Bends bends = find_bends(*facets_, sharp_angle_deg);
  if (bends.doubtful) {
    Bends other = bends;
    for (Bend& edge : other.edges)
      if (edge.doubtful) edge.sharp = !edge.sharp, edge.straight = -1;
    other_ = std::make_unique<Patches>(*facets_, std::move(other), 50);
  }
  patches_ = std::make_unique<Patches>(*facets_, std::move(bends), sharp_angle_deg);
}

RoundSurface::~RoundSurface() = default;
RoundSurface::RoundSurface(RoundSurface&&) noexcept = default;
RoundSurface& RoundSurface::operator=(RoundSurface&&) noexcept = default;

double RoundSurface::get_largest_bulge() const {
  double largest = 0;
  for (std::size_t e = 0; e < patches_->control.size(); ++e) {
    const Bend& edge = patches_->bends.edges[e];
    largest = std::max(largest, norm(patches_->calc_on_edge(e, 0.5) - 0.5 * (patches_->at(edge.ends[0]) + patches_->at(edge.ends[1]))));
  }
  return largest;
}

double RoundSurface::get_usual_bulge() const {
  const double largest = get_largest_bulge();
  std::vector<double> bulges;  // bulging edges only: a few on a large box count too
  for (std::size_t e = 0; e < patches_->control.size(); ++e) {
    const Bend& edge = patches_->bends.edges[e];
    const double bulge = norm(patches_->calc_on_edge(e, 0.5) - 0.5 * (patches_->at(edge.ends[0]) + patches_->at(edge.ends[1])));
    if (bulge > 0.01 * largest) bulges.push_back(bulge);
  }
  if (bulges.empty()) return 0;
  const auto place = bulges.begin() + static_cast<std::ptrdiff_t>(kDefaultPart * static_cast<double>(bulges.size() - 1));
  std::nth_element(bulges.begin(), place, bulges.end());
  return *place;
}

void RoundSurface::keep_facets() {
  pieces_ = 1;
  keeps_facets_ = true;
}

double RoundSurface::calc_volume() const {
  if (keeps_facets_) return mesher::calc_volume(*facets_);
  // Patches in 64 and in 16 triangles; the volume error falls with the squared size.
  constexpr int kPieces = 8;
  std::array<double, 2> sum{};
  std::array<std::array<Vec3, kPieces + 1>, kPieces + 1> x;
  const auto calc_cone = [](const Vec3& a, const Vec3& b, const Vec3& c) { return dot(cross(a, b), c) / 6; };
  const Vec3 origin = facets_->points.front();  // local origin: avoids cancellation far from the origin
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(facets_->triangles.size()); ++f) {
    for (int j = 0; j <= kPieces; ++j)
      for (int i = 0; i + j <= kPieces; ++i)
        x[j][i] = patches_->calc({f, {1.0 * (kPieces - i - j) / kPieces, 1.0 * i / kPieces, 1.0 * j / kPieces}}) - origin;
    for (int step = 1; step <= 2; ++step)
      for (int j = 0; j < kPieces; j += step)
        for (int i = 0; i + j < kPieces; i += step) {
          sum[step - 1] += calc_cone(x[j][i], x[j][i + step], x[j + step][i]);
          if (i + j + step < kPieces) sum[step - 1] += calc_cone(x[j][i + step], x[j + step][i + step], x[j + step][i]);
        }
  }
  return (4 * sum[0] - sum[1]) / 3;
}

TriangleSurface RoundSurface::cut(int pieces) {
  pieces_ = std::clamp(pieces, 1, kMaxPieces);
  pieces = pieces_;
  TriangleSurface out;
  out.points = facets_->points;
  std::vector<std::int32_t> first_of;  // first inner point of each edge, from its lower end
  for (std::size_t e = 0; e < patches_->bends.edges.size(); ++e) {
    first_of.push_back(static_cast<std::int32_t>(out.points.size()));
    for (int n = 1; n < pieces; ++n) out.points.push_back(patches_->calc_on_edge(e, static_cast<double>(n) / pieces));
  }
  std::vector<std::vector<std::int32_t>> row(pieces + 1);
  for (std::size_t f = 0; f < facets_->triangles.size(); ++f) {
    const Triangle& t = facets_->triangles[f];
    const auto on_edge = [&](int side, int from, int to, int n) {  // n-th point from corner `from` to corner `to`
      if (n == 0) return t[from];
      if (n == pieces) return t[to];
      return first_of[patches_->bends.edges_of[f][side]] + (t[from] < t[to] ? n : pieces - n) - 1;
    };
    for (int j = 0; j <= pieces; ++j) {  // towards corner 2
      auto& points = row[j];
      points.clear();
      for (int i = 0; i + j <= pieces; ++i) {  // towards corner 1
        const int k = pieces - i - j;
        if (j == 0) {
          points.push_back(on_edge(0, 0, 1, i));
        } else if (i == 0) {
          points.push_back(on_edge(2, 0, 2, j));
        } else if (k == 0) {
          points.push_back(on_edge(1, 1, 2, j));
        } else {
          points.push_back(static_cast<std::int32_t>(out.points.size()));
          out.points.push_back(patches_->calc({static_cast<std::int32_t>(f), {1.0 * k / pieces, 1.0 * i / pieces, 1.0 * j / pieces}}));
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

std::vector<std::array<std::int32_t, 2>> RoundSurface::list_folds() const {
  std::vector<std::array<std::int32_t, 2>> folds;
  for (const Bend& edge : patches_->bends.edges)
    if (edge.sharp && edge.count == 2) folds.push_back(edge.ends);
  return folds;
}

std::vector<std::array<std::int32_t, 2>> RoundSurface::list_lines() const {
  std::vector<std::array<std::int32_t, 2>> lines;
  for (std::size_t e = 0; e < patches_->bends.edges.size(); ++e) {
    const Bend& edge = patches_->bends.edges[e];
    if (!edge.sharp) continue;
    std::int32_t last = edge.ends[0];
    const auto first = static_cast<std::int32_t>(facets_->points.size() + e * static_cast<std::size_t>(pieces_ - 1));
    for (int n = 1; n <= pieces_; ++n) {
      const std::int32_t next = n == pieces_ ? edge.ends[1] : first + n - 1;
      lines.push_back({last, next});
      last = next;
    }
  }
  return lines;
}

RoundSurface::Place RoundSurface::find_place(std::int32_t triangle, const Vec3& p) const {
  // Triangles of a facet come in rows that alternate between upward and downward ones.
  const int pieces = pieces_;
  Place place{triangle / (pieces * pieces), {}};
  int left = triangle % (pieces * pieces), j = 0;
  while (left >= 2 * (pieces - j) - 1) left -= 2 * (pieces - j) - 1, ++j;
  const int i = left / 2;
  const auto make = [&](int to_1, int to_2) {
    return Weights{1.0 * (pieces - to_1 - to_2) / pieces, 1.0 * to_1 / pieces, 1.0 * to_2 / pieces};
  };
  const std::array<Weights, 3> weights = left % 2 == 0 ? std::array{make(i, j), make(i + 1, j), make(i, j + 1)}
                                                       : std::array{make(i + 1, j), make(i + 1, j + 1), make(i, j + 1)};
  std::array<Vec3, 3> x;
  for (int c = 0; c < 3; ++c) x[c] = patches_->calc({place.facet, weights[c]});
  const Vec3 ab = x[1] - x[0], ac = x[2] - x[0], ap = p - x[0];
  const double d00 = dot(ab, ab), d01 = dot(ab, ac), d11 = dot(ac, ac), d20 = dot(ap, ab), d21 = dot(ap, ac), det = d00 * d11 - d01 * d01;
  Weights l{1, 0, 0};
  if (det > 0) {
    l[1] = (d11 * d20 - d01 * d21) / det;
    l[2] = (d00 * d21 - d01 * d20) / det;
    l[0] = 1 - l[1] - l[2];
    double sum = 0;
    for (double& part : l) sum += part = part < kBarycentricTolerance ? 0 : part;  // points on a side stay there
    for (double& part : l) part /= sum;
  }
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < 3; ++k) place.at[k] += l[c] * weights[c][k];
  return place;
}

Vec3 RoundSurface::find(std::int32_t triangle, const Vec3& p) const { return keeps_facets_ ? p : patches_->calc(find_place(triangle, p)); }

bool RoundSurface::is_doubtful() const { return keeps_facets_ || other_ != nullptr; }

Vec3 RoundSurface::find_doubt(std::int32_t triangle, const Vec3& p) const {
  if (keeps_facets_) return patches_->calc(find_place(triangle, p)) - p;
  if (!other_) return {};
  const Place place = find_place(triangle, p);
  return other_->calc(place) - patches_->calc(place);
}

}  // namespace carillon::mesher
