// Response of all members of an articulation to an impulse on one of them, at one configuration.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "runtime/physics/joints/mechanism.hpp"

namespace carillon::rigid {

/// Mobility of one mechanism at one configuration. Columns are computed on first use and valid until set().
class Linkage {
 public:
  /// Discards the columns and sets a new configuration.
  void set(joints::Mechanism& mechanism, joints::Coordinates at) {
    mechanism_ = &mechanism;
    at_ = std::move(at);
    columns_.assign(mechanism.count_members(), {});
  }
  /// (6 n, 6): velocity and spin of all members per linear and angular impulse on one, world axes.
  const std::vector<double>& get_mobility(int member) const {
    std::vector<double>& column = columns_[member];
    if (column.empty()) column = mechanism_->calc_mobility(at_, member);
    return column;
  }
  /// 6 x 6 block: response of `of`, row-major.
  const double* get_block(int of, int by) const { return get_mobility(by).data() + 36 * of; }

  std::vector<int> movers;  // indices of the members in the step's problem

 private:
  joints::Mechanism* mechanism_ = nullptr;
  joints::Coordinates at_;
  mutable std::vector<std::vector<double>> columns_;  // of the members requested so far
};

}  // namespace carillon::rigid
