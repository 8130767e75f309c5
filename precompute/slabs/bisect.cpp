// Method: all elements are one group for all ranks. As long as a group is meant for several ranks, it is cut across the longest axis of its
//   inertia into two groups of elements in the ratio of their ranks; all groups are cut at the same time, so that a level costs one message
//   for the moments and a fixed number for the places of the cuts. A place is found by bisection on the 64 bits of (coordinate, as an
//   ordered integer), and what lies exactly there is parted by the element's number: so parts differ by one element at most, and the cut
//   does not depend on the order in the file nor, but for rounding in the moments, on the slabs.
// Source: Simon 1991, "Partitioning of unstructured problems for parallel processing" (recursive inertial bisection).
// Deviations: none.
#include <Eigen/Dense>
#include <bit>
#include <cmath>

#include "precompute/slabs/slab.hpp"

namespace carillon::slabs {
namespace {

/// A group of elements, meant for the ranks first_rank ... first_rank + ranks - 1.
struct Group {
  int first_rank = 0;
  int ranks = 1;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  std::int64_t left = 0;         // elements that go to the left
  std::uint64_t cut = 0;         // key of the first element on the right
  std::int64_t tie_element = 0;  // of the elements with that key, those with a smaller number go left
};

/// Keeps the order of doubles.
std::uint64_t make_key(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value + 0.0);
  return bits >> 63 != 0 ? ~bits : bits | std::uint64_t{1} << 63;
}

Eigen::Vector3d to_vector(const Vec3& x) { return {x[0], x[1], x[2]}; }

/// Counts and longest axes of all groups. Collective.
void find_axes(MPI_Comm comm, const std::vector<Vec3>& centres, const std::vector<std::int32_t>& group_of, std::vector<Group>& groups) {
  std::vector<double> sums;
  petsc::run_agreed(comm, [&] { sums.assign(10 * groups.size(), 0.0); });
  for (std::size_t e = 0; e < centres.size(); ++e) {
    double* sum = sums.data() + 10 * static_cast<std::size_t>(group_of[e]);
    sum[0] += 1;
    for (std::size_t k = 0; k < 3; ++k) sum[1 + k] += centres[e][k];
  }
  MPI_Allreduce(MPI_IN_PLACE, sums.data(), static_cast<int>(sums.size()), MPI_DOUBLE, MPI_SUM, comm);
  std::vector<double> moments;
  petsc::run_agreed(comm, [&] { moments.assign(9 * groups.size(), 0.0); });
  for (std::size_t e = 0; e < centres.size(); ++e) {
    const auto g = static_cast<std::size_t>(group_of[e]);
    const Eigen::Vector3d arm =
        to_vector(centres[e]) - Eigen::Vector3d(sums[10 * g + 1], sums[10 * g + 2], sums[10 * g + 3]) / sums[10 * g];
    Eigen::Map<Eigen::Matrix3d>(moments.data() + 9 * g) += arm * arm.transpose();
  }
  MPI_Allreduce(MPI_IN_PLACE, moments.data(), static_cast<int>(moments.size()), MPI_DOUBLE, MPI_SUM, comm);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const auto count = static_cast<std::int64_t>(sums[10 * g]);
    const int left_ranks = groups[g].ranks / 2;
    groups[g].left = count / groups[g].ranks * left_ranks + std::min<std::int64_t>(count % groups[g].ranks, left_ranks);
    const Eigen::Matrix3d moment = Eigen::Map<Eigen::Matrix3d>(moments.data() + 9 * g);
    if (moment.trace() > 0) groups[g].axis = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moment).eigenvectors().col(2);
    // The sign of an eigenvector is arbitrary.
    Eigen::Index largest = 0;
    groups[g].axis.cwiseAbs().maxCoeff(&largest);
    if (groups[g].axis[largest] < 0) groups[g].axis = -groups[g].axis;
  }
}

/// Sets value[g] to the largest number below `limit` for which count(g, value) is at most want[g]; count(e's) ascend with the value. A
/// bisection over the bits, all groups at once. `count_below(trial, counts)` adds this rank's counts. Collective.
template <typename CountBelow>
void find_places(MPI_Comm comm, int bits, const std::vector<std::int64_t>& want, std::vector<std::uint64_t>& value,
                 CountBelow&& count_below) {
  std::vector<std::uint64_t> trial;
  std::vector<std::int64_t> counts;
  petsc::run_agreed(comm, [&] {
    value.assign(want.size(), 0);
    trial = value;
    counts.assign(want.size(), 0);
  });
  for (int bit = bits - 1; bit >= 0; --bit) {
    for (std::size_t g = 0; g < want.size(); ++g) trial[g] = value[g] | std::uint64_t{1} << bit;
    std::fill(counts.begin(), counts.end(), 0);
    count_below(trial, counts);
    MPI_Allreduce(MPI_IN_PLACE, counts.data(), static_cast<int>(counts.size()), MPI_INT64_T, MPI_SUM, comm);
    for (std::size_t g = 0; g < want.size(); ++g)
      if (counts[g] <= want[g]) value[g] = trial[g];
  }
}

/// The places where groups are cut. Collective.
void find_cuts(MPI_Comm comm, const std::vector<std::uint64_t>& key, std::int64_t first_element, const std::vector<std::int32_t>& group_of,
               std::vector<Group>& groups) {
  std::vector<std::int64_t> want, below;
  std::vector<std::uint64_t> cut, tie;
  petsc::run_agreed(comm, [&] {
    for (const Group& group : groups) want.push_back(group.left);
    below.assign(groups.size(), 0);
  });
  find_places(comm, 64, want, cut, [&](const std::vector<std::uint64_t>& trial, std::vector<std::int64_t>& counts) {
    for (std::size_t e = 0; e < key.size(); ++e)
      counts[static_cast<std::size_t>(group_of[e])] += key[e] < trial[static_cast<std::size_t>(group_of[e])];
  });
  for (std::size_t e = 0; e < key.size(); ++e)
    below[static_cast<std::size_t>(group_of[e])] += key[e] < cut[static_cast<std::size_t>(group_of[e])];
  MPI_Allreduce(MPI_IN_PLACE, below.data(), static_cast<int>(below.size()), MPI_INT64_T, MPI_SUM, comm);
  for (std::size_t g = 0; g < want.size(); ++g) want[g] -= below[g];
  find_places(comm, 32, want, tie, [&](const std::vector<std::uint64_t>& trial, std::vector<std::int64_t>& counts) {
    for (std::size_t e = 0; e < key.size(); ++e) {
      const auto g = static_cast<std::size_t>(group_of[e]);
      counts[g] += key[e] == cut[g] && static_cast<std::uint64_t>(first_element) + e < trial[g];
    }
  });
  for (std::size_t g = 0; g < groups.size(); ++g) {
    groups[g].cut = cut[g];
    groups[g].tie_element = static_cast<std::int64_t>(tie[g]);
  }
}

}  // namespace

std::vector<std::int32_t> bisect(MPI_Comm comm, const std::vector<Vec3>& centres_m, std::int64_t first_element) {
  std::vector<Group> groups;
  std::vector<std::int32_t> group_of;
  std::vector<std::uint64_t> key;
  petsc::run_agreed(comm, [&] {
    groups.push_back({.first_rank = 0, .ranks = get_size(comm)});
    group_of.assign(centres_m.size(), 0);
    key.resize(centres_m.size());
  });
  const auto is_done = [&] { return std::all_of(groups.begin(), groups.end(), [](const Group& group) { return group.ranks == 1; }); };
  while (!is_done()) {
    find_axes(comm, centres_m, group_of, groups);
    for (std::size_t e = 0; e < key.size(); ++e)
      key[e] = make_key(groups[static_cast<std::size_t>(group_of[e])].axis.dot(to_vector(centres_m[e])));
    find_cuts(comm, key, first_element, group_of, groups);
    std::vector<Group> halves;
    petsc::run_agreed(comm, [&] {
      std::vector<std::int32_t> left_half(groups.size());
      for (std::size_t g = 0; g < groups.size(); ++g) {
        const int left_ranks = groups[g].ranks / 2;
        left_half[g] = static_cast<std::int32_t>(halves.size());
        if (left_ranks > 0) halves.push_back({.first_rank = groups[g].first_rank, .ranks = left_ranks});
        halves.push_back({.first_rank = groups[g].first_rank + left_ranks, .ranks = groups[g].ranks - left_ranks});
      }
      for (std::size_t e = 0; e < key.size(); ++e) {
        const auto g = static_cast<std::size_t>(group_of[e]);
        const Group& group = groups[g];
        const bool is_left =
            key[e] < group.cut || (key[e] == group.cut && first_element + static_cast<std::int64_t>(e) < group.tie_element);
        group_of[e] = left_half[g] + (group.ranks > 1 && !is_left ? 1 : 0);
      }
    });
    groups = std::move(halves);
  }
  for (std::int32_t& group : group_of) group = groups[static_cast<std::size_t>(group)].first_rank;
  return group_of;
}

}  // namespace carillon::slabs
