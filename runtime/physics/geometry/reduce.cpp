// Method: patches by single linkage; of each patch the deepest point, the one furthest from it, the one furthest from their line, and the
//   one that adds most area on the other side; then those below the planes of these. Names by nearness of the stations.
// Source: textbook.
#include "runtime/physics/geometry/reduce.hpp"

#include <numeric>

namespace carillon::geometry {
namespace {

constexpr double kNormal = 0.966;        // cosine of 15 degrees
constexpr double kLevel = 1e-5;          // slope
constexpr double kLower = 1e-6;          // m; a touch this far below the plane of three kept ones is kept, too
constexpr double kOutside = 0.05;        // barycentric: how far outside their triangle it may lie
constexpr std::size_t kMostInPatch = 8;  // touches kept of a patch
constexpr double kFlatTriangle = 1e-6;   // area over the square of a side: no plane
constexpr std::uint64_t kTravels = 1ULL << 63;

/// Of the touches [first, last) of one patch those to keep, as indices.
void keep_four(const std::vector<Touch>& t, const std::vector<int>& patch, std::vector<int>& kept) {
  if (patch.size() <= 4) {
    kept.insert(kept.end(), patch.begin(), patch.end());
    return;
  }
  const auto best = [&](auto&& value) {
    int which = patch[0];
    double max = -Box::kFar;
    for (const int i : patch) {
      const double v = value(i);
      if (v > max) {
        max = v;
        which = i;
      }
    }
    return which;
  };
  int first = best([&](int i) { return -t[i].gap_m; });
  const auto find_furthest = [&](int from) { return best([&](int i) { return norm2(t[i].where_m - t[from].where_m); }); };
  const int second = find_furthest(first), end = find_furthest(second);
  // Where the deepest is no deeper than rounding makes it, the end counts.
  if (t[end].gap_m - t[first].gap_m < kLevel * norm(t[end].where_m - t[first].where_m)) first = end;
  const Vec3 n = t[first].normal, o = t[first].where_m;
  const Vec3 along = t[second].where_m - o;
  const auto area = [&](int i) { return dot(n, cross(along, t[i].where_m - o)); };
  const int third = best([&](int i) { return std::abs(area(i)); });
  const double side = area(third) < 0.0 ? -1.0 : 1.0;
  const Vec3 p = t[second].where_m, q = t[third].where_m;
  const auto gain = [&](int i) {  // area outside of the triangle
    const Vec3& x = t[i].where_m;
    return std::max({-side * dot(n, cross(p - o, x - o)), -side * dot(n, cross(q - p, x - p)), -side * dot(n, cross(o - q, x - q))});
  };
  const int fourth = best(gain);
  const double scale = norm2(along);
  kept.push_back(first);
  if (scale > 0.0) kept.push_back(second);
  if (std::abs(area(third)) > 1e-6 * scale) {
    kept.push_back(third);
  } else if (end != first && end != second) {  // a line
    kept.push_back(end);
  }
  if (gain(fourth) > 1e-6 * scale && fourth != first && fourth != second && fourth != third) kept.push_back(fourth);
}

/// How much lower a touch is than the kept ones about it, in whatever way the patch tilts [m]; negative: higher, or none is about it.
double find_excess(const std::vector<Touch>& t, int i, const std::vector<int>& kept) {
  const Vec3 &x = t[i].where_m, &n = t[kept[0]].normal;
  double lowest = -Box::kFar;
  for (std::size_t a = 0; a < kept.size(); ++a)
    for (std::size_t b = 0; b < a; ++b)
      for (std::size_t c = 0; c < b; ++c) {
        const Touch &p = t[kept[a]], &q = t[kept[b]], &r = t[kept[c]];
        const double parts[3] = {dot(n, cross(q.where_m - x, r.where_m - x)), dot(n, cross(r.where_m - x, p.where_m - x)),
                                 dot(n, cross(p.where_m - x, q.where_m - x))};
        const double area = parts[0] + parts[1] + parts[2];
        if (std::abs(area) < kFlatTriangle * norm2(q.where_m - p.where_m)) continue;
        const double u = parts[0] / area, v = parts[1] / area, w = parts[2] / area;
        if (std::min({u, v, w}) < -kOutside) continue;
        const double gap = u * p.gap_m + v * q.gap_m + w * r.gap_m;
        lowest = lowest == -Box::kFar ? gap : std::min(lowest, gap);
      }
  return lowest - t[i].gap_m;
}

/// Adds the touches of a patch that may carry before those kept: one below the plane of three others about it stays below however the
/// bodies tilt.
void keep_low(const std::vector<Touch>& t, const std::vector<int>& patch, std::vector<int>& kept) {
  while (kept.size() < kMostInPatch) {
    double most = kLower;
    int lowest = -1;
    for (const int i : patch)
      if (std::find(kept.begin(), kept.end(), i) == kept.end())
        if (const double excess = find_excess(t, i, kept); excess > most) most = excess, lowest = i;
    if (lowest < 0) return;
    kept.push_back(lowest);
  }
}

}  // namespace

void reduce(std::vector<Touch>& touches, double patch_m) {
  const int count = static_cast<int>(touches.size());
  if (count <= 4) return;
  std::vector<int> group(count);
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&](int i) {
    while (group[i] != i) i = group[i] = group[group[i]];
    return i;
  };
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < i; ++j) {
      if (dot(touches[i].normal, touches[j].normal) < kNormal || norm2(touches[i].where_m - touches[j].where_m) > patch_m * patch_m)
        continue;
      const int p = root(i), q = root(j);
      group[std::max(p, q)] = std::min(p, q);
    }
  }
  std::vector<int> patch, kept, of_patch;
  for (int r = 0; r < count; ++r) {
    if (root(r) != r) continue;
    patch.clear();
    for (int i = r; i < count; ++i)
      if (root(i) == r) patch.push_back(i);
    of_patch.clear();
    keep_four(touches, patch, of_patch);
    keep_low(touches, patch, of_patch);
    kept.insert(kept.end(), of_patch.begin(), of_patch.end());
  }
  std::sort(kept.begin(), kept.end());
  std::vector<Touch> few;
  few.reserve(kept.size());
  for (const int i : kept) few.push_back(touches[i]);
  touches.swap(few);
}

void name(std::vector<Touch>& touches, double reach_m, PairMemory& memory) {
  std::vector<char> taken(memory.last.size(), 0);
  for (Touch& t : touches) {
    if (!t.smooth) continue;
    double min = reach_m * reach_m;
    int which = -1;
    for (std::size_t i = 0; i < memory.last.size(); ++i) {
      const Touch& old = memory.last[i];
      if (taken[i] != 0 || !old.smooth || dot(old.normal, t.normal) < 0.8) continue;
      const double d =
          std::min(norm2(old.where_m - t.where_m), std::min(norm2(old.station_a - t.station_a), norm2(old.station_b - t.station_b)));
      if (d < min) {
        min = d;
        which = static_cast<int>(i);
      }
    }
    if (which >= 0) {
      taken[which] = 1;
      t.id = memory.last[which].id;
    } else {
      t.id = kTravels | ++memory.serial;
    }
  }
  memory.last = touches;
}

}  // namespace carillon::geometry
