// Method: secant steps on a count model fitted to the last two meshes, within the current bracket. Sharp edges closer together than the
//   element size add nodes, detected by a trial at a fifth of the nodes. Where the count no longer falls with longer edges, the thickness
//   determines it and the search ends. Counts of coarse meshes jump, so a series of edges is tried there.
#include "precompute/mesher/count_search.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <optional>

#include "precompute/mesher/tet_quality.hpp"

namespace carillon::mesher {
namespace {

constexpr int kMaxSteps = 10;
// Below this target a mesh takes a few hundredths of a second, so a series of edges is tried.
constexpr double kFastTargetNodes = 3000;
constexpr int kTrials = 24;
// Trial fraction of the target; and the ratio of actual to predicted nodes above which the model needs an offset.
constexpr double kTrialPart = 0.2, kUsual = 1.5;

struct Trial {
  double edge_m, count;
};

/// True if clearly longer edges gave hardly fewer nodes.
bool is_level(const std::vector<Trial>& trials, double target) {
  const double longer = target < kFastTargetNodes ? 1.6 : 1.25;  // counts of coarse meshes jump
  for (const Trial& a : trials)
    for (const Trial& b : trials)
      if (a.count > target && b.count > target && b.edge_m > longer * a.edge_m && b.count > 0.9 * a.count) return true;
  return false;
}

}  // namespace

double CountModel::calc_nodes(double edge_m) const {
  if (is_wall) {
    // One, then two and more rows of nodes between the skins as edges shrink; far below the wall as in a solid.
    const double layers = volume_m3 / (edge_m * area_m2);
    const double between = 1.4 * std::clamp(layers - 0.97, 0.0, 0.6) + 0.61 * std::max(0.0, layers - 1.57);
    return base + factor * (1.55 + between) * area_m2 / (edge_m * edge_m);
  }
  // Interior and skin. For plates with less than two rows of elements only the skins count, with more nodes each.
  const double inside = volume_m3 / std::pow(edge_m, 3), skin = area_m2 / (edge_m * edge_m), rows = 2 * volume_m3 / (area_m2 * edge_m);
  const double thick = std::clamp((rows - 1.5) / 0.4, 0.0, 1.0);
  return base + factor * (thick * (0.94 * inside + 0.61 * skin) + (1 - thick) * (0.61 * inside + 1.15 * skin));
}

double CountModel::find_edge(double nodes) const {
  double low = 0, high = std::cbrt(volume_m3) + std::sqrt(area_m2);
  while (calc_nodes(high) > nodes) high *= 2;
  for (int n = 0; n < 100; ++n) (calc_nodes(0.5 * (low + high)) > nodes ? low : high) = 0.5 * (low + high);
  return 0.5 * (low + high);
}

std::int64_t count_nodes(const mesh::TetMesh& linear, int order) {
  return static_cast<std::int64_t>(linear.nodes_m.size()) + (order == 2 ? count_edges(linear) : 0);
}

mesh::TetMesh search_edge(const CountSearch& search, CountModel model, double& edge_m, int& attempts,
                          const std::function<mesh::TetMesh(double)>& make) {
  const double target = search.target, first_factor = model.factor;
  std::vector<Trial> trials;
  mesh::TetMesh mesh;
  double last_edge = 0;
  int failures = 0;
  std::optional<Trial> best;
  // Count at an edge; empty if such a mesh cannot be made but shorter edges might work.
  const auto attempt = [&](double edge) -> std::optional<double> {
    ++attempts;
    try {
      mesh = make(edge);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception&) {
      if (trials.empty() || ++failures > 1) throw;  // each may have taken seconds
      last_edge = 0;
      return std::nullopt;
    }
    last_edge = edge;
    const auto count = static_cast<double>(count_nodes(mesh, search.order));
    if (count > 0) trials.push_back({edge, count});
    if (count > 0 && (!best || std::abs(count - target) < std::abs(best->count - target))) best = {edge, count};
    return count;
  };
  const auto is_met = [&](double tolerance) { return best && std::abs(best->count / target - 1) <= tolerance; };

  // Model fitted to the last mesh, or the last two: a factor, or a factor and an offset independent of the edge.
  const auto learn = [&] {
    const Trial& last = trials.back();
    CountModel plain = model;
    plain.base = 0, plain.factor = 1;
    const double nodes = plain.calc_nodes(last.edge_m);
    model.base = 0, model.factor = last.count / nodes;
    if (trials.size() > 1) {
      const Trial& before = trials[trials.size() - 2];
      const double slope = (last.count - before.count) / (nodes - plain.calc_nodes(before.edge_m));
      const double base = last.count - slope * nodes;
      if (slope > 0 && base > 0 && base < target) model.base = base, model.factor = slope;
    } else if (model.factor > kUsual * first_factor && last.count - first_factor * nodes < target) {
      model.base = last.count - first_factor * nodes, model.factor = first_factor;
    }
  };

  double edge = std::min(edge_m, search.longest_m), low = 0, high = 1e300;
  if (search.is_uncertain && target * kTrialPart >= kFastTargetNodes / 2)
    edge = std::min(model.find_edge(kTrialPart * target), search.longest_m);
  for (int step = 0; step < kMaxSteps && !is_met(search.contented); ++step) {
    const std::optional<double> count = attempt(edge);
    if (is_level(trials, target)) break;
    if (!count || *count < target)
      high = std::min(high, edge);
    else
      low = std::max(low, edge);
    if (count && *count > 0) learn();
    const bool bracketed = low > 0 && high < 1e300;
    if (high / std::max(low, 1e-300) < 1.004 || (low >= search.longest_m)) break;
    edge = count && *count > 0 ? std::min(model.find_edge(target), search.longest_m) : 0.7 * edge;
    if (bracketed && !(edge > low * 1.002 && edge < high / 1.002)) edge = std::sqrt(low * high);
  }
  if (!is_met(search.tolerance) && target < kFastTargetNodes && best && failures == 0 && !is_level(trials, target)) {
    const double middle = best->edge_m;
    for (int n = 0; n < kTrials && !is_met(0.8 * search.tolerance); ++n)
      attempt(std::min(middle * (1 + 0.015 * (n / 2 + 1) * (n % 2 == 0 ? 1 : -1)), search.longest_m));
  }
  if (!is_met(search.tolerance)) {
    double fewest = 1e300;
    for (const Trial& t : trials) fewest = std::min(fewest, t.count);
    throw CountError("the count cannot be met", fewest, best ? best->count : 0);
  }
  edge_m = best->edge_m;
  if (last_edge != edge_m) {
    ++attempts;
    mesh = make(edge_m);
  }
  return mesh;
}

}  // namespace carillon::mesher
