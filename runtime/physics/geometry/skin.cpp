// Method: coplanar faces are joined into regions by flood fill. An edge between regions is sharp above 40 degrees, or above 20 degrees and
// three times the mean of the other edges about its two regions. Corners of faces joined over non-sharp edges share an angle-weighted
// normal and a curvature tensor (least squares over the edges); a plane facet much larger than its curved neighbours keeps its own normal.
// At a tip (a vertex without sharp edges whose faces deviate from their mean by a sharp angle, like the apex of a cone) each face keeps its
// normal; edges there lie in both faces, so that patches still meet. The lowest point of a quadratic patch has a closed form; the search
// walks over edges while the height decreases.
// Source: T. Boubekeur, M. Alexa, "Phong tessellation" (2008), with alpha 1/2 in place of 3/4, which is exact for circles to second order;
// G. Thuermer, C. Wuethrich (1998) for the angle weights.
#include "runtime/physics/geometry/skin.hpp"

#include <map>
#include <utility>

namespace carillon::geometry {
namespace {

constexpr double kCoplanarRad = 2e-4;     // rad
constexpr double kSharpRad = 0.698;       // rad, 40 degrees
constexpr double kBluntRad = 0.35;        // rad, 20 degrees; below, an edge between other edges is never sharp
constexpr double kSharpRatio = 3.0;       // relative to the mean about it
constexpr double kLargePlaneRatio = 6.0;  // times the area of its curved neighbours
constexpr double kLargePlaneOfAll = 0.01;
constexpr double kAlpha = 0.5;
constexpr double kSpring = 1e-3, kStays = 0.2;  // spring curvature times the size

double calc_angle(const Vec3& a, const Vec3& b) { return std::atan2(norm(cross(a, b)), dot(a, b)); }

}  // namespace

Skin::Skin(const Mesh& mesh) : mesh_(mesh) {
  size_m_ = norm(mesh.box.high - mesh.box.low);
  tiny_ = 1e-14 * size_m_;
  find_regions();
  find_sharp_edges();
  make_fans();
  make_groups();
  make_bends();
  all_curved_ = std::find(flat_.begin(), flat_.end(), 1) == flat_.end() &&
                std::all_of(kinds_.begin(), kinds_.end(), [](VertexKind kind) { return kind == VertexKind::smooth; });
}

void Skin::find_regions() {
  region_.assign(mesh_.faces.size(), -1);
  std::vector<int> open;
  for (int seed = 0; seed < mesh_.count_faces(); ++seed) {
    if (region_[seed] >= 0) continue;
    const int r = regions_++;
    region_area_.push_back(0.0);
    region_[seed] = r;
    open.push_back(seed);
    while (!open.empty()) {
      const int f = open.back();
      open.pop_back();
      region_area_[r] += 0.5 * norm(cross(mesh_.corner(f, 1) - mesh_.corner(f, 0), mesh_.corner(f, 2) - mesh_.corner(f, 0)));
      for (int k = 0; k < 3; ++k) {
        const int g = mesh_.opposite[3 * f + k] / 3;
        if (region_[g] < 0 && norm2(mesh_.normals[g] - mesh_.normals[seed]) < kCoplanarRad * kCoplanarRad) {
          region_[g] = r;
          open.push_back(g);
        }
      }
    }
  }
}

void Skin::find_sharp_edges() {
  const int edges = 3 * mesh_.count_faces();
  sharp_.assign(edges, 0);
  std::map<std::pair<int, int>, double> angles;  // maximum angle of each region pair
  for (int e = 0; e < edges; ++e) {
    const int f = e / 3, g = mesh_.opposite[e] / 3;
    if (region_[f] >= region_[g]) continue;
    double& angle = angles[{region_[f], region_[g]}];
    angle = std::max(angle, calc_angle(mesh_.normals[f], mesh_.normals[g]));
  }
  std::vector<double> sum(regions_, 0.0), area(regions_, 0.0);
  std::vector<int> count(regions_, 0);
  for (const auto& [pair, angle] : angles) {
    if (angle > kSharpRad) continue;
    for (const auto& [r, other] : {pair, std::pair(pair.second, pair.first)}) {
      sum[r] += angle;
      ++count[r];
      area[r] += region_area_[other];
    }
  }
  plane_.assign(regions_, 0);
  for (int r = 0; r < regions_; ++r)
    plane_[r] =
        count[r] > 0 && region_area_[r] > kLargePlaneRatio * area[r] / count[r] && region_area_[r] > kLargePlaneOfAll * mesh_.area_m2;
  for (int e = 0; e < edges; ++e) {
    int r = region_[e / 3], s = region_[mesh_.opposite[e] / 3];
    if (r == s) continue;
    if (r > s) std::swap(r, s);
    const double angle = angles[{r, s}];
    const int others = count[r] + count[s] - 2;
    const bool lonely = others <= 0 || (angle > kBluntRad && angle > kSharpRatio * (sum[r] + sum[s] - 2.0 * angle) / others);
    sharp_[e] = angle > kSharpRad || lonely || (plane_[r] != 0 && plane_[s] != 0);
  }
  // A sharp chain that ends within a curved part is a dent of the mesh, not a ridge: ridges are closed or end at corners.
  std::vector<int> meeting(mesh_.vertices.size(), 0), open;
  for (int e = 0; e < edges; ++e)
    if (sharp_[e] != 0) ++meeting[mesh_.vertex_of(e)];
  for (int v = 0; v < mesh_.count_vertices(); ++v)
    if (meeting[v] == 1) open.push_back(v);
  while (!open.empty()) {
    const int v = open.back();
    open.pop_back();
    if (meeting[v] != 1) continue;
    int e = mesh_.any_half_edge[v];
    while (sharp_[e] == 0) e = Mesh::next(mesh_.opposite[e]);
    const int back = mesh_.opposite[e], end = mesh_.vertex_of(back);
    sharp_[e] = sharp_[back] = 0;
    meeting[v] = 0;
    if (--meeting[end] == 1) open.push_back(end);
  }
  for (int e = 0; e < edges; ++e)
    if (sharp_[e] == 0 && region_[e / 3] != region_[mesh_.opposite[e] / 3]) ++smooth_edges_;
}

void Skin::make_fans() {
  fan_.assign(3 * mesh_.faces.size(), -1);
  kinds_.assign(mesh_.vertices.size(), VertexKind::none);
  flat_.assign(mesh_.faces.size(), 1);
  std::vector<int> around, corners;
  for (int v = 0; v < mesh_.count_vertices(); ++v) {
    around.clear();
    int e = mesh_.any_half_edge[v];
    int first = 0;  // start of the first fan: behind a sharp edge
    int sharp = 0;
    bool curved = false, tip = false;
    std::array<Vec3, 2> ways{};
    do {
      around.push_back(e);
      if (sharp_[e] != 0) {
        first = static_cast<int>(around.size());
        if (sharp < 2) ways[sharp] = normalise(mesh_.vertices[mesh_.vertex_of(Mesh::next(e))] - mesh_.vertices[v]);
        ++sharp;
      }
      e = Mesh::next(mesh_.opposite[e]);
    } while (e != mesh_.any_half_edge[v]);
    const int count = static_cast<int>(around.size());
    corners.clear();
    for (int i = 0; i < count; ++i) {
      const int corner = around[(first + i) % count];
      corners.push_back(corner);
      if (i + 1 < count && sharp_[corner] == 0) continue;
      const int fan = static_cast<int>(fan_normals_.size());
      Vec3 sum{}, plane{};
      int one = region_[corners[0] / 3], planes = 0;
      bool same = true;
      for (const int c : corners) {
        fan_[c] = fan;
        const int f = c / 3, k = c % 3;
        same = same && region_[f] == one;
        const Vec3 p = mesh_.corner(f, (k + 1) % 3) - mesh_.corner(f, k), q = mesh_.corner(f, (k + 2) % 3) - mesh_.corner(f, k);
        sum = sum + calc_angle(p, q) * mesh_.normals[f];
        if (plane_[region_[f]] != 0) {
          plane = plane + mesh_.normals[f];
          ++planes;
        }
      }
      if (sharp == 0 && is_tip(corners, normalise(sum))) {
        tip = true;
        for (const int c : corners) {
          fan_[c] = static_cast<int>(fan_normals_.size());
          fan_normals_.push_back(mesh_.normals[c / 3]);
          fan_tensors_.push_back({});
          fan_curved_.push_back(0);
        }
        break;
      }
      fan_normals_.push_back(normalise(planes > 0 ? plane : sum));
      fan_tensors_.push_back({});
      fan_curved_.push_back(same ? 0 : 1);
      if (!same) {
        curved = true;
        fit_tensor(v, corners, fan);
        for (const int c : corners)
          if (plane_[region_[c / 3]] == 0) flat_[c / 3] = 0;
      }
      corners.clear();
    }
    if (tip) {
      kinds_[v] = VertexKind::corner;
    } else if (sharp == 0) {
      kinds_[v] = curved ? VertexKind::smooth : VertexKind::none;
    } else if (sharp == 2) {
      const double bend = calc_angle(ways[0], -1.0 * ways[1]);
      kinds_[v] = bend > kSharpRad ? VertexKind::corner : curved || bend > kCoplanarRad ? VertexKind::ridge : VertexKind::none;
    } else {
      kinds_[v] = VertexKind::corner;
    }
  }
}

bool Skin::is_tip(const std::vector<int>& corners, const Vec3& mean) const {
  double max = 0.0, edges = 0.0;
  for (const int c : corners) {
    max = std::max(max, calc_angle(mesh_.normals[c / 3], mean));
    edges += calc_angle(mesh_.normals[c / 3], mesh_.normals[mesh_.opposite[c] / 3]);
  }
  return max > kSharpRad || (max > kBluntRad && max > kSharpRatio * edges / static_cast<double>(corners.size()));
}

void Skin::fit_tensor(int v, const std::vector<int>& corners, int fan) {
  const Vec3& n = fan_normals_[fan];
  const Vec3 s = find_across(n), t = cross(n, s);
  double m[3][4] = {};  // normal equations of k11, k12, k22
  double mean = 0.0;
  int rows = 0;
  for (const int c : corners) {
    for (const int other : {Mesh::next(c), Mesh::next(Mesh::next(c))}) {
      const Vec3 d = mesh_.vertices[mesh_.vertex_of(other)] - mesh_.vertices[v];
      const double x = dot(d, s), y = dot(d, t), r2 = x * x + y * y;
      if (!(r2 > 0.0)) continue;
      const double k = -2.0 * dot(d, n) / r2;
      const double row[4] = {x * x / r2, 2.0 * x * y / r2, y * y / r2, k};
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 4; ++j) m[i][j] += row[i] * row[j];
      mean += k;
      ++rows;
    }
  }
  if (rows == 0) return;
  mean /= rows;
  const double soft = 1e-3 * rows;
  m[0][0] += soft, m[1][1] += soft, m[2][2] += soft;
  m[0][3] += soft * mean, m[2][3] += soft * mean;
  for (int i = 0; i < 3; ++i) {  // positive definite: no pivoting
    for (int j = i + 1; j < 3; ++j) {
      const double factor = m[j][i] / m[i][i];
      for (int k = i; k < 4; ++k) m[j][k] -= factor * m[i][k];
    }
  }
  const double k22 = m[2][3] / m[2][2], k12 = (m[1][3] - m[1][2] * k22) / m[1][1];
  const double k11 = (m[0][3] - m[0][1] * k12 - m[0][2] * k22) / m[0][0];
  const auto entry = [&](int i, int j) { return k11 * s[i] * s[j] + k12 * (s[i] * t[j] + t[i] * s[j]) + k22 * t[i] * t[j]; };
  fan_tensors_[fan] = {entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)};
}

void Skin::make_groups() {
  group_.assign(mesh_.faces.size(), -1);
  std::vector<int> open;
  int groups = 0;
  for (int seed = 0; seed < mesh_.count_faces(); ++seed) {
    if (group_[seed] >= 0) continue;
    group_[seed] = groups;
    open.push_back(seed);
    while (!open.empty()) {
      const int f = open.back();
      open.pop_back();
      for (int k = 0; k < 3; ++k) {
        const int g = mesh_.opposite[3 * f + k] / 3;
        if (group_[g] >= 0 || sharp_[3 * f + k] != 0) continue;
        group_[g] = groups;
        open.push_back(g);
      }
    }
    ++groups;
  }
}

double Skin::calc_rim_radius_m(int vertex) const {
  if (vertex < 0 || kinds_[vertex] != VertexKind::ridge) return 0.0;
  std::array<Vec3, 2> ways{};
  int count = 0, e = mesh_.any_half_edge[vertex];
  do {
    if (sharp_[e] != 0) ways[count++] = mesh_.vertices[mesh_.vertex_of(Mesh::next(e))] - mesh_.vertices[vertex];
    e = Mesh::next(mesh_.opposite[e]);
  } while (e != mesh_.any_half_edge[vertex]);
  const double bend = calc_angle(ways[0], -1.0 * ways[1]);
  return bend > kCoplanarRad ? std::min(0.5 * (norm(ways[0]) + norm(ways[1])) / bend, 0.5 * size_m_) : 0.0;
}

int Skin::find_face(int vertex) const {
  const int start = mesh_.any_half_edge[vertex];
  int e = start;
  do {
    if (!is_flat(e / 3)) return e / 3;
    e = Mesh::next(mesh_.opposite[e]);
  } while (e != start);
  return start / 3;
}

/// Control points of curved edges. A sharp edge bends in the plane of its tangents, given by the normals of both sides, so that both sides
/// meet.
void Skin::make_bends() {
  bends_.resize(mesh_.faces.size());
  for (int e = 0; e < 3 * mesh_.count_faces(); ++e) {
    const int next = Mesh::next(e), other = mesh_.opposite[e];
    const Vec3 &p = mesh_.vertices[mesh_.vertex_of(e)], &q = mesh_.vertices[mesh_.vertex_of(next)], d = q - p;
    Vec3& control = bends_[e / 3][e % 3];
    control = 0.5 * (p + q);
    const auto lift = [&](int corner, int across) {  // height of the other end over the tangent plane or line at a corner
      const Vec3& n = fan_normals_[fan_[corner]];
      const Vec3 t = cross(n, fan_normals_[fan_[across]]);
      if (sharp_[e] == 0) return dot(d, n) * n;
      return norm2(t) > kCoplanarRad ? d - (dot(d, t) / norm2(t)) * t : Vec3{};
    };
    if (flat_[e / 3] == 0) control = control - (0.5 * kAlpha) * lift(e, Mesh::next(other)) + (0.5 * kAlpha) * lift(next, other);
    sag_m_ = std::max(sag_m_, 2.0 / 3.0 * norm(control - 0.5 * (p + q)));
  }
}

Vec3 Skin::calc_point(int face, const Vec3& w) const {
  if (flat_[face] != 0) return mesh_.place(face, w);
  const Patch q = get_patch(face);
  Vec3 x{};
  for (int k = 0; k < 3; ++k) x = x + (w[k] * w[k]) * q.p[k] + (2.0 * w[k] * w[(k + 1) % 3]) * q.c[k];
  return x;
}

Vec3 Skin::calc_normal(int face, const Vec3& w) const {
  if (flat_[face] != 0) return mesh_.normals[face];
  const Patch q = get_patch(face);
  std::array<Vec3, 3> d;  // derivatives by the weights
  for (int k = 0; k < 3; ++k) d[k] = w[k] * q.p[k] + w[(k + 1) % 3] * q.c[k] + w[(k + 2) % 3] * q.c[(k + 2) % 3];
  return normalise(cross(d[1] - d[0], d[2] - d[0]));
}

Tensor Skin::calc_tensor(int face, const Vec3& w) const {
  Tensor sum{};
  if (flat_[face] != 0) return sum;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 6; ++i) sum[i] += w[k] * fan_tensors_[fan_[3 * face + k]][i];
  return sum;
}

double Skin::calc_mean_curvature(int face, const Vec3& w) const { return calc_mean(calc_tensor(face, w)); }

/// Replaces a point by the lowest point of another face, if that is lower and below `below`; place() follows.
void Skin::lower(const Vec3& up, int face, const Vec3& centre, double spring, double below, Spot& spot) const {
  const Patch q = get_patch(face);
  const Vec3 d0 = q.p[0] - centre, d1 = q.p[1] - centre, d2 = q.p[2] - centre;
  const double a0 = dot(up, q.p[0]) + spring * norm2(d0), a1 = dot(up, q.p[1]) + spring * norm2(d1),
               a2 = dot(up, q.p[2]) + spring * norm2(d2);
  const double c01 = dot(up, q.c[0]) + spring * dot(d0, d1), c12 = dot(up, q.c[1]) + spring * dot(d1, d2),
               c20 = dot(up, q.c[2]) + spring * dot(d2, d0);
  // The coefficients bound the height from below, up to rounding.
  if (std::min({a0, a1, a2, c01, c12, c20}) >= below + tiny_) return;
  double lowest = Box::kFar;
  Vec3 weights{};
  const auto take = [&](double w0, double w1, double w2) {
    const double h = w0 * w0 * a0 + w1 * w1 * a1 + w2 * w2 * a2 + 2.0 * (w0 * w1 * c01 + w1 * w2 * c12 + w2 * w0 * c20);
    if (h < lowest) {
      lowest = h;
      weights = {w0, w1, w2};
    }
  };
  take(1, 0, 0);
  take(0, 1, 0);
  take(0, 0, 1);
  {
    const auto on_edge = [&](double a, double c, double b) {  // (1-s)^2 a + 2 s (1-s) c + s^2 b
      const double bend = a + b - 2.0 * c;
      const double s = bend > tiny_ ? (a - c) / bend : -1.0;
      return s > 0.0 && s < 1.0 ? s : -1.0;
    };
    double s = on_edge(a0, c01, a1);
    if (s > 0.0) take(1.0 - s, s, 0.0);
    s = on_edge(a1, c12, a2);
    if (s > 0.0) take(0.0, 1.0 - s, s);
    s = on_edge(a2, c20, a0);
    if (s > 0.0) take(s, 0.0, 1.0 - s);
    const double h11 = a0 + a1 - 2.0 * c01, h22 = a0 + a2 - 2.0 * c20, h12 = a0 + c12 - c01 - c20;
    const double det = h11 * h22 - h12 * h12;
    if (h11 > tiny_ && det > tiny_ * h11) {
      const double g1 = a0 - c01, g2 = a0 - c20;
      const double u = (g1 * h22 - g2 * h12) / det, v = (g2 * h11 - g1 * h12) / det;
      if (u > 0.0 && v > 0.0 && u + v < 1.0) take(1.0 - u - v, u, v);
    }
  }
  if (!(lowest < below && lowest < spot.height)) return;
  spot.face = face;
  spot.height = lowest;
  spot.weights = weights;
}

/// Point of a spot on the patch; also for a flat face.
void Skin::place(Spot& spot) const {
  const Patch q = get_patch(spot.face);
  const Vec3& w = spot.weights;
  spot.point = Vec3{};
  for (int k = 0; k < 3; ++k) spot.point = spot.point + (w[k] * w[k]) * q.p[k] + (2.0 * w[k] * w[(k + 1) % 3]) * q.c[k];
}

Spot Skin::walk_lowest(const Vec3& up, int face, const Vec3& centre, double reach, bool stays) const {
  constexpr int kMax = 400;
  const double spring = 0.5 * (stays ? kStays : kSpring) / size_m_;
  Spot best;
  best.face = face;
  best.height = Box::kFar;
  lower(up, face, centre, spring, Box::kFar, best);
  for (int step = 0; step < kMax; ++step) {
    place(best);
    if (norm2(best.point - centre) > reach * reach) {
      best.settled = false;
      return best;
    }
    const auto [zeros, start] = find_feature(best.face, best.weights);
    if (zeros == 0) return best;
    const double below = best.height - tiny_;
    Spot better = best;
    if (zeros == 1) {
      lower(up, mesh_.opposite[start] / 3, centre, spring, below, better);
    } else {
      for (int e = Mesh::next(mesh_.opposite[start]); e != start; e = Mesh::next(mesh_.opposite[e]))
        lower(up, e / 3, centre, spring, below, better);
    }
    if (!(better.height < below)) return best;
    best = better;
  }
  place(best);
  return best;
}

Spot Skin::locate(const Vec3& x, int face) const {
  const Nearest best = mesh_.walk_nearest(x, face);
  Spot spot;
  spot.face = best.face;
  spot.weights = best.weights;
  spot.point = calc_point(best.face, best.weights);
  return spot;
}

}  // namespace carillon::geometry
