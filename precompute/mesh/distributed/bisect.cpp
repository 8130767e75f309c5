// Method: Starts with one group of all elements for all ranks. A group for several ranks is cut across the longest axis of its inertia into
// two groups in the ratio of their ranks. All groups are cut at the same time, so that a level costs two global sums, for centres and
// moments, and a fixed number for the cut positions. A cut position is found by bisection on the 64 bits of the coordinate as an ordered
// integer, ties are resolved by element number: parts differ by at most one element, and the cut does not depend on the order in the file
// nor, except for rounding of the moments, on the blocks of the ranks.
// Source: Simon 1991, "Partitioning of unstructured problems for parallel processing" (recursive inertial bisection).
#include "precompute/mesh/distributed/bisect.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <bit>

#include "precompute/comm/places.hpp"

namespace carillon::mesh {
namespace {

/// A group of elements for ranks first_rank ... first_rank + ranks - 1.
struct Group {
  int first_rank = 0;
  int ranks = 1;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  std::int64_t left = 0;  // number of elements of the left half

  int left_ranks() const { return ranks / 2; }
};

/// Cut positions: elements of group g go left if their key is below cut[g], or equal to it with a number below tie[g].
struct Cuts {
  std::vector<std::uint64_t> cut, tie;

  bool is_left(std::size_t g, std::uint64_t key, std::int64_t element) const {
    return key < cut[g] || (key == cut[g] && static_cast<std::uint64_t>(element) < tie[g]);
  }
};

/// Monotonic map of doubles to integers.
std::uint64_t make_key(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value + 0.0);
  return bits >> 63 != 0 ? ~bits : bits | std::uint64_t{1} << 63;
}

Eigen::Vector3d to_vector(const Vec3& x) { return {x[0], x[1], x[2]}; }

/// Counts and longest axes of all groups. Collective.
void find_axes(const comm::Communicator& comm, const std::vector<Vec3>& centres, const std::vector<std::int32_t>& group_of,
               std::vector<Group>& groups) {
  std::vector<double> sums, moments;
  comm.agree([&] {
    sums.assign(4 * groups.size(), 0.0);
    moments.assign(9 * groups.size(), 0.0);
  });
  for (std::size_t e = 0; e < centres.size(); ++e) {
    double* sum = sums.data() + 4 * group_of[e];
    sum[0] += 1;
    for (std::size_t k = 0; k < 3; ++k) sum[1 + k] += centres[e][k];
  }
  comm.sum(sums);
  for (std::size_t e = 0; e < centres.size(); ++e) {
    const std::size_t g = group_of[e];
    const Eigen::Vector3d arm = to_vector(centres[e]) - Eigen::Vector3d(sums[4 * g + 1], sums[4 * g + 2], sums[4 * g + 3]) / sums[4 * g];
    Eigen::Map<Eigen::Matrix3d>(moments.data() + 9 * g) += arm * arm.transpose();
  }
  comm.sum(moments);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const auto count = static_cast<std::int64_t>(sums[4 * g]);
    const int left_ranks = groups[g].left_ranks();
    groups[g].left = count / groups[g].ranks * left_ranks + std::min<std::int64_t>(count % groups[g].ranks, left_ranks);
    const Eigen::Matrix3d moment = Eigen::Map<Eigen::Matrix3d>(moments.data() + 9 * g);
    if (moment.trace() > 0) groups[g].axis = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moment).eigenvectors().col(2);
    // Fix the arbitrary sign of the eigenvector.
    Eigen::Index largest = 0;
    groups[g].axis.cwiseAbs().maxCoeff(&largest);
    if (groups[g].axis[largest] < 0) groups[g].axis = -groups[g].axis;
  }
}

/// Collective.
Cuts find_cuts(const comm::Communicator& comm, const std::vector<std::uint64_t>& key, std::int64_t first_element,
               const std::vector<std::int32_t>& group_of, const std::vector<Group>& groups) {
  std::vector<std::int64_t> wanted, below;
  comm.agree([&] {
    for (const Group& group : groups) wanted.push_back(group.left);
    below.assign(groups.size(), 0);
  });
  const auto count_below = [&](const std::vector<std::uint64_t>& trial, std::vector<std::int64_t>& counts) {
    for (std::size_t e = 0; e < key.size(); ++e) {
      const std::size_t g = group_of[e];
      counts[g] += key[e] < trial[g];
    }
  };
  Cuts cuts;
  cuts.cut = comm::find_places(comm, 64, wanted, count_below);
  count_below(cuts.cut, below);
  comm.sum(below);
  for (std::size_t g = 0; g < wanted.size(); ++g) wanted[g] -= below[g];
  cuts.tie = comm::find_places(comm, 32, wanted, [&](const std::vector<std::uint64_t>& trial, std::vector<std::int64_t>& counts) {
    for (std::size_t e = 0; e < key.size(); ++e) {
      const std::size_t g = group_of[e];
      counts[g] += key[e] == cuts.cut[g] && static_cast<std::uint64_t>(first_element) + e < trial[g];
    }
  });
  return cuts;
}

/// Both halves of every group, and the half of each element. Groups of one rank stay.
std::vector<Group> split(const std::vector<Group>& groups, const Cuts& cuts, const std::vector<std::uint64_t>& key,
                         std::int64_t first_element, std::vector<std::int32_t>& group_of) {
  std::vector<Group> halves;
  std::vector<std::int32_t> left_half;
  for (const Group& group : groups) {
    const int left_ranks = group.left_ranks();
    left_half.push_back(static_cast<std::int32_t>(halves.size()));
    if (left_ranks > 0) halves.push_back({.first_rank = group.first_rank, .ranks = left_ranks});
    halves.push_back({.first_rank = group.first_rank + left_ranks, .ranks = group.ranks - left_ranks});
  }
  for (std::size_t e = 0; e < key.size(); ++e) {
    const std::size_t g = group_of[e];
    const bool is_right = groups[g].ranks > 1 && !cuts.is_left(g, key[e], first_element + static_cast<std::int64_t>(e));
    group_of[e] = left_half[g] + is_right;
  }
  return halves;
}

}  // namespace

std::vector<std::int32_t> bisect(const comm::Communicator& comm, const std::vector<Vec3>& centres_m, std::int64_t first_element) {
  std::vector<Group> groups;
  std::vector<std::int32_t> group_of;
  std::vector<std::uint64_t> key;
  comm.agree([&] {
    groups.push_back({.first_rank = 0, .ranks = comm.size()});
    group_of.assign(centres_m.size(), 0);
    key.resize(centres_m.size());
  });
  while (std::any_of(groups.begin(), groups.end(), [](const Group& group) { return group.ranks > 1; })) {
    find_axes(comm, centres_m, group_of, groups);
    for (std::size_t e = 0; e < key.size(); ++e) key[e] = make_key(groups[group_of[e]].axis.dot(to_vector(centres_m[e])));
    const Cuts cuts = find_cuts(comm, key, first_element, group_of, groups);
    groups = comm.agree([&] { return split(groups, cuts, key, first_element, group_of); });
  }
  for (std::int32_t& group : group_of) group = groups[group].first_rank;
  return group_of;
}

}  // namespace carillon::mesh
