// Method: integer cell counts nearest to the requested edge. For a node count, bisection finds the edge, then divisions near it are
//   compared: a count error above 3 % costs ten times the error, anisotropy the squared logarithm of the aspect ratio.
#include "precompute/mesh/shapes/plan.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "runtime/base/error.hpp"

namespace carillon::shapes {
namespace {

constexpr long long kMaxNodes = 20'000'000;
constexpr double kMaxCells = 1e5;  // per direction; products stay within 64 bits

Divisions divide(const Body& body, const Divisions& fewest, double edge_m) {
  Divisions divisions = fewest;
  for (int axis = 0; axis < 4; ++axis) {
    const double cells = std::min(body.lengths[axis] / edge_m, kMaxCells);
    divisions[axis] = std::max(fewest[axis], static_cast<int>(std::lround(cells)));
  }
  return divisions;
}

// Edge length at which the node count exceeds the target.
double find_edge(const Body& body, const Divisions& fewest, int order, long long target) {
  const double longest = *std::max_element(body.lengths.begin(), body.lengths.end());
  double small = std::log(longest / kMaxCells);
  double large = std::log(longest * 2.0);
  for (int step = 0; step < 60; ++step) {
    const double middle = 0.5 * (small + large);
    const Counts counts = body.calc_counts(divide(body, fewest, std::exp(middle)));
    (calc_node_count(counts, order) > target ? small : large) = middle;
  }
  return std::exp(large);
}

// Cost of a division at an edge length: count error and anisotropy.
double calc_cost(const Body& body, const Divisions& fewest, const Divisions& divisions, double edge_m, double miss) {
  double cost = 10.0 * std::max(0.0, miss - 0.03) + 0.5 * miss;
  for (int axis = 0; axis < 4; ++axis) {
    if (body.lengths[axis] <= 0.0) continue;
    const double cells = std::max(body.lengths[axis] / edge_m, static_cast<double>(fewest[axis]));
    const double stretch = std::log(divisions[axis] / cells);
    cost += stretch * stretch;
  }
  return cost;
}

struct Choice {
  Divisions divisions{};
  double cost = HUGE_VAL;
};

Choice choose_divisions(const Body& body, int order, long long target) {
  const bool good_fits = calc_node_count(body.calc_counts(body.wanted), order) <= target;
  const Divisions fewest = good_fits ? body.wanted : body.coarsest;
  const double edge_0 = find_edge(body, fewest, order, target);
  Choice best;
  std::set<Divisions> seen;
  for (int step = -40; step <= 40; ++step) {
    const Divisions middle = divide(body, fewest, edge_0 * std::exp(0.015 * step));
    if (!seen.insert(middle).second) continue;
    for (int offsets = 0; offsets < 81; ++offsets) {
      Divisions divisions = middle;
      bool allowed = true;
      for (int axis = 0, rest = offsets; axis < 4; ++axis, rest /= 3) {
        divisions[axis] += rest % 3 - 1;
        if (divisions[axis] < fewest[axis] || (body.lengths[axis] <= 0.0 && divisions[axis] != fewest[axis])) allowed = false;
      }
      if (!allowed) continue;
      const double count = static_cast<double>(calc_node_count(body.calc_counts(divisions), order));
      const double cost = body.reluctance + calc_cost(body, fewest, divisions, edge_0, std::abs(count / static_cast<double>(target) - 1.0));
      if (cost < best.cost) best = {divisions, cost};
    }
  }
  return best;
}

}  // namespace

long long calc_node_count(const Counts& counts, int order) {
  if (order == 1) return counts.vertices;
  return 2 * counts.vertices + counts.tets + counts.boundary_triangles / 2 - counts.euler;
}

mesh::TetMesh make_best(const std::vector<Body>& bodies, int order, std::optional<long long> target_nodes, std::optional<double> edge_m) {
  if (edge_m) {
    const Divisions divisions = divide(bodies[0], bodies[0].wanted, *edge_m);
    if (calc_node_count(bodies[0].calc_counts(divisions), order) > kMaxNodes) {
      throw InputError(fmt::format("an edge of {:g} m would make more than {} nodes; give a longer edge", *edge_m, kMaxNodes));
    }
    return bodies[0].make(divisions);
  }
  const long long target = *target_nodes;
  if (target > kMaxNodes) throw InputError(fmt::format("{} nodes are too many; give at most {}", target, kMaxNodes));
  const Body* best_body = nullptr;
  Choice best;
  long long fewest_nodes = kMaxNodes;
  for (const Body& body : bodies) {
    const long long count = calc_node_count(body.calc_counts(body.coarsest), order);
    fewest_nodes = std::min(fewest_nodes, count);
    if (static_cast<double>(count) > 1.1 * static_cast<double>(target)) continue;
    const Choice choice = choose_divisions(body, order, target);
    if (choice.cost < best.cost) {
      best = choice;
      best_body = &body;
    }
  }
  if (!best_body) {
    throw InputError(fmt::format("{} nodes are too few: this body needs at least {} at order {}; give more", target, fewest_nodes, order));
  }
  return best_body->make(best.divisions);
}

}  // namespace carillon::shapes
