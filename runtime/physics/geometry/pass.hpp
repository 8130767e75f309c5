// One direction of a pair search: points of one body against the surface of the other.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/physics/geometry/facing.hpp"
#include "runtime/physics/geometry/search.hpp"

namespace carillon::geometry {

/// Distances from samples of one body to the other, computed once per search.
struct Distances {
  std::vector<double> values;
  std::vector<std::uint32_t> stamps;
  std::uint32_t stamp = 0;
  void begin(std::size_t count) {
    if (stamps.size() < count) {
      stamps.assign(count, 0);
      values.resize(count);
      stamp = 0;
    }
    if (++stamp == 0) {
      std::fill(stamps.begin(), stamps.end(), 0);
      stamp = 1;
    }
  }
};

/// Samples and ridges of `mine` against the surface of `theirs`. Touches have `mine` as a.
class Pass {
 public:
  Pass(const Shape& mine, const Frame& fm, const Shape& theirs, const Frame& ft, double reach, std::vector<Touch>& out);
  /// Lists the samples within `reach_m`.
  void list(double reach_m, std::vector<std::pair<int, double>>& near) const;
  /// Largest distance of a sample that covers a point within the reach.
  double find_room() const { return calc_room(mine_.samples().reach_m) + reach_ + sag_; }
  /// `near`: samples listed before a movement of the bodies by at most `way_m`.
  void run(Distances& distances, const std::vector<std::pair<int, double>>& near, double way_m);
  /// Index of the deepest sample in theirs below `gap_m`, which becomes its gap; -1: none. `least_m`: per near sample a lower bound of its
  /// gap plus the value of `gone_m` at that time; updated where a sample is measured.
  int find_deepest(double& gap_m, const std::vector<std::pair<int, double>>& near, double gone_m, std::vector<double>& least_m) const;
  /// Ridges of mine against curved parts of theirs: lowest points of straight pieces, and corners from which both pieces rise.
  void run_ridges();
  /// Touch of a vertex or sample with the nearest point of theirs.
  Touch make_touch(int place, bool is_vertex) const;

 private:
  Vec3 to_theirs(const Vec3& x) const { return rotation_ * x + offset_; }
  double calc_room(double reach_m) const { return std::min(reach_m, bend_ * reach_m * reach_m); }
  bool may_carry(const Sample& sample, const Vec3& normal) const {
    return carries(mine_.mesh(), sample.vertex, turn_back(rotation_, normal));
  }

  Touch begin(const Vec3& station, const Vec3& theirs, const Vec3& normal) const;
  /// Adds a corner or a point of a ridge.
  void add_point(const Sample& sample);
  /// Touch of a ridge point of mine with a curved part of theirs; none over a flat part.
  std::optional<Touch> begin_ridge(const Vec3& point) const;
  /// Adds the lowest point of a straight ridge piece. Returns the end vertex if the lowest point is beyond it; otherwise -1.
  int add_ridge(int ridge);
  /// Adds a corner of a ridge that is below both adjacent pieces.
  void add_end(int vertex);
  /// Finds a flat face near x under the sample other than the nearest one: a corner in the plane of a side.
  bool find_brim(const Sample& sample, const Vec3& x, double d, Touch& t) const;
  /// Rounded rim over a facet: adds the lowest point of the skin around the sample. False if that point is not over the facet.
  bool add_rim(const Sample& sample, Touch t);
  /// Adds a point of a curved part.
  void add_smooth(const Sample& sample);
  /// True if the normal of a touch on an edge of theirs lies between the normals of the two faces.
  bool is_between(const Touch& t, const Nearest& foot) const;

  const Shape &mine_, &theirs_;
  const Frame &fm_, &ft_;
  SurfaceProbe surface_;
  double reach_, sag_, bend_ = 0.0;
  std::vector<Touch>& out_;
  Mat3 rotation_{};
  Vec3 offset_{};
};

}  // namespace carillon::geometry
