// Method: each curve is sampled; the least distance of a sample to curves without a common end bounds the edges there. Longer edges would
//   make protecting balls overlap, and the mesher would shrink them repeatedly.
// Source: the condition on protecting balls in Cheng, Dey and Ramos, "Delaunay refinement for piecewise smooth complexes", SODA 2007.
#include "precompute/mesher/curve_sizes.hpp"

#include <algorithm>
#include <cmath>

namespace carillon::mesher {
namespace {

// The edge length is the ball radius, so facing balls need twice that between their centres.
constexpr double kSizePerGap = 0.45;
constexpr double kGrowth = 0.5;
constexpr double kMaxSamples = 4000;
// Two points on one curve conflict if their arc length is this many times their distance.
constexpr double kHairpin = 4;

struct Segment {
  Vec3 a{}, b{};
  std::size_t curve = 0;
  double start_m = 0;  // arc length along its curve
};

double calc_distance(const Vec3& p, const Segment& s, double& along_m) {
  const Vec3 direction = s.b - s.a;
  const double square = dot(direction, direction);
  const double t = square > 0 ? std::clamp(dot(p - s.a, direction) / square, 0.0, 1.0) : 0;
  along_m = s.start_m + t * std::sqrt(square);
  return norm(p - (s.a + t * direction));
}

bool share_end(const Polyline& a, const Polyline& b) {
  return a.front() == b.front() || a.front() == b.back() || a.back() == b.front() || a.back() == b.back();
}

}  // namespace

std::vector<SizedPoint> calc_curve_sizes(const std::vector<Polyline>& curves, double edge_m) {
  std::vector<Segment> segments;
  std::vector<double> lengths;
  double total = 0;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    double length = 0;
    for (std::size_t i = 1; i < curves[c].size(); ++i) {
      segments.push_back({curves[c][i - 1], curves[c][i], c, length});
      length += norm(curves[c][i] - curves[c][i - 1]);
    }
    lengths.push_back(length);
    total += length;
  }
  const double spacing = std::max(0.5 * edge_m, total / kMaxSamples);
  std::vector<char> apart(curves.size());
  std::vector<SizedPoint> narrow;
  std::size_t next = 0;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    for (std::size_t other = 0; other < curves.size(); ++other) apart[other] = other != c && !share_end(curves[c], curves[other]);
    for (; next < segments.size() && segments[next].curve == c; ++next) {
      const Segment& s = segments[next];
      const double length = norm(s.b - s.a);
      const int pieces = std::max(1, static_cast<int>(std::ceil(length / spacing)));
      for (int k = 0; k <= pieces; ++k) {
        const Vec3 p = s.a + (static_cast<double>(k) / pieces) * (s.b - s.a);
        const double here = s.start_m + length * k / pieces;
        double gap = 1e300, along = 0;
        for (const Segment& other : segments) {
          if (other.curve != c && !apart[other.curve]) continue;
          const double distance = calc_distance(p, other, along);
          double way = std::abs(along - here);
          if (curves[c].front() == curves[c].back()) way = std::min(way, lengths[c] - way);
          if (other.curve == c && !(way > kHairpin * distance && way > 1e-9 * total)) continue;
          if (distance > 0) gap = std::min(gap, distance);
        }
        if (kSizePerGap * gap < edge_m) narrow.push_back({p, kSizePerGap * gap});
      }
    }
  }
  return narrow;
}

double calc_distance(const std::vector<Polyline>& curves, const Vec3& p) {
  double least = HUGE_VAL, along = 0;
  for (const Polyline& curve : curves)
    for (std::size_t i = 1; i < curve.size(); ++i) least = std::min(least, calc_distance(p, {curve[i - 1], curve[i], 0, 0}, along));
  return least;
}

double calc_size(const std::vector<SizedPoint>& narrow, double edge_m, const Vec3& p) {
  double size = edge_m;
  for (const SizedPoint& n : narrow) {
    if (n.size_m >= size) continue;
    size = std::min(size, n.size_m + kGrowth * norm(p - n.place));
  }
  return size;
}

}  // namespace carillon::mesher
