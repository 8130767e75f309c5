// Method: borders are edges of a single triangle; a grid per border length finds near ones. Two borders match if they share two distant
//   points within the tolerance. Ends that meet are merged; an end inside the other border splits its triangle.
#include "precompute/mesher/seams.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "precompute/mesh/parts.hpp"
#include "runtime/base/used_points.hpp"

namespace carillon::mesher {
namespace {

constexpr double kPartOfEdge = 0.25;        // tolerance limit, over a border's length
constexpr double kMinOverlapPerWidth = 20;  // common length of two borders, in seam widths; or half of the shorter border
constexpr double kMaxRimAngleDeg = 2;       // largest angle between the two sides of a wall at its rim
constexpr double kMaxComparisons = 2e8;     // comparisons of borders; above (millions of borders in one place): left unjoined
constexpr int kMaxSeamPasses = 3;           // a split can create new pairs of borders

template <std::size_t N>
struct CellHash {
  std::size_t operator()(const std::array<std::int64_t, N>& c) const {
    std::size_t h = 0;
    for (const std::int64_t x : c) h = (h ^ static_cast<std::size_t>(x)) * 0x9E3779B97F4A7C15ull;
    return h ^ (h >> 29);
  }
};

/// Edge of a single triangle.
struct Border {
  std::int32_t triangle = 0;
  int side = 0;  // between this corner and the next
  std::int32_t from = 0, to = 0;
  double length = 0.0;
};

std::vector<Border> find_borders(const TriangleSurface& surface) {
  const FaceCounts count = count_faces(surface);
  std::vector<Border> borders;
  for (std::size_t f = 0; f < surface.triangles.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      const Triangle& t = surface.triangles[f];
      const std::int32_t a = t[c], b = t[(c + 1) % 3];
      if (a == b || count.at(make_edge(a, b)) != 1) continue;
      const double length = norm(surface.points[b] - surface.points[a]);
      if (length > 0.0) borders.push_back({static_cast<std::int32_t>(f), c, a, b, length});
    }
  return borders;
}

/// Borders by grid cell, one grid per power of two of their lengths.
class BorderGrid {
 public:
  BorderGrid(const std::vector<Border>& borders, const std::vector<Vec3>& points, const Vec3& low, double reach)
      : low_(low), reach_(reach) {
    for (std::size_t b = 0; b < borders.size(); ++b) {
      const int level = std::max(std::ilogb(borders[b].length), std::ilogb(4.0 * reach)) + 1;
      if (std::find(levels_.begin(), levels_.end(), level) == levels_.end()) levels_.push_back(level);
      const Vec3 &p = points[borders[b].from], &q = points[borders[b].to];
      for_each_cell(level, p, q, [&](const Cell& cell) { cells_[cell].push_back(static_cast<std::int32_t>(b)); });
    }
  }
  /// Calls visit(border) for all candidates within reach of p, with repetitions.
  template <class Visit>
  void visit_near(const Vec3& p, const Visit& visit) const {
    for (const int level : levels_)
      for_each_cell(level, p, p, [&](const Cell& cell) {
        if (const auto found = cells_.find(cell); found != cells_.end())
          for (const std::int32_t b : found->second) visit(b);
      });
  }

 private:
  using Cell = std::array<std::int64_t, 4>;
  template <class Work>
  void for_each_cell(int level, const Vec3& p, const Vec3& q, const Work& work) const {
    const double size = std::ldexp(1.0, level);
    std::array<std::int64_t, 3> from{}, to{};
    for (std::size_t k = 0; k < 3; ++k) {
      // Half of the reach is for the border, half for the point.
      from[k] = static_cast<std::int64_t>(std::floor((std::min(p[k], q[k]) - low_[k] - 0.5 * reach_) / size));
      to[k] = static_cast<std::int64_t>(std::floor((std::max(p[k], q[k]) - low_[k] + 0.5 * reach_) / size));
    }
    for (std::int64_t x = from[0]; x <= to[0]; ++x)
      for (std::int64_t y = from[1]; y <= to[1]; ++y)
        for (std::int64_t z = from[2]; z <= to[2]; ++z) work(Cell{level, x, y, z});
  }

  Vec3 low_;
  double reach_;
  std::vector<int> levels_;
  std::unordered_map<Cell, std::vector<std::int32_t>, CellHash<4>> cells_;
};

/// An end of one border on another.
struct Contact {
  std::int32_t first = 0, second = 0;  // borders, the lower number first
  std::int32_t point = 0;              // the end
  std::int32_t on = 0;                 // the border under it
  double along = 0.0;                  // position on that border, 0 to 1
  double distance = 0.0;
};

/// Joins the seams of one surface at one tolerance. Invariant: the surface is unchanged until run() has found seams.
class SeamJoiner {
 public:
  SeamJoiner(TriangleSurface& surface, double tolerance)
      : surface_(surface), tolerance_(tolerance), borders_(find_borders(surface)), same_(surface.points.size()) {
    for (std::size_t b = 0; b < borders_.size(); ++b)
      for (const std::int32_t end : {borders_[b].from, borders_[b].to}) borders_at_[end].push_back(static_cast<std::int32_t>(b));
  }

  std::int64_t count_borders() const { return static_cast<std::int64_t>(borders_.size()); }

  /// Largest displacement of a point.
  double get_widest() const { return widest_; }

  /// False: no seams, no change.
  bool run() {
    find_contacts();
    for (std::size_t i = 0; i < contacts_.size();) {
      std::size_t end = i;
      while (end < contacts_.size() && contacts_[end].first == contacts_[i].first && contacts_[end].second == contacts_[i].second) ++end;
      join_pair(i, end);
      i = end;
    }
    if (!is_changed_) return false;
    cut_triangles();
    for (std::size_t v = 0; v < surface_.points.size(); ++v)
      widest_ = std::max(widest_, norm(surface_.points[v] - at(same_.find(static_cast<std::int32_t>(v)))));
    return true;
  }

 private:
  const Vec3& at(std::int32_t v) const { return surface_.points[v]; }
  const Border& border(std::int32_t b) const { return borders_[b]; }

  /// Tolerance for points on this border.
  double find_reach(const Border& b) const { return std::min(tolerance_, kPartOfEdge * b.length); }

  void find_contacts() {
    const BorderGrid grid(borders_, surface_.points, calc_box(surface_.points).low, 2.0 * tolerance_);
    double looks = 0.0;
    std::vector<std::int32_t> near;
    for (const auto& [v, own] : borders_at_) {
      near.clear();
      grid.visit_near(at(v), [&](std::int32_t b) { near.push_back(b); });
      std::sort(near.begin(), near.end());
      near.erase(std::unique(near.begin(), near.end()), near.end());
      for (const std::int32_t b : near) {
        const Border& other = border(b);
        looks += static_cast<double>(own.size());
        if (looks > kMaxComparisons) return contacts_.clear();
        const Vec3 way = at(other.to) - at(other.from);
        const double along = std::clamp(dot(at(v) - at(other.from), way) / dot(way, way), 0.0, 1.0);
        const double distance = norm(at(v) - (at(other.from) + along * way));
        if (distance > find_reach(other)) continue;
        for (const std::int32_t o : own)
          if (o != b && distance <= find_reach(border(o))) contacts_.push_back({std::min(o, b), std::max(o, b), v, b, along, distance});
      }
    }
    std::sort(contacts_.begin(), contacts_.end(), [](const Contact& a, const Contact& b) {
      return std::tie(a.first, a.second, a.on, a.point) < std::tie(b.first, b.second, b.on, b.point);
    });
  }

  /// True for overlapping triangles, such as both sides of a wall at its rim.
  bool is_folded(const Border& a, const Border& b) const {
    const Vec3 along = (1.0 / a.length) * (at(a.to) - at(a.from));
    const auto find_inward = [&](const Border& x) {
      const Triangle& t = surface_.triangles[x.triangle];
      const Vec3 way = at(t[(x.side + 2) % 3]) - at(x.from);
      return way - dot(way, along) * along;
    };
    const Vec3 p = find_inward(a), q = find_inward(b);
    if (norm(p) <= tolerance_ || norm(q) <= tolerance_) return false;  // a degenerate triangle
    return std::atan2(norm(cross(p, q)), dot(p, q)) < kMaxRimAngleDeg * std::numbers::pi / 180.0;
  }

  /// Contacts of two borders, from begin to end.
  void join_pair(std::size_t begin, std::size_t end) {
    const Border &a = border(contacts_[begin].first), &b = border(contacts_[begin].second);
    double overlap = 0.0, widest = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      widest = std::max(widest, contacts_[i].distance);
      for (std::size_t j = begin; j < i; ++j) overlap = std::max(overlap, norm(at(contacts_[i].point) - at(contacts_[j].point)));
    }
    const double shorter = std::min(a.length, b.length);
    if (!(overlap >= std::min(0.5 * shorter, kMinOverlapPerWidth * tolerance_) && overlap > 2.0 * widest) || is_folded(a, b)) return;
    for (std::size_t i = begin; i < end; ++i) {
      const Contact& contact = contacts_[i];
      const Border& on = border(contact.on);
      const double reach = find_reach(on);
      const std::int32_t near_end = contact.along < 0.5 ? on.from : on.to;
      if (contact.point == near_end) continue;
      is_changed_ = true;
      widest_ = std::max(widest_, contact.distance);
      if (norm(at(contact.point) - at(near_end)) <= reach)
        same_.join(contact.point, near_end);
      else
        cuts_[contact.on].emplace_back(contact.along, contact.point);
    }
  }

  /// Replaces merged points in all triangles, and splits triangles at ends on their sides.
  void cut_triangles() {
    const std::size_t before = surface_.triangles.size();
    for (Triangle& t : surface_.triangles)
      for (std::int32_t& v : t) v = same_.find(v);
    std::unordered_map<std::int32_t, std::vector<std::int32_t>> cut_borders;  // of a triangle
    for (const auto& [b, cuts] : cuts_) cut_borders[border(b).triangle].push_back(b);
    for (std::size_t f = 0; f < before; ++f) {
      const auto found = cut_borders.find(static_cast<std::int32_t>(f));
      if (found == cut_borders.end()) continue;
      std::vector<Triangle> pieces{surface_.triangles[f]};
      std::sort(found->second.begin(), found->second.end());
      for (const std::int32_t b : found->second) cut_side(b, pieces);
      surface_.triangles[f] = pieces.front();
      surface_.triangles.insert(surface_.triangles.end(), pieces.begin() + 1, pieces.end());
    }
  }

  void cut_side(std::int32_t b, std::vector<Triangle>& pieces) {
    std::vector<std::pair<double, std::int32_t>>& cuts = cuts_[b];
    std::sort(cuts.begin(), cuts.end());
    std::int32_t from = same_.find(border(b).from);
    const std::int32_t to = same_.find(border(b).to);
    for (const auto& [along, point] : cuts) {
      const std::int32_t v = same_.find(point);
      if (v == from || v == to) continue;
      for (std::size_t p = 0; p < pieces.size(); ++p)
        for (std::size_t c = 0; c < 3; ++c) {
          const Triangle piece = pieces[p];
          if (piece[c] != from || piece[(c + 1) % 3] != to || piece[(c + 2) % 3] == v) continue;
          pieces[p] = {from, v, piece[(c + 2) % 3]};
          pieces.push_back({v, to, piece[(c + 2) % 3]});
          from = v;
          p = pieces.size();
          break;
        }
    }
  }

  TriangleSurface& surface_;
  double tolerance_;
  std::vector<Border> borders_;
  mesh::Parts same_;
  std::map<std::int32_t, std::vector<std::int32_t>> borders_at_;               // of a point
  std::vector<Contact> contacts_;                                              // by their borders
  std::map<std::int32_t, std::vector<std::pair<double, std::int32_t>>> cuts_;  // of a border: positions and points
  bool is_changed_ = false;
  double widest_ = 0.0;
};

}  // namespace

void weld(TriangleSurface& surface, double tolerance) {
  std::unordered_map<std::array<std::int64_t, 3>, std::vector<std::int32_t>, CellHash<3>> cells;
  std::vector<std::int32_t> number(surface.points.size(), -1);
  std::vector<Vec3> kept;
  const Vec3 low = calc_box(surface.points).low;
  const auto join = [&](const Vec3& p) {
    std::array<std::int64_t, 3> cell;
    for (int c = 0; c < 3; ++c)
      cell[c] = tolerance > 0 ? static_cast<std::int64_t>(std::floor((p[c] - low[c]) / tolerance))
                              : static_cast<std::int64_t>(std::hash<double>()(p[c]));
    const int reach = tolerance > 0 ? 1 : 0;
    for (int x = -reach; x <= reach; ++x)
      for (int y = -reach; y <= reach; ++y)
        for (int z = -reach; z <= reach; ++z) {
          const auto found = cells.find({cell[0] + x, cell[1] + y, cell[2] + z});
          if (found == cells.end()) continue;
          for (const std::int32_t v : found->second)
            if (norm(kept[v] - p) <= tolerance) return v;
        }
    const auto fresh = static_cast<std::int32_t>(kept.size());
    kept.push_back(p);
    cells[cell].push_back(fresh);
    return fresh;
  };
  for (Triangle& t : surface.triangles)
    for (std::int32_t& v : t) {
      auto& n = number[v];
      if (n < 0) n = join(surface.points[v]);
      v = n;
    }
  surface.points = std::move(kept);
}

std::int64_t drop_unused_points(TriangleSurface& surface) {
  const base::UsedPoints used = base::find_used_points(surface.triangles, surface.points.size());
  for (std::size_t v = 0; v < used.points.size(); ++v) surface.points[v] = surface.points[used.points[v]];
  surface.points.resize(used.points.size());
  for (Triangle& t : surface.triangles)
    for (std::int32_t& v : t) v = used.number[v];
  return static_cast<std::int64_t>(used.number.size() - used.points.size());
}

Seams join_seams(TriangleSurface& surface) {
  const double diagonal = calc_box(surface.points).diagonal();
  TriangleSurface joined = surface;
  weld(joined, kSamePoint * diagonal);
  Seams seams;
  std::int64_t left = 0;
  // Narrow seams first: their borders are closed before a wider tolerance could join both sides of a thin wall's rim.
  for (const double tolerance : {1e-3 * kSeam, 1e-2 * kSeam, 0.1 * kSeam, kSeam})
    for (int pass = 0; pass < kMaxSeamPasses; ++pass) {
      TriangleSurface candidate = joined;
      SeamJoiner joiner(candidate, tolerance * diagonal);
      left = joiner.count_borders();
      if (left == 0 || !joiner.run()) break;
      const auto after = static_cast<std::int64_t>(find_borders(candidate).size());
      if (after >= left) break;
      joined = std::move(candidate);
      seams.edges += left - after;
      seams.widest = std::max(seams.widest, joiner.get_widest());
    }
  if (seams.edges > 0) surface = std::move(joined);
  return seams;
}

SurfaceInput read_input(const std::filesystem::path& path) {
  SurfaceInput input;
  input.surface = read_surface(path);
  input.triangles = static_cast<std::int64_t>(input.surface.triangles.size());
  input.unused_points = drop_unused_points(input.surface);
  input.seams = join_seams(input.surface);
  return input;
}

}  // namespace carillon::mesher
