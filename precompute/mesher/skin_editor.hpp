// Editable skin: points, edges and the triangles around each point, kept consistent.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "precompute/mesher/skin.hpp"

namespace carillon::mesher {

/// Triangles a b c and a b d at an inner edge a b.
struct Quad {
  std::int32_t a = 0, b = 0, c = 0, d = 0;
  std::array<std::int32_t, 2> faces{};
};

/// Editable triangulation. Invariant: every edge has at most two triangles; folds and borders are preserved; no move or collapse flips a
/// triangle. Point and triangle numbers are stable until get(). The projections must outlive it.
class SkinEditor {
 public:
  enum Kind : char { kInside, kOnFold, kFixed };  // of a point; fixed: where folds end, bend or meet

  /// size_m: uniform initial target edge length.
  SkinEditor(const Skin& skin, const SkinPlaces& places, double size_m);

  /// Current skin without unused points. number: new number of each point, -1: unused.
  Skin get(std::vector<std::int32_t>& number) const;
  Skin get() const;

  const std::vector<Vec3>& get_points() const { return x_; }
  const Triangle& get_triangle(std::int32_t f) const { return t_[f]; }
  std::size_t count_triangles() const { return t_.size(); }  // including removed ones
  const std::vector<std::int32_t>& get_star(std::int32_t v) const { return star_[v]; }
  Kind get_kind(std::int32_t v) const { return kind_[v]; }
  bool is_feature(std::int32_t a, std::int32_t b) const { return features_.contains(make_edge(a, b)); }  // fold or border
  bool is_border(std::int32_t a, std::int32_t b) const { return border_.contains(make_edge(a, b)); }

  double get_size(std::int32_t v) const { return size_[v]; }
  void set_size(std::int32_t v, double size_m) { size_[v] = size_m; }
  /// Length over the target length.
  double calc_part(const Edge& e) const { return norm(x_[e[1]] - x_[e[0]]) / calc_wanted(e[0], e[1]); }
  double calc_wanted(std::int32_t a, std::int32_t b) const { return 0.5 * (size_[a] + size_[b]); }

  std::vector<Edge> list_edges() const;
  /// Neighbours on the fold or border, for its points.
  std::unordered_map<std::int32_t, std::vector<std::int32_t>> find_along() const;
  /// Triangles of an edge; returns their number.
  int find_faces(std::int32_t a, std::int32_t b, std::array<std::int32_t, 2>& faces) const;
  /// Empty for folds and borders.
  std::optional<Quad> find_quad(std::int32_t a, std::int32_t b) const;
  /// True if the other diagonal would join two fold points.
  bool would_join_folds(const Quad& quad) const { return kind_[quad.c] != kInside && kind_[quad.d] != kInside; }
  /// Normal times twice the area.
  Vec3 calc_area(const Triangle& t) const { return cross(x_[t[1]] - x_[t[0]], x_[t[2]] - x_[t[0]]); }

  /// Projection onto the surface, or its folds and borders.
  Vec3 place(const Vec3& p, bool is_feature) const { return is_feature ? places_.on_fold(p) : places_.on_surface(p); }
  /// True if no triangle at v flips.
  bool may_move(std::int32_t v, const Vec3& p) const { return keeps_sides(v, -1, p); }
  void move(std::int32_t v, const Vec3& p) { x_[v] = p; }

  void split(std::int32_t a, std::int32_t b, const Vec3& at);
  void add_mitre_point(const MitrePoint& point) { mitre_points_.push_back(point); }
  /// Merges two points unless that changes folds, flips a triangle or makes edges longer than `longest` times their target.
  bool collapse(std::int32_t a, std::int32_t b, double longest);
  /// Flips edge a b to c d, unless the surface would change.
  bool flip(const Quad& quad);
  /// Splits inner edges between two fold points: every triangle at a fold gets a point of its own.
  void part_chords();

 private:
  bool has(std::int32_t f, std::int32_t v) const { return t_[f][0] == v || t_[f][1] == v || t_[f][2] == v; }
  bool has_edge(std::int32_t a, std::int32_t b) const;
  std::int32_t find_third(std::int32_t f, std::int32_t a, std::int32_t b) const;
  void find_kinds();
  void replace(std::int32_t f, std::int32_t from, std::int32_t to);
  bool keeps_sides(std::int32_t v, std::int32_t other, const Vec3& p) const;

  std::vector<Vec3> x_;
  std::vector<Triangle> t_;                      // -1: removed
  std::vector<std::vector<std::int32_t>> star_;  // triangles at each point
  EdgeSet features_, border_;                    // border_ is a subset of features_
  std::vector<Kind> kind_;
  std::vector<double> size_;
  std::vector<MitrePoint> mitre_points_;
  const SkinPlaces& places_;
};

}  // namespace carillon::mesher
