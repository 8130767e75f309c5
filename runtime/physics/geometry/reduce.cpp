// Method: patches by single linkage; per patch the deepest point, the point furthest from it, the point furthest from their line, and the
// point on the other side that adds most area; then points below the planes through these. Identities by nearness of the stations.
#include "runtime/physics/geometry/reduce.hpp"

#include <algorithm>

#include "runtime/base/groups.hpp"

namespace carillon::geometry {
namespace {

constexpr double kPatchCosine = 0.966;       // cosine of 15 degrees
constexpr double kLevelSlope = 1e-5;         // slope
constexpr double kKeepDepthM = 1e-6;         // m; a touch this far below the plane of three kept ones is kept too
constexpr double kBarycentricMargin = 0.05;  // barycentric: permitted distance outside their triangle
constexpr std::size_t kMostInPatch = 8;      // touches kept per patch
constexpr double kFlatTriangle = 1e-6;       // area relative to a squared side: too flat to define a plane
constexpr std::uint64_t kMovingIdBit = 1ULL << 63;

/// Selects the touches of one patch to keep, as indices.
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
  // If the deepest touch is deeper by rounding only, take the end of the patch instead.
  if (t[end].gap_m - t[first].gap_m < kLevelSlope * norm(t[end].where_m - t[first].where_m)) first = end;
  const Vec3 n = t[first].normal, o = t[first].where_m;
  const Vec3 along = t[second].where_m - o;
  const auto area = [&](int i) { return dot(n, cross(along, t[i].where_m - o)); };
  const int third = best([&](int i) { return std::abs(area(i)); });
  const double side = area(third) < 0.0 ? -1.0 : 1.0;
  const Vec3 p = t[second].where_m, q = t[third].where_m;
  const auto gain = [&](int i) {  // added area outside the triangle
    const Vec3& x = t[i].where_m;
    return std::max({-side * dot(n, cross(p - o, x - o)), -side * dot(n, cross(q - p, x - p)), -side * dot(n, cross(o - q, x - q))});
  };
  const int fourth = best(gain);
  const double scale = norm2(along);
  kept.push_back(first);
  if (scale > 0.0) kept.push_back(second);
  if (std::abs(area(third)) > 1e-6 * scale) {
    kept.push_back(third);
  } else if (end != first && end != second) {  // collinear patch
    kept.push_back(end);
  }
  if (gain(fourth) > 1e-6 * scale && fourth != first && fourth != second && fourth != third) kept.push_back(fourth);
}

/// Maximum depth of a touch below the planes of the surrounding kept ones [m]; negative: above, or not surrounded.
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
        if (std::min({u, v, w}) < -kBarycentricMargin) continue;
        const double gap = u * p.gap_m + v * q.gap_m + w * r.gap_m;
        lowest = lowest == -Box::kFar ? gap : std::min(lowest, gap);
      }
  return lowest - t[i].gap_m;
}

/// Adds the touches of a patch that may become load-bearing before the kept ones: a touch below the plane of three surrounding ones stays
/// below it for any tilt.
void keep_low(const std::vector<Touch>& t, const std::vector<int>& patch, std::vector<int>& kept) {
  while (kept.size() < kMostInPatch) {
    double most = kKeepDepthM;
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
  base::Groups groups(count);
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < i; ++j) {
      if (dot(touches[i].normal, touches[j].normal) < kPatchCosine || norm2(touches[i].where_m - touches[j].where_m) > patch_m * patch_m)
        continue;
      groups.join(i, j);
    }
  }
  std::vector<int> patch, kept, of_patch;
  for (int r = 0; r < count; ++r) {
    if (groups.find(r) != r) continue;
    patch.clear();
    for (int i = r; i < count; ++i)
      if (groups.find(i) == r) patch.push_back(i);
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
      t.id = kMovingIdBit | ++memory.serial;
    }
  }
  memory.last = touches;
}

}  // namespace carillon::geometry
