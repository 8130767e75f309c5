#include "precompute/analytic/triangulate.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

#include "runtime/base/error.hpp"

namespace carillon::analytic {
namespace {

using NodePair = std::pair<std::int32_t, std::int32_t>;

long double cross(const Point2& o, const Point2& a, const Point2& b) {
  return (static_cast<long double>(a[0]) - o[0]) * (static_cast<long double>(b[1]) - o[1]) -
         (static_cast<long double>(a[1]) - o[1]) * (static_cast<long double>(b[0]) - o[0]);
}

double calc_length(const Point2& a, const Point2& b) { return std::hypot(b[0] - a[0], b[1] - a[1]); }

/// Cuts off the ear with the largest minimum angle first.
std::vector<Triangle> cut_ears(const std::vector<Point2>& p) {
  std::vector<std::int32_t> ring;
  for (std::size_t i = 0; i < p.size(); ++i) ring.push_back(static_cast<std::int32_t>(i));
  std::vector<Triangle> triangles;
  const auto judge = [&](std::size_t i) -> double {
    const std::int32_t a = ring[(i + ring.size() - 1) % ring.size()], b = ring[i], c = ring[(i + 1) % ring.size()];
    const long double area = cross(p[a], p[b], p[c]);
    if (!(area > 0)) return -1.0;
    for (const std::int32_t v : ring)
      if (v != a && v != b && v != c && cross(p[a], p[b], p[v]) >= 0 && cross(p[b], p[c], p[v]) >= 0 && cross(p[c], p[a], p[v]) >= 0)
        return -1.0;
    const double longest = std::max({calc_length(p[a], p[b]), calc_length(p[b], p[c]), calc_length(p[c], p[a])});
    return static_cast<double>(area) / (longest * longest);
  };
  std::vector<double> quality;  // of the ear at each place of the ring, at its last evaluation
  const auto judge_all = [&] {
    quality.clear();
    for (std::size_t i = 0; i < ring.size(); ++i) quality.push_back(judge(i));
    return std::max_element(quality.begin(), quality.end());
  };
  judge_all();
  while (ring.size() > 3) {
    auto best = std::max_element(quality.begin(), quality.end());
    if (*best < 0.0) best = judge_all();  // blocking corners may have been removed
    if (*best < 0.0) throw InputError("the polygon is too thin to be divided into triangles; move its corners apart");
    const std::size_t at = best - quality.begin();
    const std::size_t n = ring.size();
    triangles.push_back({ring[(at + n - 1) % n], ring[at], ring[(at + 1) % n]});
    ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(at));
    quality.erase(best);
    for (const std::size_t next : {(at + n - 2) % (n - 1), at % (n - 1)}) quality[next] = judge(next);
  }
  triangles.push_back({ring[0], ring[1], ring[2]});
  return triangles;
}

/// The triangle to the left of each directed edge.
std::map<NodePair, std::size_t> list_edges(const std::vector<Triangle>& triangles) {
  std::map<NodePair, std::size_t> edges;
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) edges[{triangles[t][k], triangles[t][(k + 1) % 3]}] = t;
  return edges;
}

double calc_angle(const Point2& tip, const Point2& a, const Point2& b) {
  const double dot = (a[0] - tip[0]) * (b[0] - tip[0]) + (a[1] - tip[1]) * (b[1] - tip[1]);
  return std::atan2(std::abs(static_cast<double>(cross(tip, a, b))), dot);
}

/// Lawson's flips: an inner edge whose opposite angles add up to more than 180 degrees is replaced by the other diagonal, unless that joins
/// two points of `apart`.
void flip_edges(Net& net, const std::vector<bool>& apart) {
  const auto is_marked = [&](std::int32_t v) { return v < std::ssize(apart) && apart[v]; };
  constexpr double kSlack = 1e-9;
  std::map<NodePair, std::size_t> edges = list_edges(net.triangles);
  std::vector<NodePair> work;
  for (const auto& [edge, t] : edges)
    if (edge.first < edge.second) work.push_back(edge);
  const auto third = [&](std::size_t t, const NodePair& e) {
    for (const std::int32_t v : net.triangles[t])
      if (v != e.first && v != e.second) return v;
    return e.first;
  };
  while (!work.empty()) {
    const auto [a, b] = work.back();
    work.pop_back();
    const auto left = edges.find({a, b}), right = edges.find({b, a});
    if (left == edges.end() || right == edges.end()) continue;
    const std::size_t s = left->second, t = right->second;
    const std::int32_t c = third(s, {a, b}), d = third(t, {a, b});
    const auto& p = net.points_m;
    if (calc_angle(p[c], p[a], p[b]) + calc_angle(p[d], p[a], p[b]) <= std::numbers::pi + kSlack) continue;
    if (is_marked(c) && is_marked(d)) continue;
    if (!(cross(p[d], p[b], p[c]) > 0) || !(cross(p[c], p[a], p[d]) > 0)) continue;
    edges.erase(left);
    edges.erase(right);
    net.triangles[s] = {d, b, c};
    net.triangles[t] = {c, a, d};
    for (const std::size_t changed : {s, t})
      for (int k = 0; k < 3; ++k) edges[{net.triangles[changed][k], net.triangles[changed][(k + 1) % 3]}] = changed;
    for (const NodePair& e : {NodePair{a, c}, NodePair{c, b}, NodePair{b, d}, NodePair{d, a}}) work.push_back(e);
  }
}

/// Bisects longest edges, those of neighbours with longer edges first, until no edge is too long and no triangle has two points of `apart`.
void halve_edges(Net& net, double max_edge_m, const std::vector<bool>& apart, std::size_t max_triangles) {
  std::map<NodePair, std::size_t> edges = list_edges(net.triangles);
  const auto longest = [&](std::size_t t) {
    const Triangle& v = net.triangles[t];
    int best = 0;
    double length = -1.0;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t a = std::min(v[k], v[(k + 1) % 3]), b = std::max(v[k], v[(k + 1) % 3]);  // the same for both sides
      if (const double now = calc_length(net.points_m[a], net.points_m[b]); now > length) length = now, best = k;
    }
    return std::pair(best, length);
  };
  const auto is_apart = [&](const Triangle& t) {
    return std::count_if(t.begin(), t.end(), [&](std::int32_t v) { return v < std::ssize(apart) && apart[v]; }) < 2;
  };
  const auto split = [&](std::size_t t, const NodePair& e, std::int32_t middle) {
    const Triangle v = net.triangles[t];
    const int k = static_cast<int>(std::find(v.begin(), v.end(), e.first) - v.begin());
    const std::int32_t tip = v[(k + 2) % 3];
    const std::size_t other = net.triangles.size();
    net.triangles[t] = {e.first, middle, tip};
    net.triangles.push_back({middle, e.second, tip});
    edges.erase(e);
    for (const std::size_t changed : {t, other})
      for (int i = 0; i < 3; ++i) edges[{net.triangles[changed][i], net.triangles[changed][(i + 1) % 3]}] = changed;
  };
  std::vector<std::size_t> work;
  for (std::size_t t = net.triangles.size(); t-- > 0;) work.push_back(t);
  while (!work.empty()) {
    if (const std::size_t t = work.back(); longest(t).second <= max_edge_m && is_apart(net.triangles[t])) {
      work.pop_back();
      continue;
    }
    if (net.triangles.size() > max_triangles)
      throw InputError(
          fmt::format("the polygon takes more than {} triangles; make its narrowest part wider, or lower the end of "
                      "\"band_hz\" or \"max_modes\"",
                      max_triangles));
    // Rivara's path: across longest edges from neighbour to neighbour, to an edge that is the longest on both sides.
    std::size_t t = work.back();
    auto [k, length] = longest(t);
    NodePair e{net.triangles[t][k], net.triangles[t][(k + 1) % 3]};
    auto neighbour = edges.find({e.second, e.first});
    while (neighbour != edges.end() && longest(neighbour->second).second > length * (1.0 + 1e-12)) {
      t = neighbour->second;
      std::tie(k, length) = longest(t);
      e = {net.triangles[t][k], net.triangles[t][(k + 1) % 3]};
      neighbour = edges.find({e.second, e.first});
    }
    const auto middle = static_cast<std::int32_t>(net.points_m.size());
    const Point2 &a = net.points_m[e.first], &b = net.points_m[e.second];
    net.points_m.push_back({0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])});
    const std::size_t first_new = net.triangles.size();
    const std::size_t other = neighbour != edges.end() ? neighbour->second : t;
    split(t, e, middle);
    if (other != t) split(other, {e.second, e.first}, middle);
    for (std::size_t made = first_new; made < net.triangles.size(); ++made) work.push_back(made);
    work.push_back(other);
  }
}

}  // namespace

std::vector<double> calc_angles(const std::vector<Point2>& p) {
  std::vector<double> angles;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const Point2 &before = p[(i + p.size() - 1) % p.size()], &after = p[(i + 1) % p.size()];
    const double angle = std::atan2(before[1] - p[i][1], before[0] - p[i][0]) - std::atan2(after[1] - p[i][1], after[0] - p[i][0]);
    angles.push_back(angle <= 0.0 ? angle + 2.0 * std::numbers::pi : angle);
  }
  return angles;
}

Net triangulate(const std::vector<Point2>& corners_m, double max_edge_m, const std::vector<bool>& apart, std::size_t max_triangles) {
  Net net{corners_m, cut_ears(corners_m)};
  flip_edges(net, {});
  halve_edges(net, max_edge_m, apart, max_triangles);
  flip_edges(net, apart);
  return net;
}

void grade(Net& net, std::int32_t point, int layers, double ratio) {
  std::map<std::int32_t, std::vector<std::int32_t>> spokes;  // points between a neighbour and the centre, from the neighbour on
  const Point2 centre = net.points_m[point];
  const auto get_spoke = [&](std::int32_t end) -> const std::vector<std::int32_t>& {
    std::vector<std::int32_t>& spoke = spokes[end];
    if (!spoke.empty()) return spoke;
    spoke.push_back(end);
    const Point2 far = net.points_m[end];
    double part = 1.0;
    for (int k = 0; k < layers; ++k) {
      part *= ratio;
      spoke.push_back(static_cast<std::int32_t>(net.points_m.size()));
      net.points_m.push_back({centre[0] + part * (far[0] - centre[0]), centre[1] + part * (far[1] - centre[1])});
    }
    return spoke;
  };
  const std::size_t count = net.triangles.size();
  for (std::size_t t = 0; t < count; ++t) {
    const Triangle v = net.triangles[t];
    const auto at = std::find(v.begin(), v.end(), point);
    if (at == v.end()) continue;
    const std::size_t k = at - v.begin();
    const std::vector<std::int32_t> a = get_spoke(v[(k + 1) % 3]), b = get_spoke(v[(k + 2) % 3]);
    net.triangles[t] = {point, a.back(), b.back()};
    for (std::size_t i = 0; i + 1 < a.size(); ++i) {
      net.triangles.push_back({a[i], b[i], b[i + 1]});
      net.triangles.push_back({a[i], b[i + 1], a[i + 1]});
    }
  }
}

}  // namespace carillon::analytic
