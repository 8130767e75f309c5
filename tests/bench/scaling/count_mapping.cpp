// What the separator tree of a mesh and its mapping to ranks cost, counted: count_mapping MESH [REFINEMENTS] > table.csv
// One process plays all ranks. REFINEMENTS: each cuts every tetrahedron of a T4 mesh into eight.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "partition/dissect.hpp"
#include "precompute/ldlt/mapping.hpp"
#include "precompute/mesh/read.hpp"

namespace {

using namespace carillon;

double find_seconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Every tetrahedron into eight by the middles of its edges. Returns the number of nodes.
std::int32_t refine(std::vector<std::int32_t>& tets, std::int32_t nodes) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middles;
  const auto find = [&](std::int32_t a, std::int32_t b) {
    const auto [place, is_new] = middles.try_emplace({std::min(a, b), std::max(a, b)}, nodes);
    if (is_new) ++nodes;
    return place->second;
  };
  std::vector<std::int32_t> finer;
  finer.reserve(8 * tets.size());
  for (std::size_t e = 0; e < tets.size(); e += 4) {
    const std::int32_t a = tets[e], b = tets[e + 1], c = tets[e + 2], d = tets[e + 3];
    const std::int32_t ab = find(a, b), ac = find(a, c), ad = find(a, d), bc = find(b, c), bd = find(b, d), cd = find(c, d);
    for (const auto& [i, j, k, l] : {std::array{a, ab, ac, ad},
                                     {ab, b, bc, bd},
                                     {ac, bc, c, cd},
                                     {ad, bd, cd, d},
                                     {ab, ac, ad, bd},
                                     {ab, ac, bc, bd},
                                     {ac, ad, bd, cd},
                                     {ac, bc, bd, cd}})
      finer.insert(finer.end(), {i, j, k, l});
  }
  tets = std::move(finer);
  return nodes;
}

void run(const std::string& file, int refinements) {
  mesh::TetMesh body = mesh::read_mesh(file);
  auto nodes = static_cast<std::int32_t>(body.nodes_m.size());
  if (refinements > 0 && body.order != 1) throw InputError(file + ": only a mesh of T4 can be refined; leave REFINEMENTS out");
  for (int round = 0; round < refinements; ++round) nodes = refine(body.tets, nodes);
  const partition::Graph graph = partition::make_node_graph(body.tets, body.nodes_per_tet(), nodes);
  double before = find_seconds();
  const ldlt::Forest whole = ldlt::find_supernodes(partition::renumber(graph, partition::order_nested_dissection(graph)), 0, nodes);
  const ldlt::MappingCounts alone = ldlt::count_mapping(whole, ldlt::Mapping(whole, 1, 1));
  fmt::print("# {} unknowns; METIS on the whole graph: {:.4g} operations, {:.4g} entries, {:.2f} s\n", 3 * std::int64_t{nodes},
             alone.total_operations, alone.total_entries, find_seconds() - before);
  fmt::print(
      "ranks,operations,entries,over_metis,path,path_over_metis,gang,fullest,weight,shared_operations,shared_entries,shared_fronts,planned_"
      "fronts,"
      "messages,megabytes,solve_kilobytes,dissect_s,map_s\n");
  const auto largest = [](const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); };
  for (int ranks = 2; ranks <= 64; ranks *= 2) {
    before = find_seconds();
    const std::vector<std::int32_t> position = partition::dissect(graph, ranks).position;
    const double dissect_s = find_seconds() - before;
    const ldlt::Forest forest = ldlt::find_supernodes(partition::renumber(graph, position), 0, nodes);
    before = find_seconds();
    const ldlt::Mapping mapping = ldlt::choose_mapping(forest, ranks);
    const double map_s = find_seconds() - before;
    const ldlt::MappingCounts counts = ldlt::count_mapping(forest, mapping);
    fmt::print("{},{:.4g},{:.4g},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.1f},{:.3f},{:.3f},{},{},{:.0f},{:.1f},{:.0f},{:.2f},{:.3f}\n", ranks,
               counts.total_operations, counts.total_entries, counts.total_operations / alone.total_operations, counts.path_ratio(),
               counts.path_operations * ranks / alone.total_operations, counts.gang_operations * ranks / counts.total_operations,
               counts.fullest_ratio(), mapping.operations_weight(), counts.shared_operations / counts.total_operations,
               counts.shared_entries / counts.total_entries, counts.shared_fronts, counts.most_planned_fronts, largest(counts.messages),
               1e-6 * largest(counts.bytes), 1e-3 * largest(counts.solve_bytes), dissect_s, map_s);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3 || argv[1][0] == '-' || (argc == 3 && std::string("0123").find(argv[2]) == std::string::npos)) {
    fmt::print(stderr, "usage: count_mapping MESH [REFINEMENTS, 0 to 3]\n");
    return 1;
  }
  try {
    run(argv[1], argc == 3 ? std::atoi(argv[2]) : 0);
  } catch (const std::exception& error) {
    fmt::print(stderr, "count_mapping: {}\n", error.what());
    return 1;
  }
}
