#include "precompute/slabs/held.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "precompute/petsc/session.hpp"
#include "runtime/base/document.hpp"

namespace carillon::slabs {
namespace {

/// A node that several entries hold belongs to the first of them.
void hold_by(std::int32_t& held, std::size_t entry) {
  const auto by = static_cast<std::int32_t>(entry) + 1;
  held = held == 0 ? by : std::min(held, by);
}

std::string begin_message(const std::string& name, const Hold& hold) {
  return hold.place.empty() ? name : fmt::format("{}: {}", hold.place, name);
}

/// The array and the value of a node set: `NAME` is every node whose value in point data NAME is not 0 (then no value), `NAME:N` those
/// whose value is N. Null if there is none.
const Array* find_set(const Layout& layout, const std::string& set, std::optional<std::int64_t>& value) {
  for (const Array& array : layout.point_data) {
    if (set == array.name) return &array;
    if (!set.starts_with(array.name + ":")) continue;
    const std::string number = set.substr(array.name.size() + 1), digits = number.substr(number.starts_with("-") ? 1 : 0);
    if (digits.empty() || digits.size() > 18 || digits.find_first_not_of("0123456789") != std::string::npos) continue;
    value = std::stoll(number);
    return &array;
  }
  return nullptr;
}

/// Marks the nodes of a set; returns how many are on this rank.
std::int64_t read_held_set(const Source& source, const std::string& name, const Layout& layout, const Wish& wish, std::size_t entry,
                           std::int64_t begin, Slab& slab) {
  const Hold& hold = wish.hold[entry];
  std::optional<std::int64_t> value;
  if (const Array* array = find_set(layout, *hold.node_set, value)) {
    const auto values = source.read<std::int64_t>(*array, begin, static_cast<std::int64_t>(slab.nodes_m.size()));
    std::int64_t count = 0;
    for (std::size_t i = 0; i < values.size(); ++i)
      if (value ? values[i] == *value : values[i] != 0) {
        hold_by(slab.held[i], entry);
        ++count;
      }
    return count;
  }
  const std::string start = begin_message(name, hold);
  if (layout.point_data.empty())
    throw InputError(
        fmt::format("{}: the mesh has no node set '{}': it has none at all; add an integer array to its PointData, or give a box instead",
                    start, *hold.node_set));
  std::vector<std::string> names;
  std::string list;
  for (const Array& array : layout.point_data) {
    names.push_back(array.name);
    if (names.size() <= 20) list += fmt::format("{}'{}'", list.empty() ? "" : ", ", array.name);
  }
  const std::string nearest = base::find_nearest(*hold.node_set, names);
  throw InputError(fmt::format("{}: the mesh has no node set '{}'{}; it has {} (or with a value: '{}:1')", start, *hold.node_set,
                               nearest.empty() ? "" : fmt::format(" (did you mean '{}'?)", nearest), list, names.front()));
}

}  // namespace

void read_held_sets(MPI_Comm comm, const Source& source, const std::string& name, const Layout& layout, const Wish& wish,
                    std::int64_t begin, Slab& slab) {
  petsc::run_agreed(comm, [&] { slab.held.assign(slab.nodes_m.size(), 0); });
  for (std::size_t entry = 0; entry < wish.hold.size(); ++entry) {
    const Hold& hold = wish.hold[entry];
    if (!hold.node_set) continue;
    std::int64_t count = 0;
    petsc::run_agreed(comm, [&] { count = read_held_set(source, name, layout, wish, entry, begin, slab); });
    MPI_Allreduce(MPI_IN_PLACE, &count, 1, MPI_INT64_T, MPI_SUM, comm);
    petsc::run_agreed(comm, [&] {
      if (count == 0)
        throw InputError(
            fmt::format("{}: the node set '{}' of the mesh holds no node; name another set", begin_message(name, hold), *hold.node_set));
    });
  }
}

void find_held_boxes(MPI_Comm comm, const std::string& name, const Wish& wish, Slab& slab, mesh::CheckReport& report) {
  Vec3 low, high;
  low.fill(std::numeric_limits<double>::max());
  high.fill(std::numeric_limits<double>::lowest());
  for (const Vec3& x : slab.nodes_m)
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], x[k]);
      high[k] = std::max(high[k], x[k]);
    }
  MPI_Allreduce(MPI_IN_PLACE, low.data(), 3, MPI_DOUBLE, MPI_MIN, comm);
  MPI_Allreduce(MPI_IN_PLACE, high.data(), 3, MPI_DOUBLE, MPI_MAX, comm);
  report.box_low = low;
  report.box_high = high;
  const double slack = mesh::calc_place_tolerance(low, high);
  for (std::size_t entry = 0; entry < wish.hold.size(); ++entry) {
    const Hold& hold = wish.hold[entry];
    if (!hold.box_m) continue;
    const std::array<double, 3>&from = hold.box_m->at(0), &to = hold.box_m->at(1);  // clang 14 takes no binding into a lambda
    std::int64_t count = 0;
    for (std::size_t i = 0; i < slab.nodes_m.size(); ++i) {
      bool is_in = true;
      for (std::size_t k = 0; k < 3; ++k) is_in = is_in && slab.nodes_m[i][k] >= from[k] - slack && slab.nodes_m[i][k] <= to[k] + slack;
      if (!is_in) continue;
      hold_by(slab.held[i], entry);
      ++count;
    }
    MPI_Allreduce(MPI_IN_PLACE, &count, 1, MPI_INT64_T, MPI_SUM, comm);
    petsc::run_agreed(comm, [&] {
      for (std::size_t k = 0; k < 3; ++k)
        if (!(from[k] <= to[k]))
          throw InputError(fmt::format("{}: the box runs from {} to {} along {}; give the smaller corner first", begin_message(name, hold),
                                       from[k], to[k], "xyz"[k]));
      if (count == 0)
        throw InputError(fmt::format(
            "{}: no node lies in the box ({}, {}, {}) to ({}, {}, {}) m; the mesh spans ({}, {}, {}) to ({}, {}, {}) m",
            begin_message(name, hold), from[0], from[1], from[2], to[0], to[1], to[2], low[0], low[1], low[2], high[0], high[1], high[2]));
    });
  }
}

}  // namespace carillon::slabs
