#include "precompute/mesher/skin_editor.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace carillon::mesher {
namespace {

constexpr double kBendDeg = 40;       // a larger bend is a corner of the fold
constexpr double kMaxTurn = 0.5;      // cosine, largest turn of a triangle in a collapse or move
constexpr double kMaxFlipTurn = 0.7;  // cosine, between the triangles before and after a flip
constexpr double kMinAreaPerSquaredLength =
    0.02;                                   // twice the area over the squared target length: smaller triangles have no normal of their own
constexpr double kMinHeightPerEdge = 0.02;  // over the longest edge: flatter triangles have no normal

}  // namespace

SkinEditor::SkinEditor(const Skin& skin, const SkinPlaces& places, double size_m)
    : x_(skin.surface.points),
      t_(skin.surface.triangles),
      star_(x_.size()),
      features_(find_features(skin)),
      size_(x_.size(), size_m),
      mitre_points_(skin.mitre_points),
      places_(places) {
  for (std::size_t f = 0; f < t_.size(); ++f)
    for (const std::int32_t v : t_[f]) star_[v].push_back(static_cast<std::int32_t>(f));
  for (const auto& [a, b] : find_border(skin.surface)) border_.insert(make_edge(a, b));
  find_kinds();
}

Skin SkinEditor::get(std::vector<std::int32_t>& number) const {
  Skin out;
  number.assign(x_.size(), -1);
  for (const Triangle& t : t_) {
    if (t[0] < 0) continue;
    for (const std::int32_t v : t) number[v] = 0;
  }
  for (std::size_t v = 0; v < x_.size(); ++v)
    if (number[v] == 0) {
      number[v] = static_cast<std::int32_t>(out.surface.points.size());
      out.surface.points.push_back(x_[v]);
    }
  for (const Triangle& t : t_)
    if (t[0] >= 0) out.surface.triangles.push_back({number[t[0]], number[t[1]], number[t[2]]});
  for (const Edge& e : features_)
    if (!border_.contains(e)) out.folds.push_back(make_edge(number[e[0]], number[e[1]]));
  std::sort(out.folds.begin(), out.folds.end());
  for (const MitrePoint& m : mitre_points_) out.mitre_points.push_back({number[m.point], number[m.fold], number[m.end], m.part});
  return out;
}

Skin SkinEditor::get() const {
  std::vector<std::int32_t> number;
  return get(number);
}

int SkinEditor::find_faces(std::int32_t a, std::int32_t b, std::array<std::int32_t, 2>& faces) const {
  int count = 0;
  for (const std::int32_t f : star_[a])
    if (has(f, b) && count < 2) faces[count++] = f;
  return count;
}

std::optional<Quad> SkinEditor::find_quad(std::int32_t a, std::int32_t b) const {
  Quad quad{a, b};
  if (is_feature(a, b) || find_faces(a, b, quad.faces) != 2) return std::nullopt;
  quad.c = find_third(quad.faces[0], a, b);
  quad.d = find_third(quad.faces[1], a, b);
  return quad;
}

std::int32_t SkinEditor::find_third(std::int32_t f, std::int32_t a, std::int32_t b) const {
  for (const std::int32_t v : t_[f])
    if (v != a && v != b) return v;
  return -1;
}

bool SkinEditor::has_edge(std::int32_t a, std::int32_t b) const {
  return std::any_of(star_[a].begin(), star_[a].end(), [&](std::int32_t f) { return has(f, b); });
}

std::vector<Edge> SkinEditor::list_edges() const {
  std::vector<Edge> edges;
  for (const Triangle& t : t_) {
    if (t[0] < 0) continue;
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = t[c], b = t[(c + 1) % 3];
      if (a < b || is_border(a, b)) edges.push_back(make_edge(a, b));
    }
  }
  return edges;
}

std::unordered_map<std::int32_t, std::vector<std::int32_t>> SkinEditor::find_along() const {
  std::unordered_map<std::int32_t, std::vector<std::int32_t>> along;
  for (const auto& [a, b] : features_) {
    along[a].push_back(b);
    along[b].push_back(a);
  }
  return along;
}

void SkinEditor::find_kinds() {
  kind_.assign(x_.size(), kInside);
  for (const auto& [v, others] : find_along()) {
    kind_[v] = kFixed;
    if (others.size() != 2) continue;
    const bool one = is_border(v, others[0]), two = is_border(v, others[1]);
    const Vec3 in = calc_unit(x_[v] - x_[others[0]]), out = calc_unit(x_[others[1]] - x_[v]);
    if (one == two && dot(in, out) > std::cos(kBendDeg * std::numbers::pi / 180)) kind_[v] = kOnFold;
  }
}

void SkinEditor::replace(std::int32_t f, std::int32_t from, std::int32_t to) {
  for (std::int32_t& v : t_[f])
    if (v == from) v = to;
}

void SkinEditor::split(std::int32_t a, std::int32_t b, const Vec3& at) {
  const auto m = static_cast<std::int32_t>(x_.size());
  std::array<std::int32_t, 2> faces{};
  const int count = find_faces(a, b, faces);
  x_.push_back(at);
  size_.push_back(calc_wanted(a, b));
  star_.emplace_back();
  const bool is_fold = features_.erase(make_edge(a, b)) > 0;
  if (is_fold) features_.insert({make_edge(a, m), make_edge(m, b)});
  if (border_.erase(make_edge(a, b)) > 0) border_.insert({make_edge(a, m), make_edge(m, b)});
  kind_.push_back(is_fold ? kOnFold : kInside);
  for (int n = 0; n < count; ++n) {
    const std::int32_t f = faces[n], c = find_third(f, a, b), g = static_cast<std::int32_t>(t_.size());
    const Triangle other = t_[f];
    t_.push_back(other);
    replace(g, a, m);
    replace(f, b, m);
    std::erase(star_[b], f);
    star_[b].push_back(g);
    star_[c].push_back(g);
    star_[m].push_back(f);
    star_[m].push_back(g);
  }
}

/// True if the triangles at v, except those with `other`, keep their orientation when v moves to p.
bool SkinEditor::keeps_sides(std::int32_t v, std::int32_t other, const Vec3& p) const {
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
    const auto calc_longest = [](const Vec3& a, const Vec3& b, const Vec3& c) { return std::max({norm(b - a), norm(c - b), norm(a - c)}); };
    const double longest = calc_longest(q[0], q[1], q[2]), longest_before = calc_longest(x_[t[0]], x_[t[1]], x_[t[2]]);
    const double height = norm(after) / (longest * longest), height_before = norm(before) / (longest_before * longest_before);
    // Flat triangles have no normal: none may become flat.
    if (!(height > std::min(kMinHeightPerEdge, 0.5 * height_before))) return false;
    if (height < kMinHeightPerEdge) continue;
    // Normals of triangles far below the target size are noise: use the surrounding mean.
    const Vec3& side = norm(before) > kMinAreaPerSquaredLength * wanted * wanted ? before : mean;
    if (dot(side, after) < kMaxTurn * norm(side) * norm(after)) return false;
  }
  return true;
}

bool SkinEditor::collapse(std::int32_t a, std::int32_t b, double longest) {
  if (kind_[b] > kind_[a]) std::swap(a, b);  // b is removed
  const bool is_fold = is_feature(a, b);
  if (kind_[b] == kFixed || (kind_[b] == kOnFold && !is_fold)) return false;
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
  // A fold must keep its two sides, and two folds must not merge.
  for (int n = 0; n < count; ++n) {
    const std::int32_t c = find_third(faces[n], a, b);
    if (star_[c].size() <= 3 && kind_[c] == kInside) return false;
    if (is_feature(b, c) && is_feature(a, c)) return false;
    if (is_feature(b, c) && !is_fold) return false;
  }
  const Vec3 p = kind_[a] == kind_[b] ? place(0.5 * (x_[a] + x_[b]), is_fold) : x_[a];
  for (const std::int32_t v : {a, b})
    for (const std::int32_t f : star_[v])
      for (const std::int32_t w : t_[f])
        if (w != a && w != b && norm(x_[w] - p) > longest * calc_wanted(w, a)) return false;
  if (!keeps_sides(a, b, p) || !keeps_sides(b, a, p)) return false;
  std::vector<std::int32_t> chained;  // on the fold beyond b
  if (is_fold)
    for (const std::int32_t f : star_[b])
      for (const std::int32_t w : t_[f])
        if (w != a && w != b && is_feature(b, w)) chained.push_back(w);
  const bool was_border = is_border(a, b);
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

bool SkinEditor::flip(const Quad& quad) {
  const auto& [a, b, c, d, faces] = quad;
  if (c == d || has_edge(c, d)) return false;
  // faces[0] is a b c or b a c.
  const Triangle& t = t_[faces[0]];
  const bool forth = (t[0] == a && t[1] == b) || (t[1] == a && t[2] == b) || (t[2] == a && t[0] == b);
  const Triangle one = forth ? Triangle{a, d, c} : Triangle{a, c, d}, two = forth ? Triangle{b, c, d} : Triangle{b, d, c};
  const Vec3 n0 = calc_area(t_[faces[0]]), n1 = calc_area(t_[faces[1]]), m0 = calc_area(one), m1 = calc_area(two);
  const Vec3 before = n0 + n1;
  for (const Vec3& m : {m0, m1})
    if (!(dot(m, before) > kMaxFlipTurn * norm(m) * norm(before))) return false;
  const double longest =
      std::max({norm(x_[c] - x_[d]), norm(x_[a] - x_[c]), norm(x_[b] - x_[c]), norm(x_[a] - x_[d]), norm(x_[b] - x_[d])});
  if (std::min(norm(m0), norm(m1)) < kMinHeightPerEdge * longest * longest) return false;
  t_[faces[0]] = one;
  t_[faces[1]] = two;
  std::erase(star_[b], faces[0]);
  std::erase(star_[a], faces[1]);
  star_[d].push_back(faces[0]);
  star_[c].push_back(faces[1]);
  return true;
}

void SkinEditor::part_chords() {
  for (const auto& [a, b] : list_edges())
    if (kind_[a] != kInside && kind_[b] != kInside && !is_feature(a, b)) split(a, b, places_.on_surface(0.5 * (x_[a] + x_[b])));
  // Corner triangles with two sides on folds.
  for (std::size_t f = 0, n = t_.size(); f < n; ++f) {
    const Triangle t = t_[f];
    if (t[0] < 0 || kind_[t[0]] == kInside || kind_[t[1]] == kInside || kind_[t[2]] == kInside) continue;
    const auto m = static_cast<std::int32_t>(x_.size());
    x_.push_back(places_.on_surface((1.0 / 3) * (x_[t[0]] + x_[t[1]] + x_[t[2]])));
    size_.push_back((size_[t[0]] + size_[t[1]] + size_[t[2]]) / 3);
    star_.emplace_back();
    kind_.push_back(kInside);
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

}  // namespace carillon::mesher
