#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "precompute/mesh/parallel/read_block.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"

namespace carillon::parallel_mesh {
namespace {

/// A node named by several entries belongs to the first.
void fix_by(std::int32_t& fixed, std::size_t entry) {
  const auto by = static_cast<std::int32_t>(entry) + 1;
  fixed = fixed == 0 ? by : std::min(fixed, by);
}

std::string begin_message(const std::string& name, const FixedNodes& entry) {
  return entry.place.empty() ? name : fmt::format("{}: {}", entry.place, name);
}

/// Array and value of a node set: `NAME` is every node with a nonzero value in point data NAME (no value), `NAME:N` those with value N.
/// Null if there is none.
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

[[noreturn]] void refuse_set(const std::string& name, const Layout& layout, const FixedNodes& entry) {
  const std::string start = begin_message(name, entry);
  if (layout.point_data.empty())
    throw InputError(
        fmt::format("{}: the mesh has no node set '{}': it has none at all; add an integer array to its PointData, or give a box instead",
                    start, *entry.node_set));
  std::vector<std::string> names;
  std::string list;
  for (const Array& array : layout.point_data) {
    names.push_back(array.name);
    if (names.size() <= 20) list += fmt::format("{}'{}'", list.empty() ? "" : ", ", array.name);
  }
  const std::string nearest = base::find_nearest(*entry.node_set, names);
  throw InputError(fmt::format("{}: the mesh has no node set '{}'{}; it has {} (or with a value: '{}:1')", start, *entry.node_set,
                               nearest.empty() ? "" : fmt::format(" (did you mean '{}'?)", nearest), list, names.front()));
}

/// Marks the nodes of an entry's set; returns their number on this rank.
std::int64_t read_fixed_set(const Source& source, const std::string& name, const Layout& layout, const FixedNodes& entry,
                            std::size_t number, mesh::MeshBlock& block) {
  std::optional<std::int64_t> value;
  const Array* array = find_set(layout, *entry.node_set, value);
  if (array == nullptr) refuse_set(name, layout, entry);
  const auto values = source.read<std::int64_t>(*array, block.corners.own_begin(), block.corners.own_count());
  std::int64_t count = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (value ? values[i] == *value : values[i] != 0) {
      fix_by(block.fixed[i], number);
      ++count;
    }
  return count;
}

void check_corners(const std::string& name, const FixedNodes& entry) {
  const auto& [from, to] = *entry.box_m;
  for (std::size_t k = 0; k < 3; ++k)
    if (!(from[k] <= to[k]))
      throw InputError(fmt::format("{}: the box runs from {} to {} along {}; give the smaller corner first", begin_message(name, entry),
                                   from[k], to[k], "xyz"[k]));
}

std::int64_t mark_box(const std::array<Vec3, 2>& box_m, double slack_m, std::size_t number, mesh::MeshBlock& block) {
  std::int64_t count = 0;
  for (std::size_t i = 0; i < block.nodes_m.size(); ++i) {
    bool is_in = true;
    for (std::size_t k = 0; k < 3; ++k)
      is_in = is_in && block.nodes_m[i][k] >= box_m[0][k] - slack_m && block.nodes_m[i][k] <= box_m[1][k] + slack_m;
    if (!is_in) continue;
    fix_by(block.fixed[i], number);
    ++count;
  }
  return count;
}

}  // namespace

void read_fixed_sets(const comm::Communicator& comm, const Source& source, const std::string& name, const Layout& layout,
                     const ReadOptions& options, mesh::MeshBlock& block) {
  std::vector<std::int64_t> counts;
  comm.agree([&] {
    block.fixed.assign(block.nodes_m.size(), 0);
    for (std::size_t i = 0; i < options.fixed.size(); ++i)
      counts.push_back(options.fixed[i].node_set ? read_fixed_set(source, name, layout, options.fixed[i], i, block) : 0);
  });
  comm.sum(counts);
  for (std::size_t i = 0; i < counts.size(); ++i)
    if (options.fixed[i].node_set && counts[i] == 0)
      throw InputError(fmt::format("{}: the node set '{}' of the mesh has no node; name another set", begin_message(name, options.fixed[i]),
                                   *options.fixed[i].node_set));
}

void find_fixed_boxes(const comm::Communicator& comm, const std::string& name, const ReadOptions& options, mesh::MeshBlock& block,
                      mesh::CheckReport& report) {
  Vec3 low, high;
  low.fill(std::numeric_limits<double>::max());
  high.fill(std::numeric_limits<double>::lowest());
  for (const Vec3& x : block.nodes_m)
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], x[k]);
      high[k] = std::max(high[k], x[k]);
    }
  comm.min(low);
  comm.max(high);
  report.box_low = low;
  report.box_high = high;
  const double slack_m = mesh::calc_place_tolerance(low, high);
  std::vector<std::int64_t> counts;
  comm.agree([&] {
    for (std::size_t i = 0; i < options.fixed.size(); ++i) {
      if (options.fixed[i].box_m) check_corners(name, options.fixed[i]);
      counts.push_back(options.fixed[i].box_m ? mark_box(*options.fixed[i].box_m, slack_m, i, block) : 0);
    }
  });
  comm.sum(counts);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (!options.fixed[i].box_m || counts[i] > 0) continue;
    const auto& [from, to] = *options.fixed[i].box_m;
    throw InputError(
        fmt::format("{}: no node lies in the box ({}, {}, {}) to ({}, {}, {}) m; the mesh spans ({}, {}, {}) to ({}, {}, {}) m",
                    begin_message(name, options.fixed[i]), from[0], from[1], from[2], to[0], to[1], to[2], low[0], low[1], low[2], high[0],
                    high[1], high[2]));
  }
}

}  // namespace carillon::parallel_mesh
