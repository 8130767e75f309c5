// What the separator tree of a mesh and its mapping to ranks cost, counted: count_mapping MESH [REFINEMENTS [RANKS]] > table.csv
// One process plays all ranks. REFINEMENTS: each cuts every tetrahedron of a T4 mesh into eight. RANKS: "2,4,8,16,32,64" if not given.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "partition/dissect.hpp"
#include "precompute/ldlt/mapping.hpp"
#include "precompute/ldlt/tile_map.hpp"
#include "precompute/mesh/read.hpp"
#include "tests/support/mapping_messages.hpp"

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

/// Bytes of each rank at the peak of a factorisation: its L and D, the update matrices that are alive, its tiles of a shared front and what
/// the children send for them. On the safe side of what precompute/ldlt/plan.cpp finds: pivot columns of shared fronts, which lie in the
/// place of L, count as tiles, too, and stacks in addition to L. Without panels and blocks of A.
std::vector<double> count_peaks(const std::vector<ldlt::FrontCost>& fronts, const ldlt::Mapping& mapping,
                                const ldlt::MappingCounts& counts) {
  struct Alive {
    double stacks[2] = {0, 0};
    double most[2] = {0, 0};
    double sent = 0;
    double peak = 0;
  };
  std::vector<Alive> ranks(counts.entries.size());
  std::vector<int> depth(fronts.size(), 0);
  const auto count_update = [&](std::size_t s) { return 4.5 * fronts[s].rows * fronts[s].rows; };
  for (std::size_t s = fronts.size(); s-- > 0;)
    if (fronts[s].parent >= 0) depth[s] = depth[fronts[s].parent] + 1;
  std::vector<double> freed(fronts.size(), 0.0);  // what the children on the same rank leave, in the stack of the other parity
  for (std::size_t s = 0; s < fronts.size(); ++s) {
    const int owner = mapping.owner(static_cast<std::int32_t>(s));
    if (owner < 0) continue;
    Alive& rank = ranks[owner];
    const int parity = depth[s] % 2;
    const std::int32_t parent = fronts[s].parent;
    if (parent >= 0 && mapping.owner(parent) == owner) {
      rank.stacks[parity] += count_update(s);
      freed[parent] += count_update(s);
    } else if (parent >= 0) {
      rank.sent += count_update(s);
    }
    rank.most[parity] = std::max(rank.most[parity], rank.stacks[parity]);
    rank.stacks[1 - parity] -= freed[s];
  }
  for (Alive& rank : ranks) rank.peak = rank.most[0] + rank.most[1] + rank.sent;
  std::vector<std::vector<double>> updates(fronts.size());  // (shared fronts) of each place
  std::vector<std::vector<std::int32_t>> children(fronts.size());
  for (std::size_t s = 0; s < fronts.size(); ++s)
    if (fronts[s].parent >= 0) children[fronts[s].parent].push_back(static_cast<std::int32_t>(s));
  for (const std::int32_t front : ldlt::order_shared(fronts, mapping)) {
    const std::size_t s = front;
    const ldlt::TileMap map(fronts[s].width, fronts[s].rows, mapping.list_shares(front));
    std::vector<double>& update = updates[s];
    for (int place = 0; place < map.places(); ++place) {
      Alive& rank = ranks[map.rank(place)];
      rank.peak = std::max(rank.peak, rank.sent + 2 * static_cast<double>(map.count_numbers(place)));
      update.push_back(static_cast<double>(map.count_numbers(place, map.pivot_tiles())));
      rank.sent += update.back();
    }
    for (const std::int32_t child : children[s]) {
      const std::vector<double>& done = updates[child];
      const std::vector<ldlt::FrontShare> shares = mapping.list_shares(child);
      for (std::size_t place = 0; place < done.size(); ++place) ranks[shares[place].rank].sent -= done[place];
    }
  }
  std::vector<double> bytes;
  for (std::size_t rank = 0; rank < ranks.size(); ++rank) bytes.push_back(8 * (counts.entries[rank] + ranks[rank].peak));
  return bytes;
}

void run(const std::string& file, int refinements, const std::vector<int>& rank_numbers) {
  mesh::TetMesh body = mesh::read_mesh(file);
  auto nodes = static_cast<std::int32_t>(body.nodes_m.size());
  if (refinements > 0 && body.order != 1) throw InputError(file + ": only a mesh of T4 can be refined; leave REFINEMENTS out");
  for (int round = 0; round < refinements; ++round) nodes = refine(body.tets, nodes);
  const partition::Graph graph = partition::make_node_graph(body.tets, body.nodes_per_tet(), nodes);
  double before = find_seconds();
  const auto find_costs = [&](const std::vector<std::int32_t>& position) {
    return ldlt::list_costs(ldlt::find_supernodes(partition::renumber(graph, position), 0, nodes));
  };
  const std::vector<ldlt::FrontCost> whole = find_costs(partition::order_nested_dissection(graph));
  const ldlt::MappingCounts alone = ldlt::count_mapping(whole, ldlt::Mapping(whole, 1, 1));
  fmt::print("# {} unknowns; one rank: {:.4g} operations, {:.4g} entries, {:.2f} s\n", 3 * std::int64_t{nodes}, alone.total_operations,
             alone.total_entries, find_seconds() - before);
  std::fflush(stdout);
  fmt::print(
      "ranks,operations,entries,over_one,path,path_over_one,gang,fullest,weight,shared_operations,shared_entries,shared_fronts,planned_"
      "fronts,"
      "messages,megabytes,solve_messages,solve_kilobytes,solve_path_messages,peak_megabytes,root,dissect_s,map_s\n");
  const auto largest = [](const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); };
  for (const int ranks : rank_numbers) {
    before = find_seconds();
    const std::vector<std::int32_t> position = partition::dissect(graph, ranks).position;
    const double dissect_s = find_seconds() - before;
    const std::vector<ldlt::FrontCost> forest = find_costs(position);
    before = find_seconds();
    const ldlt::Mapping mapping = ldlt::choose_mapping(forest, ranks);
    const double map_s = find_seconds() - before;
    const ldlt::MappingCounts counts = ldlt::count_mapping(forest, mapping);
    const tests::MappingMessages sent = tests::count_messages(forest, mapping);
    std::int32_t root = 0;  // unknowns of the largest front
    for (const ldlt::FrontCost& front : forest) root = std::max(root, 3 * (front.width + front.rows));
    fmt::print(
        "{},{:.4g},{:.4g},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.1f},{:.3f},{:.3f},{},{},{:.0f},{:.1f},{:.0f},{:.0f},{:.0f},{:.1f},{},{:.2f}"
        ","
        "{:.3f}\n",
        ranks, counts.total_operations, counts.total_entries, counts.total_operations / alone.total_operations, counts.path_ratio(),
        counts.path_operations * ranks / alone.total_operations,
        ldlt::calc_gang_operations(forest, mapping) * ranks / counts.total_operations, counts.fullest_ratio(), mapping.operations_weight(),
        counts.shared_operations / counts.total_operations, counts.shared_entries / counts.total_entries, counts.shared_fronts,
        sent.most_planned_fronts, largest(sent.messages), 1e-6 * largest(sent.bytes), largest(sent.solve_messages),
        1e-3 * largest(sent.solve_bytes), sent.solve_path_messages, 1e-6 * largest(count_peaks(forest, mapping, counts)), root, dissect_s,
        map_s);
    std::fflush(stdout);
  }
}

/// "2,4,8": empty where a word is no number of ranks.
std::vector<int> read_ranks(const std::string& text) {
  std::vector<int> ranks;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) {
    if (word.empty() || word.size() > 5 || word.find_first_not_of("0123456789") != std::string::npos || std::stoi(word) < 2) return {};
    ranks.push_back(std::stoi(word));
  }
  return ranks;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<int> ranks = read_ranks(argc == 4 ? argv[3] : "2,4,8,16,32,64");
  const std::string refinements = argc >= 3 ? argv[2] : "0";
  if (argc < 2 || argc > 4 || argv[1][0] == '-' || refinements.size() != 1 || refinements[0] < '0' || refinements[0] > '3' ||
      ranks.empty()) {
    fmt::print(stderr, "usage: count_mapping MESH [REFINEMENTS, 0 to 3 [RANKS, such as 2,4,8, each at least 2]]\n");
    return 1;
  }
  try {
    run(argv[1], refinements[0] - '0', ranks);
  } catch (const std::exception& error) {
    fmt::print(stderr, "count_mapping: {}\n", error.what());
    return 1;
  }
}
