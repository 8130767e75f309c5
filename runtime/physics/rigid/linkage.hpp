// Response of all members of an articulation to an impulse on one of them, at one configuration.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "runtime/physics/joints/mechanism.hpp"

namespace carillon::rigid {

/// The mobility of one mechanism at one configuration. A column is calculated when it is first asked for, and stays valid until set().
class Linkage {
 public:
  /// Discards the columns of another configuration.
  void set(joints::Mechanism& mechanism, joints::Coordinates at) {
    mechanism_ = &mechanism;
    at_ = std::move(at);
    columns_.assign(mechanism.count_members(), {});
  }
  /// (6 n, 6): velocity and spin that all members gain per impulse and couple on one, world axes.
  const std::vector<double>& get_mobility(int member) const {
    std::vector<double>& column = columns_[member];
    if (column.empty()) column = mechanism_->calc_mobility(at_, member);
    return column;
  }
  /// The 36 of them that `of` gains, by rows.
  const double* get_block(int of, int by) const { return get_mobility(by).data() + 36 * of; }

  std::vector<int> movers;  // indices of the members in the step's problem

 private:
  joints::Mechanism* mechanism_ = nullptr;
  joints::Coordinates at_;
  mutable std::vector<std::vector<double>> columns_;  // of the members that were asked for
};

}  // namespace carillon::rigid
