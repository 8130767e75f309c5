// Method:     incremental convex hull: faces that see a new point are removed, and their border is joined to it. Coplanar quadruples (every
//             regular grid has many) are broken by outward shifts below 1e-7, different for each point. Weights by Cramer's rule: d = sum
//             of weight_i u_i.
// Source:     Preparata and Hong 1977 (hull); Devillers, Pion and Teillaud 2002 (walk in a triangulation).
// Deviations: no conflict graph: every point tests all faces; 1 s for 20 000 directions.
#include "runtime/acoustics/head/directions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::head {
namespace {

constexpr double kShift = 1e-7;      // of a point; points kNearestRad apart bulge by 1.5e-6
constexpr int kMaxSteps = 256;       // per walk
constexpr double kMinVolume = 1e-3;  // six times the volume of the first tetrahedron

/// Face of the hull with its plane.
struct Face {
  std::array<int, 3> corner{};
  Vec3 normal{};
  double offset = 0.0;
};

/// Deterministic pseudo-random number in 0..1.
double scatter(std::uint64_t i) {
  std::uint64_t z = (i + 1) * 0x9E3779B97F4A7C15U;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
  return static_cast<double>((z ^ (z >> 31U)) >> 11U) * 0x1.0p-53;
}

Face make_face(const std::vector<Vec3>& points, int a, int b, int c) {
  const auto at = [&](int i) -> const Vec3& { return points[i]; };
  const Vec3 normal = cross(at(b) - at(a), at(c) - at(a));
  return {{a, b, c}, normal, dot(normal, at(a))};
}

/// Faces of a tetrahedron of four points far from coplanar; empty if there are none.
std::vector<Face> make_first_faces(const std::vector<Vec3>& points) {
  const auto find_most = [&](const auto& measure) {
    std::size_t best = 0;
    for (std::size_t i = 1; i < points.size(); ++i)
      if (measure(points[i]) > measure(points[best])) best = i;
    return best;
  };
  if (points.size() < 4) return {};
  const std::size_t a = 0;
  const std::size_t b = find_most([&](const Vec3& p) { return norm(p - points[a]); });
  const std::size_t c = find_most([&](const Vec3& p) { return norm(cross(points[b] - points[a], p - points[a])); });
  const Vec3 normal = cross(points[b] - points[a], points[c] - points[a]);
  const std::size_t d = find_most([&](const Vec3& p) { return std::abs(dot(normal, p - points[a])); });
  const double volume = dot(normal, points[d] - points[a]);
  if (!(std::abs(volume) > kMinVolume)) return {};
  std::array<int, 4> t{static_cast<int>(a), static_cast<int>(b), static_cast<int>(c), static_cast<int>(d)};
  if (volume > 0.0) std::swap(t[1], t[2]);  // the fourth is behind the first three
  return {make_face(points, t[0], t[1], t[2]), make_face(points, t[0], t[3], t[1]), make_face(points, t[1], t[3], t[2]),
          make_face(points, t[2], t[3], t[0])};
}

/// Adds a point to the hull. `seen`: reused buffer.
void add_point(const std::vector<Vec3>& points, int p, std::vector<Face>& faces, std::vector<Face>& seen) {
  const Vec3& place = points[p];
  seen.clear();
  for (std::size_t f = 0; f < faces.size();) {
    if (dot(faces[f].normal, place) - faces[f].offset > 0.0) {
      seen.push_back(faces[f]);
      faces[f] = faces.back();
      faces.pop_back();
    } else {
      ++f;
    }
  }
  // The border is one loop: edges of visible faces whose other face is not visible.
  std::vector<std::array<int, 2>> edges;
  edges.reserve(3 * seen.size());
  for (const Face& face : seen)
    for (std::size_t i = 0; i < 3; ++i) edges.push_back({face.corner[i], face.corner[(i + 1) % 3]});
  std::vector<std::array<int, 2>> sorted = edges;
  std::sort(sorted.begin(), sorted.end());
  for (const auto& edge : edges) {
    if (std::binary_search(sorted.begin(), sorted.end(), std::array<int, 2>{edge[1], edge[0]})) continue;
    faces.push_back(make_face(points, edge[0], edge[1], p));
  }
}

std::vector<Face> make_hull(const std::vector<Vec3>& unit) {
  std::vector<Vec3> points(unit.size());
  for (std::size_t i = 0; i < unit.size(); ++i) points[i] = (1.0 + kShift * scatter(i)) * unit[i];
  std::vector<Face> faces = make_first_faces(points);
  if (faces.empty()) return faces;
  std::vector<Face> seen;
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [](std::size_t a, std::size_t b) { return scatter(~a) < scatter(~b); });
  std::vector<bool> is_in(points.size());
  for (const Face& face : faces)
    for (const int corner : face.corner) is_in[corner] = true;
  for (const std::size_t p : order)
    if (!is_in[p]) add_point(points, static_cast<int>(p), faces, seen);
  return faces;
}

}  // namespace

Directions::Directions(const std::vector<Vec3>& unit, const std::string& name) : unit_(unit) {
  const std::vector<Face> faces = make_hull(unit);
  const double nearest = std::cos(kWidestRad);
  const bool is_closed = !faces.empty() && std::all_of(faces.begin(), faces.end(),
                                                       [&](const Face& face) { return face.offset > nearest * norm(face.normal); });
  if (!is_closed)
    throw InputError(name + ": its directions leave a gap on the sphere around the head; give a set that covers all directions");
  triangles_.reserve(faces.size());
  std::vector<std::pair<std::array<int, 2>, int>> sides;  // directed edge, and its triangle
  sides.reserve(3 * faces.size());
  for (const Face& face : faces) {
    const int t = static_cast<int>(triangles_.size());
    triangles_.push_back({.corner = face.corner});
    for (std::size_t i = 0; i < 3; ++i) sides.push_back({{face.corner[(i + 1) % 3], face.corner[(i + 2) % 3]}, t});
  }
  std::sort(sides.begin(), sides.end());
  for (Triangle& triangle : triangles_) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::array<int, 2> back{triangle.corner[(i + 2) % 3], triangle.corner[(i + 1) % 3]};
      const auto found = std::lower_bound(sides.begin(), sides.end(), std::pair{back, 0});
      if (found == sides.end() || found->first != back) throw SolveError(name + ": the triangulation of its directions is not closed");
      triangle.neighbour[i] = found->second;
    }
  }
  int from = 0;
  for (std::size_t side = 0; side < 6; ++side) {
    for (std::size_t i = 0; i < kCells; ++i) {
      for (std::size_t j = 0; j < kCells; ++j) {
        const double middle[2] = {(2.0 * static_cast<double>(i) + 1.0) / kCells - 1.0, (2.0 * static_cast<double>(j) + 1.0) / kCells - 1.0};
        Vec3 d{};
        d[side / 2] = side % 2 == 0 ? 1.0 : -1.0;
        d[(side / 2 + 1) % 3] = middle[0];
        d[(side / 2 + 2) % 3] = middle[1];
        std::array<double, 3> share{};
        from = walk(d, from, share);
        start_[find_cell(d)] = from;
      }
    }
  }
}

std::size_t Directions::find_cell(const Vec3& direction) noexcept {
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k)
    if (std::abs(direction[k]) > std::abs(direction[axis])) axis = k;
  const double length = std::abs(direction[axis]);
  const auto find_step = [&](double along) {
    return static_cast<std::size_t>(std::clamp(0.5 * kCells * (along / length + 1.0), 0.0, kCells - 0.5));
  };
  const std::size_t side = 2 * axis + (direction[axis] > 0.0 ? 0U : 1U);
  return (side * kCells + find_step(direction[(axis + 1) % 3])) * kCells + find_step(direction[(axis + 2) % 3]);
}

int Directions::walk(const Vec3& direction, int from, std::array<double, 3>& share) const noexcept {
  for (int step = 0;; ++step) {
    const Triangle& triangle = triangles_[from];
    const Vec3& a = unit_[triangle.corner[0]];
    const Vec3& b = unit_[triangle.corner[1]];
    const Vec3& c = unit_[triangle.corner[2]];
    share = {dot(direction, cross(b, c)), dot(direction, cross(c, a)), dot(direction, cross(a, b))};
    const std::size_t least = std::min_element(share.begin(), share.end()) - share.begin();
    if (!(share[least] < 0.0) || step == kMaxSteps) return from;
    from = triangle.neighbour[least];
  }
}

Surrounding Directions::find(const Vec3& direction) const noexcept {
  const double square = dot(direction, direction);
  const Vec3 d = std::isfinite(square) && square > 0.0 ? direction : Vec3{1.0, 0.0, 0.0};
  Surrounding found;
  const int t = walk(d, start_[find_cell(d)], found.share);
  found.direction = triangles_[t].corner;
  double total = 0.0;
  for (double& share : found.share) total += share = std::max(0.0, share);
  if (!(total > 0.0)) return {found.direction, {1.0, 0.0, 0.0}};
  for (double& share : found.share) share /= total;
  return found;
}

}  // namespace carillon::head
