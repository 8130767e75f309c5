// One direction of a search between two bodies: places of one before the surface of the other.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/physics/geometry/facing.hpp"
#include "runtime/physics/geometry/search.hpp"

namespace carillon::geometry {

/// Distances of samples of one body to another, found once in a search.
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

/// Samples and ridges of `mine` before the surface of `theirs`. Touches are made with mine as a.
class Pass {
 public:
  Pass(const Shape& mine, const Frame& fm, const Shape& theirs, const Frame& ft, double reach, std::vector<Touch>& out);
  /// The samples within `reach_m`.
  void list(double reach_m, std::vector<std::pair<int, double>>& near) const;
  /// Largest distance of a sample that covers a place within the reach.
  double find_room() const { return calc_room(mine_.samples().reach_m) + reach_ + sag_; }
  /// `near`: samples listed before a movement of the bodies by at most `way_m`.
  void run(Distances& distances, const std::vector<std::pair<int, double>>& near, double way_m);
  /// The deepest sample in theirs below `gap_m`, which becomes its gap; -1: none. `least_m`: for each near sample a bound of its gap
  /// plus `gone_m` when it was found; renewed where a sample is measured.
  int find_deepest(double& gap_m, const std::vector<std::pair<int, double>>& near, double gone_m, std::vector<double>& least_m) const;
  /// Ridges of mine before curved parts of theirs: the lowest places of their straight pieces, and corners between two pieces that both
  /// rise.
  void run_ridges();
  /// A touch of a sample with the nearest place of theirs.
  Touch make_touch(int place) const;

 private:
  Vec3 to_theirs(const Vec3& x) const { return rotation_ * x + offset_; }
  double calc_room(double reach_m) const { return std::min(reach_m, bend_ * reach_m * reach_m); }
  bool may_carry(const Sample& sample, const Vec3& normal) const {
    return carries(mine_.mesh(), sample.vertex, turn_back(rotation_, normal));
  }

  Touch begin(const Vec3& station, const Vec3& theirs, const Vec3& normal) const;
  /// A corner or a point of a ridge.
  void add_point(const Sample& sample);
  /// A touch of a place of a ridge of mine with a curved part of theirs; none over a flat one.
  std::optional<Touch> begin_ridge(const Vec3& point) const;
  /// The lowest place of a straight piece of a ridge. Returns the end vertex of a piece with its lowest place beyond; otherwise -1.
  int add_ridge(int ridge);
  /// A corner of a ridge below both pieces next to it.
  void add_end(int vertex);
  /// A flat face about x under the sample other than the nearest one: a corner in the plane of a side.
  bool find_brim(const Sample& sample, const Vec3& x, double d, Touch& t) const;
  /// A rim over a facet is round: the lowest place of the skin about the sample. False where that is not over the facet.
  bool add_rim(const Sample& sample, Touch t);
  /// A place of a curved part.
  void add_smooth(const Sample& sample);
  /// True for a normal of a touch on an edge of theirs between the normals of its two faces.
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
