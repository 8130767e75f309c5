// One triangulation, whose points, edges and stars every operation changes together; longer than most files.
// Method: edges are split where they are longer than 4/3 of the wanted length and collapsed where shorter than 4/5; edges are flipped
//   towards six triangles at a point; points are moved within the tangent plane to the middle of their neighbours and put back on the
//   surface; in the end edges are flipped until every pair of triangles is Delaunay. The wanted length follows the curvature of the
//   triangles themselves, so that what is smaller than they are is not seen, and changes slowly.
// Source: Botsch and Kobbelt, "A remeshing approach to multiresolution modeling", SGP 2004; Max, "Weights for computing vertex normals from
//   facet normals", J. Graphics Tools 4(2), 1999.
// Deviations: theirs has one length; points on folds move along them, and a collapse may not turn a triangle.
#include "precompute/mesher/skin.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <unordered_map>
#include <unordered_set>

#include "precompute/mesh/parts.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesher {
namespace {

constexpr double kLong = 4.0 / 3, kShort = 4.0 / 5;
constexpr int kSweeps = 8;
constexpr double kGrowth = 0.4;       // of the wanted length, per length
constexpr double kBendDeg = 40;       // a fold that bends by more has a corner
constexpr double kMaxTurn = 0.5;      // cosine: a collapse or a move may not turn a triangle by more
constexpr double kMaxFlipTurn = 0.7;  // cosine, between the triangles before and after a flip
constexpr double kMaxTilt = 0.35;     // of the normal at a border, radians
constexpr double kSpeck = 0.02;       // of the wanted length's square: twice the area of a triangle that has no normal of its own
constexpr double kMinRingPart = 0.15, kMaxRingPart = 0.75;  // of edges at rings
constexpr double kFlatFold = 0.98, kPerMitre = 1.3;         // a fold that takes nothing; edges over what its mitre takes
constexpr double kRoom = 0.13, kRoomShape = 0.1;            // of a triangle between the mitres of folds, see make_room()
constexpr double kMinHeight = 0.02;                         // of a triangle's longest edge: flatter ones have no normal

using EdgeSet = std::unordered_set<Edge, EdgeHash>;

/// Folds and borders.
EdgeSet find_features(const Skin& skin) {
  EdgeSet features;
  for (const auto& [a, b] : skin.folds) features.insert(make_edge(a, b));
  for (const auto& [a, b] : find_border(skin.surface)) features.insert(make_edge(a, b));
  return features;
}

class Remesher {
 public:
  Remesher(const Skin& skin, const SkinSizes& sizes, const SkinPlaces& places)
      : x_(skin.surface.points),
        t_(skin.surface.triangles),
        star_(x_.size()),
        features_(find_features(skin)),
        sizes_(sizes),
        places_(places) {
    for (std::size_t f = 0; f < t_.size(); ++f)
      for (const std::int32_t v : t_[f]) star_[v].push_back(static_cast<std::int32_t>(f));
    for (const auto& [a, b] : find_border(skin.surface)) border_.insert(make_edge(a, b));
    size_.assign(x_.size(), sizes.largest_m);
    find_kinds();
  }

  Skin run() {
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      find_sizes();
      split_long();
      collapse_short();
      flip_to_valence();
      for (int n = 0; n < 3; ++n) relax();
    }
    collapse_short();
    part_chords();
    flip_to_delaunay();
    relax();
    flip_to_delaunay();
    return get();
  }

  Skin add_rings(const RingDistance& distance_m) {
    part_chords();
    std::vector<Edge> cut;
    for (const auto& [a, b] : list_edges()) {
      if (features_.contains(make_edge(a, b)) || (kind_[a] == 0) == (kind_[b] == 0)) continue;
      cut.push_back(kind_[a] != 0 ? Edge{a, b} : Edge{b, a});
    }
    std::unordered_map<std::int32_t, std::vector<std::int32_t>> along;
    for (const auto& [a, b] : features_) {
      along[a].push_back(b);
      along[b].push_back(a);
    }
    struct Leaving : LeavingEdge {
      double distance = 0;
    };
    // Of the edge from a to b: each fold at a that it leaves by less than a right angle, and how far its ring is.
    const auto list_leaving = [&](std::int32_t a, std::int32_t b) {
      const Vec3 way = calc_unit(x_[b] - x_[a]);
      std::vector<Leaving> leaving;
      for (const std::int32_t c : along[a]) {
        const Vec3 side = calc_unit(x_[c] - x_[a]);
        const double cosine = dot(side, way);
        const Vec3 across = calc_unit(way - cosine * side);
        if (cosine > 0) leaving.push_back({{a, way, across, std::max(std::sqrt(std::max(1 - cosine * cosine, 0.0)), kMinSine)}});
      }
      if (leaving.empty()) leaving.push_back({{a, way, way, 1}});
      for (Leaving& one : leaving) one.distance = distance_m(one);
      return leaving;
    };
    // What lies between fold and ring is moved out to the ring.
    for (int round = 0; round < 2; ++round)
      for (const auto& [a, b] : cut)
        for (const Leaving& leaving : list_leaving(a, b)) {
          const double gap = leaving.distance - norm(x_[b] - x_[a]) * leaving.sine;
          if (!(gap > 0)) continue;
          const Vec3 p = places_.on_surface(x_[b] + gap * leaving.across);
          if (keeps_sides(b, -1, p)) x_[b] = p;
        }
    for (const auto& [a, b] : cut) {
      double part = 0;
      for (const Leaving& leaving : list_leaving(a, b)) part = std::max(part, leaving.distance / (norm(x_[b] - x_[a]) * leaving.sine));
      if (part < kMinRingPart || part > kMaxRingPart) continue;
      split(a, b, places_.on_surface(x_[a] + part * (x_[b] - x_[a])));
    }
    return get();
  }

  Skin make_room(const std::vector<Vec3>& ways, const std::array<double, 2>& levels_m) {
    constexpr int kRounds = 12;
    // How much smaller one copy of a triangle is than the other, negative where it is folded over, and no better than its shape.
    const auto rate = [&](const Triangle& t, std::int32_t v, const Vec3& p) {
      std::array<Vec3, 3> x;
      for (int c = 0; c < 3; ++c) x[c] = t[c] == v ? p : x_[t[c]];
      const Vec3 normal = calc_unit(cross(x[1] - x[0], x[2] - x[0]));
      double longest = 0, least = HUGE_VAL, most = 0;
      for (int c = 0; c < 3; ++c) longest = std::max(longest, norm(x[(c + 1) % 3] - x[c]));
      for (const double level : levels_m) {
        const auto at = [&](int c) { return x[c] + level * ways[static_cast<std::size_t>(t[c])]; };
        const double area = dot(cross(at(1) - at(0), at(2) - at(0)), normal);
        least = std::min(least, area);
        most = std::max(most, std::abs(area));
      }
      return most > 0 ? least / std::max(most, kRoomShape * longest * longest) : 0.0;
    };
    const auto rate_star = [&](std::int32_t v, const Vec3& p) {
      double least = HUGE_VAL;
      for (const std::int32_t f : star_[v]) least = std::min(least, rate(t_[f], v, p));
      return least;
    };
    // In turn: narrow triangles take the other diagonal, then their points move to where the narrowest around them is widest.
    for (int round = 0; round < kRounds; ++round) {
      for (const auto& [a, b] : list_edges()) {
        std::array<std::int32_t, 2> faces{};
        if (features_.contains(make_edge(a, b)) || find_faces(a, b, faces) != 2) continue;
        const std::int32_t c = find_third(faces[0], a, b), d = find_third(faces[1], a, b);
        if (kind_[c] != 0 && kind_[d] != 0) continue;  // no edge from fold to fold
        const double before = std::min(rate(t_[faces[0]], -1, {}), rate(t_[faces[1]], -1, {}));
        if (before > kRoom || !flip(a, b, faces)) continue;
        if (std::min(rate(t_[faces[0]], -1, {}), rate(t_[faces[1]], -1, {})) > before) continue;
        std::array<std::int32_t, 2> back{};
        if (find_faces(c, d, back) == 2) flip(c, d, back);
      }
      bool again = false;
      for (std::int32_t v = 0; v < static_cast<std::int32_t>(x_.size()); ++v) {
        if (star_[v].empty() || kind_[v] == 2) continue;
        double best = rate_star(v, x_[v]);
        if (best > kRoom) continue;
        double reach = HUGE_VAL;
        Vec3 normal{};
        std::vector<Vec3> ends;  // along the fold
        for (const std::int32_t f : star_[v]) {
          normal = normal + calc_area(t_[f]);
          for (const std::int32_t w : t_[f]) {
            if (w == v) continue;
            reach = std::min(reach, norm(x_[w] - x_[v]));
            if (features_.contains(make_edge(v, w))) ends.push_back(x_[w]);
          }
        }
        std::vector<Vec3> ways_to;  // unit
        if (kind_[v] == 1) {
          for (const Vec3& end : ends) ways_to.push_back(calc_unit(end - x_[v]));
        } else {
          normal = calc_unit(normal);
          const Vec3 along = calc_unit(cross(normal, std::abs(normal[0]) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
          const Vec3 across = cross(normal, along);
          for (int n = 0; n < 12; ++n)
            ways_to.push_back(std::cos(n * std::numbers::pi / 6) * along + std::sin(n * std::numbers::pi / 6) * across);
        }
        Vec3 found = x_[v];
        for (const double part : {0.9, 0.5, 0.25, 0.1, 0.03})
          for (const Vec3& way : ways_to) {
            const Vec3 p = place(x_[v] + (part * reach) * way, kind_[v] == 1);
            const double now = rate_star(v, p);
            if (now > best + 1e-3 && keeps_sides(v, -1, p)) best = now, found = p;
          }
        again = again || norm(found - x_[v]) > 0;
        x_[v] = found;
      }
      if (!again) break;
    }
    return get();
  }

 private:
  bool has(std::int32_t f, std::int32_t v) const { return t_[f][0] == v || t_[f][1] == v || t_[f][2] == v; }

  /// The triangles of an edge.
  int find_faces(std::int32_t a, std::int32_t b, std::array<std::int32_t, 2>& faces) const {
    int count = 0;
    for (const std::int32_t f : star_[a])
      if (has(f, b) && count < 2) faces[count++] = f;
    return count;
  }

  std::int32_t find_third(std::int32_t f, std::int32_t a, std::int32_t b) const {
    for (const std::int32_t v : t_[f])
      if (v != a && v != b) return v;
    return -1;
  }

  Vec3 calc_area(const Triangle& t) const { return cross(x_[t[1]] - x_[t[0]], x_[t[2]] - x_[t[0]]); }

  std::vector<Edge> list_edges() const {
    std::vector<Edge> edges;
    for (const Triangle& t : t_) {
      if (t[0] < 0) continue;
      for (int c = 0; c < 3; ++c) {
        const std::int32_t a = t[c], b = t[(c + 1) % 3];
        if (a < b || border_.contains(make_edge(a, b))) edges.push_back(make_edge(a, b));
      }
    }
    return edges;
  }

  /// Of each point: 0 inside, 1 on a fold, 2 where folds end, bend or meet.
  void find_kinds() {
    std::unordered_map<std::int32_t, std::vector<std::int32_t>> along;
    for (const auto& [a, b] : features_) {
      along[a].push_back(b);
      along[b].push_back(a);
    }
    kind_.assign(x_.size(), 0);
    for (const auto& [v, others] : along) {
      kind_[v] = 2;
      if (others.size() != 2) continue;
      const bool one = border_.contains(make_edge(v, others[0])), two = border_.contains(make_edge(v, others[1]));
      const Vec3 in = calc_unit(x_[v] - x_[others[0]]), out = calc_unit(x_[others[1]] - x_[v]);
      if (one == two && dot(in, out) > std::cos(kBendDeg * std::numbers::pi / 180)) kind_[v] = 1;
    }
  }

  void find_sizes() {
    Skin now = get();  // the numbers change; number_ has the new ones
    const auto normals = find_skin_normals(now);
    std::vector<double> bend(now.surface.points.size(), 0), weight(bend.size(), 0);
    for (std::size_t f = 0; f < normals.size(); ++f)
      for (int c = 0; c < 3; ++c) {
        const std::int32_t a = now.surface.triangles[f][c], b = now.surface.triangles[f][(c + 1) % 3];
        const Vec3 way = now.surface.points[b] - now.surface.points[a];
        const double square = dot(way, way);
        if (!(square > 0)) continue;
        const double curvature = std::abs(dot(normals[f][(c + 1) % 3] - normals[f][c], way)) / square;
        bend[a] = std::max(bend[a], curvature);
        bend[b] = std::max(bend[b], curvature);
      }
    // One point more tightly bent than all around it is noise.
    std::vector<double> mean(bend.size(), 0);
    for (const Triangle& t : now.surface.triangles)
      for (int c = 0; c < 3; ++c) {
        mean[t[c]] += bend[t[(c + 1) % 3]] + bend[t[(c + 2) % 3]];
        weight[t[c]] += 2;
      }
    std::vector<double> size(bend.size());
    for (std::size_t v = 0; v < bend.size(); ++v) {
      const double curvature = weight[v] > 0 ? std::min(bend[v], 1.3 * mean[v] / weight[v]) : bend[v];
      size[v] = std::clamp(curvature > 0 ? sizes_.per_radius / curvature : sizes_.largest_m, sizes_.smallest_m, sizes_.largest_m);
    }
    for (int sweep = 0; sweep < 10; ++sweep)
      for (const Triangle& t : now.surface.triangles)
        for (int c = 0; c < 3; ++c) {
          const std::int32_t a = t[c], b = t[(c + 1) % 3];
          const double step = kGrowth * norm(now.surface.points[b] - now.surface.points[a]);
          size[a] = std::min(size[a], size[b] + step);
          size[b] = std::min(size[b], size[a] + step);
        }
    if (sizes_.reach_m > 0) widen_folds(now, size);
    for (std::size_t v = 0; v < x_.size(); ++v)
      if (number_[v] >= 0) size_[v] = size[number_[v]];
  }

  /// Points that the mitre of a fold would push past each other are not wanted.
  void widen_folds(const Skin& now, std::vector<double>& size) const {
    std::unordered_map<Edge, Vec3, EdgeHash> first;
    std::vector<double> least(size.size(), 0);
    EdgeSet folds;
    for (const auto& [a, b] : now.folds) folds.insert(make_edge(a, b));
    const auto& p = now.surface.points;
    for (const Triangle& t : now.surface.triangles)
      for (int c = 0; c < 3; ++c) {
        const std::int32_t a = t[c], b = t[(c + 1) % 3];
        if (!folds.contains(make_edge(a, b))) continue;
        const Vec3 normal = calc_unit(cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]));
        const auto [found, fresh] = first.try_emplace(make_edge(a, b), normal);
        if (fresh) continue;
        const double cosine = std::clamp(dot(normal, found->second), -0.99, 1.0);
        const double takes = sizes_.reach_m * std::sqrt((1 - cosine) / (1 + cosine)) + sizes_.margin_m;
        if (cosine > kFlatFold) continue;
        for (const std::int32_t v : {a, b}) least[v] = std::max(least[v], kPerMitre * takes);
      }
    for (int sweep = 0; sweep < 3; ++sweep)
      for (const Triangle& t : now.surface.triangles)
        for (int c = 0; c < 3; ++c)
          for (const int side : {1, 2}) {
            const std::int32_t a = t[c], b = t[(c + side) % 3];
            const double way = norm(p[b] - p[a]);
            // As far as the mitre reaches the edges stay as long; then they shorten.
            least[b] = std::max(least[b], least[a] - kGrowth * std::max(way - 0.5 * least[a], 0.0) - (way > least[a] ? way : 0));
          }
    for (std::size_t v = 0; v < size.size(); ++v) size[v] = std::max(size[v], least[v]);
  }

  double calc_wanted(std::int32_t a, std::int32_t b) const { return 0.5 * (size_[a] + size_[b]); }

  void replace(std::int32_t f, std::int32_t from, std::int32_t to) {
    for (std::int32_t& v : t_[f])
      if (v == from) v = to;
  }

  std::int32_t split(std::int32_t a, std::int32_t b, const Vec3& at) {
    const auto m = static_cast<std::int32_t>(x_.size());
    std::array<std::int32_t, 2> faces{};
    const int count = find_faces(a, b, faces);
    x_.push_back(at);
    size_.push_back(calc_wanted(a, b));
    star_.emplace_back();
    const bool is_feature = features_.erase(make_edge(a, b)) > 0;
    if (is_feature) features_.insert({make_edge(a, m), make_edge(m, b)});
    if (border_.erase(make_edge(a, b)) > 0) border_.insert({make_edge(a, m), make_edge(m, b)});
    kind_.push_back(is_feature ? 1 : 0);
    for (int n = 0; n < count; ++n) {
      const std::int32_t f = faces[n], c = find_third(f, a, b), g = static_cast<std::int32_t>(t_.size());
      Triangle other = t_[f];
      for (std::int32_t& v : other)
        if (v == a) v = m;
      t_.push_back(other);
      replace(f, b, m);
      std::erase(star_[b], f);
      star_[b].push_back(g);
      star_[c].push_back(g);
      star_[m].push_back(f);
      star_[m].push_back(g);
    }
    return m;
  }

  Vec3 place(const Vec3& p, bool is_feature) const { return is_feature ? places_.on_fold(p) : places_.on_surface(p); }

  void split_long() {
    for (int round = 0; round < 12; ++round) {
      std::vector<std::pair<double, Edge>> edges;
      for (const Edge& e : list_edges()) {
        const double part = norm(x_[e[1]] - x_[e[0]]) / calc_wanted(e[0], e[1]);
        if (part > kLong) edges.emplace_back(part, e);
      }
      if (edges.empty()) return;
      std::sort(edges.begin(), edges.end(),
                [](const auto& p, const auto& q) { return p.first != q.first ? p.first > q.first : p.second < q.second; });
      // The longest of its triangles only, so that their shape stays.
      std::vector<char> busy(t_.size(), 0);
      for (const auto& [part, e] : edges) {
        std::array<std::int32_t, 2> faces{};
        const int count = find_faces(e[0], e[1], faces);
        bool is_free = count > 0;
        for (int n = 0; n < count; ++n) is_free = is_free && busy[faces[n]] == 0;
        if (!is_free) continue;
        for (int n = 0; n < count; ++n) busy[faces[n]] = 1;
        split(e[0], e[1], place(0.5 * (x_[e[0]] + x_[e[1]]), features_.contains(make_edge(e[0], e[1]))));
        busy.resize(t_.size(), 1);
      }
    }
  }

  /// Whether the triangles at v but those with `other` keep their sides if v moves to p.
  bool keeps_sides(std::int32_t v, std::int32_t other, const Vec3& p) const {
    Vec3 mean{};
    double wanted = HUGE_VAL;
    for (const std::int32_t w : {v, other >= 0 ? other : v}) {
      for (const std::int32_t f : star_[w]) mean = mean + calc_area(t_[f]);
      wanted = std::min(wanted, size_[w]);
    }
    for (const std::int32_t f : star_[v]) {
      if (other >= 0 && has(f, other)) continue;
      Triangle t = t_[f];
      const Vec3 before = calc_area(t);
      std::array<Vec3, 3> q;
      for (int c = 0; c < 3; ++c) q[c] = t[c] == v ? p : x_[t[c]];
      const Vec3 after = cross(q[1] - q[0], q[2] - q[0]);
      const auto calc_longest = [](const Vec3& a, const Vec3& b, const Vec3& c) {
        return std::max({norm(b - a), norm(c - b), norm(a - c)});
      };
      const double longest = calc_longest(q[0], q[1], q[2]), longest_before = calc_longest(x_[t[0]], x_[t[1]], x_[t[2]]);
      const double height = norm(after) / (longest * longest), height_before = norm(before) / (longest_before * longest_before);
      // Flat ones, which have no normal, may stay flat but not become so.
      if (!(height > std::min(kMinHeight, 0.5 * height_before))) return false;
      if (height < kMinHeight) continue;
      // A triangle far smaller than wanted has the noise of its corners for a normal: the others around it decide.
      const Vec3& side = norm(before) > kSpeck * wanted * wanted ? before : mean;
      if (dot(side, after) < kMaxTurn * norm(side) * norm(after)) return false;
    }
    return true;
  }

  bool collapse(std::int32_t a, std::int32_t b) {  // b goes
    if (kind_[b] > kind_[a]) std::swap(a, b);
    const bool is_feature = features_.contains(make_edge(a, b));
    if (kind_[b] == 2 || (kind_[b] == 1 && !is_feature)) return false;
    std::array<std::int32_t, 2> faces{};
    const int count = find_faces(a, b, faces);
    if (count == 0) return false;
    std::vector<std::int32_t> around_a, common;
    for (const std::int32_t f : star_[a])
      for (const std::int32_t v : t_[f])
        if (v != a) around_a.push_back(v);
    std::sort(around_a.begin(), around_a.end());
    for (const std::int32_t f : star_[b])
      for (const std::int32_t v : t_[f])
        if (v != a && v != b && std::binary_search(around_a.begin(), around_a.end(), v)) common.push_back(v);
    std::sort(common.begin(), common.end());
    common.erase(std::unique(common.begin(), common.end()), common.end());
    if (static_cast<int>(common.size()) != count) return false;
    // A fold may not lose its second side, nor two folds become one.
    for (int n = 0; n < count; ++n) {
      const std::int32_t c = find_third(faces[n], a, b);
      if (star_[c].size() <= 3 && kind_[c] == 0) return false;
      if (features_.contains(make_edge(b, c)) && features_.contains(make_edge(a, c))) return false;
      if (features_.contains(make_edge(b, c)) && !is_feature) return false;
    }
    const Vec3 p = kind_[a] == kind_[b] ? place(0.5 * (x_[a] + x_[b]), is_feature) : x_[a];
    for (const std::int32_t v : {a, b})
      for (const std::int32_t f : star_[v])
        for (const std::int32_t w : t_[f])
          if (w != a && w != b && norm(x_[w] - p) > kLong * calc_wanted(w, a)) return false;
    if (!keeps_sides(a, b, p) || !keeps_sides(b, a, p)) return false;
    std::vector<std::int32_t> chained;  // on the fold beyond b
    if (is_feature)
      for (const std::int32_t f : star_[b])
        for (const std::int32_t w : t_[f])
          if (w != a && w != b && features_.contains(make_edge(b, w))) chained.push_back(w);
    const bool was_border = border_.contains(make_edge(a, b));
    features_.erase(make_edge(a, b));
    border_.erase(make_edge(a, b));
    for (const std::int32_t w : chained) {
      if (features_.erase(make_edge(b, w)) > 0) features_.insert(make_edge(a, w));
      if (border_.erase(make_edge(b, w)) > 0 && was_border) border_.insert(make_edge(a, w));
    }
    for (int n = 0; n < count; ++n) {
      const std::int32_t f = faces[n];
      for (const std::int32_t v : t_[f]) std::erase(star_[v], f);
      t_[f] = {-1, -1, -1};
    }
    for (const std::int32_t f : star_[b]) {
      replace(f, b, a);
      star_[a].push_back(f);
    }
    star_[b].clear();
    x_[a] = p;
    return true;
  }

  void collapse_short() {
    for (int round = 0; round < 6; ++round) {
      std::vector<std::pair<double, Edge>> edges;
      for (const Edge& e : list_edges()) {
        const double part = norm(x_[e[1]] - x_[e[0]]) / calc_wanted(e[0], e[1]);
        if (part < kShort) edges.emplace_back(part, e);
      }
      std::sort(edges.begin(), edges.end());
      std::size_t done = 0;
      for (const auto& [part, e] : edges) {
        if (star_[e[0]].empty() || star_[e[1]].empty()) continue;
        std::array<std::int32_t, 2> faces{};
        if (find_faces(e[0], e[1], faces) == 0) continue;
        if (norm(x_[e[1]] - x_[e[0]]) < kShort * calc_wanted(e[0], e[1])) done += collapse(e[0], e[1]);
      }
      if (done == 0) return;
    }
  }

  bool has_edge(std::int32_t a, std::int32_t b) const {
    return std::any_of(star_[a].begin(), star_[a].end(), [&](std::int32_t f) { return has(f, b); });
  }

  /// The edge a b of two triangles becomes the one between their other corners, if those lie so that the surface stays.
  bool flip(std::int32_t a, std::int32_t b, const std::array<std::int32_t, 2>& faces) {
    const std::int32_t c = find_third(faces[0], a, b), d = find_third(faces[1], a, b);
    if (c == d || has_edge(c, d)) return false;
    // faces[0] runs a b c or b a c.
    const Triangle& t = t_[faces[0]];
    const bool forth = (t[0] == a && t[1] == b) || (t[1] == a && t[2] == b) || (t[2] == a && t[0] == b);
    const Triangle one = forth ? Triangle{a, d, c} : Triangle{a, c, d}, two = forth ? Triangle{b, c, d} : Triangle{b, d, c};
    const Vec3 n0 = calc_area(t_[faces[0]]), n1 = calc_area(t_[faces[1]]), m0 = calc_area(one), m1 = calc_area(two);
    const Vec3 before = n0 + n1;
    for (const Vec3& m : {m0, m1})
      if (!(dot(m, before) > kMaxFlipTurn * norm(m) * norm(before))) return false;
    const double longest =
        std::max({norm(x_[c] - x_[d]), norm(x_[a] - x_[c]), norm(x_[b] - x_[c]), norm(x_[a] - x_[d]), norm(x_[b] - x_[d])});
    if (std::min(norm(m0), norm(m1)) < kMinHeight * longest * longest) return false;
    t_[faces[0]] = one;
    t_[faces[1]] = two;
    std::erase(star_[b], faces[0]);
    std::erase(star_[a], faces[1]);
    star_[d].push_back(faces[0]);
    star_[c].push_back(faces[1]);
    return true;
  }

  void flip_to_valence() {
    const auto calc_excess = [&](std::int32_t v, int change) {
      bool on_border = false;
      if (kind_[v] != 0)
        for (const std::int32_t f : star_[v])
          for (const std::int32_t w : t_[f]) on_border = on_border || (w != v && border_.contains(make_edge(v, w)));
      const int valence = static_cast<int>(star_[v].size()) + (on_border ? 1 : 0) + change - (on_border ? 4 : 6);
      return valence * valence;
    };
    for (const auto& [a, b] : list_edges()) {
      if (features_.contains(make_edge(a, b))) continue;
      std::array<std::int32_t, 2> faces{};
      if (find_faces(a, b, faces) != 2) continue;
      const std::int32_t c = find_third(faces[0], a, b), d = find_third(faces[1], a, b);
      const int before = calc_excess(a, 0) + calc_excess(b, 0) + calc_excess(c, 0) + calc_excess(d, 0);
      const int after = calc_excess(a, -1) + calc_excess(b, -1) + calc_excess(c, 1) + calc_excess(d, 1);
      if (after < before) flip(a, b, faces);
    }
  }

  double calc_angle(std::int32_t at, std::int32_t a, std::int32_t b) const {
    const Vec3 p = x_[a] - x_[at], q = x_[b] - x_[at];
    return std::atan2(norm(cross(p, q)), dot(p, q));
  }

  void flip_to_delaunay() {
    for (int round = 0; round < 10; ++round) {
      bool again = false;
      for (const auto& [a, b] : list_edges()) {
        if (features_.contains(make_edge(a, b))) continue;
        std::array<std::int32_t, 2> faces{};
        if (find_faces(a, b, faces) != 2) continue;
        const std::int32_t c = find_third(faces[0], a, b), d = find_third(faces[1], a, b);
        if (kind_[c] != 0 && kind_[d] != 0) continue;  // no edge from fold to fold
        if (calc_angle(c, a, b) + calc_angle(d, a, b) > std::numbers::pi + 1e-9) again = flip(a, b, faces) || again;
      }
      if (!again) return;
    }
  }

  /// Edges inside that join two points of folds are split, so that every triangle at a fold has a point of its own.
  void part_chords() {
    for (const auto& [a, b] : list_edges())
      if (kind_[a] != 0 && kind_[b] != 0 && !features_.contains(make_edge(a, b))) split(a, b, places_.on_surface(0.5 * (x_[a] + x_[b])));
    // Corners of one triangle whose two sides are folds.
    for (std::size_t f = 0, n = t_.size(); f < n; ++f) {
      const Triangle t = t_[f];
      if (t[0] < 0 || kind_[t[0]] == 0 || kind_[t[1]] == 0 || kind_[t[2]] == 0) continue;
      const auto m = static_cast<std::int32_t>(x_.size());
      x_.push_back(places_.on_surface((1.0 / 3) * (x_[t[0]] + x_[t[1]] + x_[t[2]])));
      size_.push_back((size_[t[0]] + size_[t[1]] + size_[t[2]]) / 3);
      star_.emplace_back();
      kind_.push_back(0);
      for (int c = 0; c < 3; ++c) {
        const Triangle fresh{t[c], t[(c + 1) % 3], m};
        if (c == 0) {
          t_[f] = fresh;
          std::erase(star_[t[2]], static_cast<std::int32_t>(f));
          star_[m].push_back(static_cast<std::int32_t>(f));
        } else {
          for (const std::int32_t v : fresh) star_[v].push_back(static_cast<std::int32_t>(t_.size()));
          t_.push_back(fresh);
        }
      }
    }
  }

  void relax() {
    std::vector<Vec3> wanted(x_.size());
    std::vector<char> moves(x_.size(), 0);
    for (std::size_t v = 0; v < x_.size(); ++v) {
      if (star_[v].empty() || kind_[v] == 2) continue;
      Vec3 sum{}, normal{};
      double weights = 0;
      if (kind_[v] == 1) {
        std::array<std::int32_t, 2> ends{-1, -1};
        for (const std::int32_t f : star_[v])
          for (const std::int32_t w : t_[f])
            if (w != static_cast<std::int32_t>(v) && features_.contains(make_edge(static_cast<std::int32_t>(v), w))) {
              if (ends[0] < 0)
                ends[0] = w;
              else if (w != ends[0])
                ends[1] = w;
            }
        if (ends[1] < 0) continue;
        // Even in parts of the wanted lengths.
        const double wa = 1 / calc_wanted(static_cast<std::int32_t>(v), ends[0]),
                     wb = 1 / calc_wanted(static_cast<std::int32_t>(v), ends[1]);
        const double la = norm(x_[ends[0]] - x_[v]), lb = norm(x_[ends[1]] - x_[v]);
        const double off = 0.5 * (lb * wb - la * wa) / std::max(wa, wb);  // towards ends[1]
        wanted[v] = x_[v] + 0.5 * off * calc_unit(off > 0 ? x_[ends[1]] - x_[v] : x_[v] - x_[ends[0]]);
        moves[v] = 1;
        continue;
      }
      for (const std::int32_t f : star_[v]) {
        const Triangle& t = t_[f];
        const Vec3 area = calc_area(t);
        double size = 0;
        for (const std::int32_t w : t) size += size_[w] / 3;
        const double weight = norm(area) / (size * size);
        sum = sum + (weight / 3) * (x_[t[0]] + x_[t[1]] + x_[t[2]]);
        weights += weight;
        normal = normal + area;
      }
      if (!(weights > 0)) continue;
      normal = calc_unit(normal);
      const Vec3 way = (1 / weights) * sum - x_[v];
      wanted[v] = x_[v] + (way - dot(way, normal) * normal);
      moves[v] = 1;
    }
    for (std::size_t v = 0; v < x_.size(); ++v) {
      if (moves[v] == 0) continue;
      const Vec3 p = place(wanted[v], kind_[v] == 1);
      if (keeps_sides(static_cast<std::int32_t>(v), -1, p)) x_[v] = p;
    }
  }

  Skin get() {
    Skin out;
    number_.assign(x_.size(), -1);
    for (const Triangle& t : t_) {
      if (t[0] < 0) continue;
      for (const std::int32_t v : t) number_[v] = 0;
    }
    for (std::size_t v = 0; v < x_.size(); ++v)
      if (number_[v] == 0) {
        number_[v] = static_cast<std::int32_t>(out.surface.points.size());
        out.surface.points.push_back(x_[v]);
      }
    for (const Triangle& t : t_)
      if (t[0] >= 0) out.surface.triangles.push_back({number_[t[0]], number_[t[1]], number_[t[2]]});
    for (const Edge& e : features_)
      if (!border_.contains(e)) out.folds.push_back(make_edge(number_[e[0]], number_[e[1]]));
    std::sort(out.folds.begin(), out.folds.end());
    return out;
  }

  std::vector<Vec3> x_;
  std::vector<Triangle> t_;                      // -1 where it is gone
  std::vector<std::vector<std::int32_t>> star_;  // triangles at each point
  EdgeSet features_, border_;                    // the second is part of the first
  std::vector<char> kind_;
  std::vector<double> size_;
  std::vector<std::int32_t> number_;  // of each point in the last get()
  SkinSizes sizes_;
  const SkinPlaces& places_;
};

}  // namespace

std::vector<Edge> find_border(const TriangleSurface& surface) {
  std::vector<Edge> border;
  for (const auto& [edge, n] : count_faces(surface))
    if (n == 1) border.push_back(edge);
  std::sort(border.begin(), border.end());
  return border;
}

std::vector<std::array<Vec3, 3>> find_skin_normals(const Skin& skin) {
  const auto& points = skin.surface.points;
  const auto& triangles = skin.surface.triangles;
  const EdgeSet features = find_features(skin);
  mesh::Parts parts(3 * triangles.size());                 // corners
  std::unordered_map<Edge, std::int32_t, EdgeHash> first;  // the corner at the lower end of the edge, of its first triangle
  const auto corner_of = [&](std::size_t f, std::int32_t v) {
    const Triangle& t = triangles[f];
    return static_cast<std::int32_t>(3 * f) + (t[0] == v ? 0 : t[1] == v ? 1 : 2);
  };
  for (std::size_t f = 0; f < triangles.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = triangles[f][c], b = triangles[f][(c + 1) % 3];
      const Edge edge = make_edge(a, b);
      if (features.contains(edge)) continue;
      const auto [found, fresh] = first.try_emplace(edge, static_cast<std::int32_t>(f));
      if (fresh) continue;
      for (const std::int32_t v : {a, b}) parts.join(corner_of(static_cast<std::size_t>(found->second), v), corner_of(f, v));
    }
  const auto corners = static_cast<std::int32_t>(3 * triangles.size());
  std::vector<Vec3> sum(3 * triangles.size(), Vec3{});
  for (std::int32_t c = 0; c < corners; ++c) {
    const Triangle& t = triangles[c / 3];
    const Vec3 a = points[t[(c + 1) % 3]] - points[t[c % 3]], b = points[t[(c + 2) % 3]] - points[t[c % 3]];
    const double squares = dot(a, a) * dot(b, b);
    if (squares > 0) sum[parts.find(c)] = sum[parts.find(c)] + (1 / squares) * cross(a, b);
  }
  for (Vec3& n : sum) n = calc_unit(n);
  // At a fold or border: turned about it until the ways inward are arcs, whose ends lean alike to their chord.
  struct Rim {
    std::vector<Vec3> along;
    std::vector<std::pair<Vec3, Vec3>> in;  // way, normal at its end
  };
  std::vector<char> on_rim(points.size(), 0);
  for (const auto& [a, b] : features) on_rim[a] = on_rim[b] = 1;
  std::map<std::int32_t, Rim> rims;
  for (std::size_t f = 0; f < triangles.size(); ++f)
    for (int c = 0; c < 3; ++c)
      for (const int side : {1, 2}) {
        const std::int32_t v = triangles[f][c], w = triangles[f][(c + side) % 3];
        if (on_rim[v] == 0) continue;
        Rim& rim = rims[parts.find(static_cast<std::int32_t>(3 * f) + c)];
        if (features.contains(make_edge(v, w)))
          rim.along.push_back(calc_unit(points[w] - points[v]));
        else if (on_rim[w] == 0)
          rim.in.emplace_back(points[w] - points[v], sum[parts.find(static_cast<std::int32_t>(3 * f) + (c + side) % 3)]);
      }
  std::vector<std::pair<std::int32_t, Vec3>> turned;
  for (const auto& [r, rim] : rims) {
    if (rim.along.size() != 2) continue;
    const Vec3 normal = sum[r], rim_way = rim.along[1] - rim.along[0];
    if (norm(rim_way) < 1.7) continue;  // a corner
    const Vec3 sideways = calc_unit(cross(rim_way, normal));
    double gap = 0, squares = 0;
    for (const auto& [way, other] : rim.in) {
      const Vec3 unit = calc_unit(way);
      const double reach = dot(unit, sideways);
      gap += (dot(normal, unit) + dot(other, unit)) * reach;
      squares += reach * reach;
    }
    if (!(squares > 1e-6)) continue;
    const double tilt = std::atan2(-gap, squares);
    if (std::abs(tilt) < kMaxTilt) turned.emplace_back(r, std::cos(tilt) * normal + std::sin(tilt) * sideways);
  }
  for (const auto& [r, normal] : turned) sum[r] = normal;
  std::vector<std::array<Vec3, 3>> normals(triangles.size());
  for (std::int32_t c = 0; c < corners; ++c) normals[c / 3][c % 3] = sum[parts.find(c)];
  return normals;
}

Skin remesh(const Skin& skin, const SkinSizes& sizes, const SkinPlaces& places) { return Remesher(skin, sizes, places).run(); }

Skin add_rings(const Skin& skin, const SkinPlaces& places, const RingDistance& distance_m) {
  return Remesher(skin, {1, 1, 1}, places).add_rings(distance_m);
}

Skin make_room(const Skin& skin, const SkinPlaces& places, const std::vector<Vec3>& ways, const std::array<double, 2>& levels_m) {
  return Remesher(skin, {0, 0, 0}, places).make_room(ways, levels_m);
}

}  // namespace carillon::mesher
