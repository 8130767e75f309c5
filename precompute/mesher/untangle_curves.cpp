// Method: curves end where they turn back; segments are sorted along an axis and compared where their boxes overlap.
// Source: segment distance: Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
#include "precompute/mesher/untangle_curves.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace carillon::mesher {
namespace {

// Sine of 1.7 degrees: curves that leave their common end at a smaller angle would need thousands of balls.
constexpr double kMinDirectionSine = 0.03;

struct Segment {
  Vec3 a{}, b{};
  std::size_t curve = 0, index = 0;
};

double calc_length(const Polyline& curve) {
  double length = 0;
  for (std::size_t i = 1; i < curve.size(); ++i) length += norm(curve[i] - curve[i - 1]);
  return length;
}

/// Distance of two segments.
double calc_distance(const Segment& s, const Segment& t) {
  const Vec3 u = s.b - s.a, v = t.b - t.a, w = s.a - t.a;
  const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), uw = dot(u, w), vw = dot(v, w);
  const double square = uu * vv - uv * uv;
  double x = square > 1e-12 * uu * vv ? std::clamp((uv * vw - vv * uw) / square, 0.0, 1.0) : 0;
  double y = vv > 0 ? (uv * x + vw) / vv : 0;
  if (y < 0 || y > 1) {
    y = std::clamp(y, 0.0, 1.0);
    x = uu > 0 ? std::clamp((uv * y - uw) / uu, 0.0, 1.0) : 0;
  }
  return norm(w + x * u - y * v);
}

/// True if the segments touch other than at a common end, or overlap from it.
bool is_tangled(const Segment& s, const Segment& t, double same_m) {
  const bool ends[4] = {s.a == t.a, s.a == t.b, s.b == t.a, s.b == t.b};
  const int common = ends[0] + ends[1] + ends[2] + ends[3];
  if (common > 1) return true;
  if (common == 0) return calc_distance(s, t) <= same_m;
  const Vec3 u = ends[0] || ends[1] ? s.b - s.a : s.a - s.b, v = ends[0] || ends[2] ? t.b - t.a : t.a - t.b;
  return dot(u, v) > 0 && norm(cross(u, v)) <= kMinDirectionSine * norm(u) * norm(v);
}

/// Points in order, none closer than same_m to its predecessor; ends stay.
Polyline thin_out(const Polyline& curve, double same_m) {
  Polyline out{curve.front()};
  for (std::size_t i = 1; i < curve.size(); ++i) {
    const bool last = i + 1 == curve.size();
    if (norm(curve[i] - out.back()) > same_m)
      out.push_back(curve[i]);
    else if (last && out.size() > 1)
      out.back() = curve[i];
  }
  return out;
}

/// True if the curve turns back at b: protecting balls on both sides of such a bend shrink without end, unless one is centred on it.
bool turns_back(const Vec3& a, const Vec3& b, const Vec3& c) { return dot(b - a, c - b) < 0; }

/// Pieces of the curve between turn-back points; a closed one begins at such a bend and has at least two pieces.
std::vector<Polyline> split_at_bends(Polyline curve) {
  if (curve.size() > 3 && curve.front() == curve.back() && !turns_back(curve[curve.size() - 2], curve[0], curve[1]))
    for (std::size_t i = 1; i + 1 < curve.size(); ++i)
      if (turns_back(curve[i - 1], curve[i], curve[i + 1])) {
        curve.pop_back();
        std::rotate(curve.begin(), curve.begin() + static_cast<std::ptrdiff_t>(i), curve.end());
        curve.push_back(curve.front());
        break;
      }
  const bool closed = curve.size() > 3 && curve.front() == curve.back() && turns_back(curve[curve.size() - 2], curve[0], curve[1]);
  std::vector<Polyline> out{{curve.front()}};
  for (std::size_t i = 1; i < curve.size(); ++i) {
    out.back().push_back(curve[i]);
    const bool last = i + 1 == curve.size();
    if (!last && (turns_back(curve[i - 1], curve[i], curve[i + 1]) || (closed && i == curve.size() / 2))) out.push_back({curve[i]});
  }
  return out;
}

}  // namespace

std::vector<Polyline> untangle_curves(std::vector<Polyline> curves, double same_m) {
  std::vector<Vec3*> ends;
  for (Polyline& curve : curves) ends.insert(ends.end(), {&curve.front(), &curve.back()});
  std::sort(ends.begin(), ends.end(), [](const Vec3* a, const Vec3* b) { return *a < *b; });
  for (std::size_t i = 0; i < ends.size(); ++i)
    for (std::size_t j = i + 1; j < ends.size() && (*ends[j])[0] - (*ends[i])[0] <= same_m; ++j)
      if (norm(*ends[j] - *ends[i]) <= same_m) *ends[j] = *ends[i];
  std::vector<Polyline> pieces;
  for (const Polyline& curve : curves) {
    auto split = split_at_bends(thin_out(curve, same_m));
    std::move(split.begin(), split.end(), std::back_inserter(pieces));
  }
  curves = std::move(pieces);
  std::erase_if(curves, [](const Polyline& curve) { return curve.size() < 2 || (curve.front() == curve.back() && curve.size() < 4); });

  std::vector<Segment> segments;
  std::vector<double> lengths;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    lengths.push_back(calc_length(curves[c]));
    for (std::size_t i = 0; i + 1 < curves[c].size(); ++i) segments.push_back({curves[c][i], curves[c][i + 1], c, i});
  }
  const auto low = [](const Segment& s, int c) { return std::min(s.a[c], s.b[c]); };
  const auto high = [](const Segment& s, int c) { return std::max(s.a[c], s.b[c]); };
  // Sorted along the longest side of their box: all curves in a plane normal to it would overlap.
  Vec3 lowest{1e300, 1e300, 1e300}, highest{-1e300, -1e300, -1e300};
  for (const Segment& s : segments)
    for (int c = 0; c < 3; ++c) lowest[c] = std::min(lowest[c], low(s, c)), highest[c] = std::max(highest[c], high(s, c));
  const Vec3 extent = highest - lowest;
  const int axis = static_cast<int>(std::max_element(extent.begin(), extent.end()) - extent.begin());
  std::vector<std::size_t> order(segments.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return std::pair(low(segments[a], axis), a) < std::pair(low(segments[b], axis), b); });
  std::vector<std::pair<std::size_t, std::size_t>> tangles;
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size() && low(segments[order[j]], axis) <= high(segments[order[i]], axis) + same_m; ++j) {
      const Segment &s = segments[order[i]], &t = segments[order[j]];
      bool apart = false;
      for (int c = 0; c < 3; ++c) apart = apart || low(s, c) > high(t, c) + same_m || low(t, c) > high(s, c) + same_m;
      if (!apart && is_tangled(s, t, same_m)) tangles.emplace_back(std::min(s.curve, t.curve), std::max(s.curve, t.curve));
    }
  std::sort(tangles.begin(), tangles.end());
  std::vector<char> drop(curves.size(), 0);
  for (const auto& [one, other] : tangles)
    if (!drop[one] && !drop[other]) drop[lengths[one] < lengths[other] ? one : other] = 1;
  std::vector<Polyline> out;
  for (std::size_t c = 0; c < curves.size(); ++c)
    if (!drop[c]) out.push_back(std::move(curves[c]));
  return out;
}

}  // namespace carillon::mesher
