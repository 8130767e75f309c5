// Method: METIS k-way on the dual graph gives elements to ranks; a node goes to the highest rank among those of its elements. Rank 0 packs
//   and sends one rank's piece at a time.
// Source: Karypis and Kumar 1998 (METIS).
// Deviations: none.
#include "precompute/fem/distribute.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <exception>
#include <limits>
#include <numeric>
#include <utility>

#include "partition/partition.hpp"
#include "precompute/mesh/faces.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::fem {
namespace {

/// Everything that rank 0 decides before it sends.
struct Plan {
  std::vector<std::int32_t> part;       // (E) rank of each element
  std::vector<std::int32_t> owner;      // (N) rank of each node, -1: no element uses it
  std::vector<std::int32_t> component;  // (N)
  std::vector<bool> held;               // (N)
  std::vector<std::int32_t> row;        // (N), -1: held or unused
  std::vector<std::int32_t> first_row;  // (ranks + 1)
};

/// One rank's piece as it travels.
struct Piece {
  std::vector<std::int32_t> numbers;  // header, then tets, tet_in_mesh, region, node_in_mesh, row, component
  std::vector<double> positions;
};

/// Components in the order of their first nodes; -1: no element uses the node.
std::vector<std::int32_t> find_components(const mesh::TetMesh& mesh, std::int32_t& count) {
  mesh::Parts parts(mesh.nodes.size());
  std::vector<bool> used(mesh.nodes.size(), false);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (const std::int32_t node : mesh.tet(e)) {
      used[node] = true;
      parts.join(mesh.tet(e)[0], node);
    }
  std::vector<std::int32_t> component(mesh.nodes.size(), -1), of_part(mesh.nodes.size(), -1);
  count = 0;
  for (std::size_t v = 0; v < component.size(); ++v) {
    if (!used[v]) continue;
    std::int32_t& part = of_part[parts.find(static_cast<std::int32_t>(v))];
    if (part < 0) part = count++;
    component[v] = part;
  }
  return component;
}

/// A node on a seam goes to the highest rank that touches it. Then the seam nodes alone separate the ranks: what two ranks couple has on
/// the higher rank a node of the seam, which is the separator that carillon::ldlt takes. Dealing the seam out evenly instead would balance
/// the rows to the node, but widen that separator by half (measured: bunny, 2 ranks, 794 nodes instead of 540).
std::vector<std::int32_t> find_owners(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& part) {
  std::vector<std::int32_t> owner(mesh.nodes.size(), -1);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (const std::int32_t node : mesh.tet(e)) owner[node] = std::max(owner[node], part[e]);
  return owner;
}

void check_held(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& held_nodes) {
  for (const std::int32_t node : held_nodes)
    if (node < 0 || node >= static_cast<std::int64_t>(mesh.nodes.size()))
      throw InputError(fmt::format("held node {} is not in the mesh, which has {} nodes", node, mesh.nodes.size()));
}

partition::Partition cut_mesh(const mesh::TetMesh& mesh, int ranks) {
  if (mesh.order == 1) return partition::partition_elements(mesh.tets, ranks);
  std::vector<std::int32_t> corners;
  corners.reserve(4 * mesh.tet_count());
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) corners.insert(corners.end(), mesh.tet(e).begin(), mesh.tet(e).begin() + 4);
  return partition::partition_elements(corners, ranks);
}

Plan make_plan(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& held_nodes, int ranks, const DistributeOptions& options,
               Distribution& out) {
  check_held(mesh, held_nodes);
  partition::Partition cut = cut_mesh(mesh, ranks);

  Plan plan;
  plan.part = std::move(cut.part);
  plan.component = find_components(mesh, out.components);
  plan.owner = find_owners(mesh, plan.part);
  plan.held.assign(mesh.nodes.size(), false);
  for (const std::int32_t node : held_nodes) plan.held[node] = true;

  plan.first_row.assign(ranks + 1, 0);
  for (std::size_t v = 0; v < plan.owner.size(); ++v) {
    if (plan.owner[v] < 0) continue;
    ++out.nodes;
    if (!plan.held[v]) ++plan.first_row[plan.owner[v] + 1];
  }
  std::partial_sum(plan.first_row.begin(), plan.first_row.end(), plan.first_row.begin());
  out.free_nodes = plan.first_row.back();
  if (out.free_nodes == 0)
    throw InputError("'fixed' holds every node of the mesh, so that nothing can move; hold fewer nodes (a smaller box or node set)");
  if (out.free_nodes > std::numeric_limits<std::int32_t>::max() / 3)
    throw InputError(fmt::format("the mesh has {} free nodes, 32-bit matrix rows end at 715827882; use a coarser mesh", out.free_nodes));
  std::vector<std::int32_t> next(plan.first_row.begin(), plan.first_row.end() - 1);
  plan.row.assign(mesh.nodes.size(), -1);
  for (std::size_t v = 0; v < plan.owner.size(); ++v)
    if (plan.owner[v] >= 0 && !plan.held[v]) plan.row[v] = next[plan.owner[v]]++;

  out.tets = mesh.tet_count();
  out.report.element_balance = cut.quality.balance;
  out.report.edge_cut = cut.quality.edge_cut;
  out.report.contiguous = cut.quality.contiguous;
  if (!held_nodes.empty()) {
    out.held_m.assign(out.components, {});
    for (std::size_t v = 0; v < plan.held.size(); ++v)
      if (plan.held[v] && plan.owner[v] >= 0) out.held_m[plan.component[v]].push_back(mesh.nodes[v]);
    for (auto& points : out.held_m) points = pick_holding_points(points);
  }
  if (!options.elimination_order) return plan;
  std::vector<std::int32_t> rows(mesh.tets.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = plan.row[mesh.tets[i]];
  const auto graph = partition::make_node_graph(rows, mesh.nodes_per_tet(), static_cast<std::int32_t>(out.free_nodes));
  out.elimination_position = partition::order_nested_dissection(graph);
  return plan;
}

constexpr int kHeader = 6;
constexpr std::int64_t kBlock = 1 << 28;  // entries of one message: MPI's counts are 32-bit

/// Packs the piece of `rank`. `elements` are its elements; `local` is scratch of (N) entries, all -1 before and after.
Piece pack(const mesh::TetMesh& mesh, const Plan& plan, const std::vector<std::int32_t>& elements, int rank,
           std::vector<std::int32_t>& local) {
  std::vector<std::int32_t> touched;
  const auto touch = [&](std::int32_t node) {
    if (local[node] >= 0) return;
    local[node] = 0;
    touched.push_back(node);
  };
  for (const std::int32_t e : elements)
    for (const std::int32_t node : mesh.tet(e)) touch(node);
  const auto kind = [&](std::int32_t node) { return plan.owner[node] != rank ? 2 : plan.held[node] ? 1 : 0; };
  std::sort(touched.begin(), touched.end(), [&](std::int32_t a, std::int32_t b) { return std::pair(kind(a), a) < std::pair(kind(b), b); });
  const auto count = [&](int wanted) {
    return static_cast<std::int32_t>(std::count_if(touched.begin(), touched.end(), [&](std::int32_t v) { return kind(v) == wanted; }));
  };
  const std::int32_t free_nodes = count(0), owned = free_nodes + count(1), nodes = static_cast<std::int32_t>(touched.size());

  Piece piece;
  piece.numbers = {mesh.order, static_cast<std::int32_t>(elements.size()), nodes, free_nodes, owned, plan.first_row[rank]};
  for (std::int32_t i = 0; i < nodes; ++i) local[touched[i]] = i;
  for (const std::int32_t e : elements)
    for (const std::int32_t node : mesh.tet(e)) piece.numbers.push_back(local[node]);
  piece.numbers.insert(piece.numbers.end(), elements.begin(), elements.end());
  for (const std::int32_t e : elements) piece.numbers.push_back(static_cast<std::size_t>(e) < mesh.regions.size() ? mesh.regions[e] : 0);
  piece.numbers.insert(piece.numbers.end(), touched.begin(), touched.end());
  for (const std::int32_t node : touched) piece.numbers.push_back(plan.row[node]);
  for (const std::int32_t node : touched) piece.numbers.push_back(plan.component[node]);
  for (const std::int32_t node : touched) {
    piece.positions.insert(piece.positions.end(), mesh.nodes[node].begin(), mesh.nodes[node].end());
    local[node] = -1;
  }
  if (!mesh.doubt_m.empty())
    for (const std::int32_t node : touched)
      piece.positions.insert(piece.positions.end(), mesh.doubt_m[node].begin(), mesh.doubt_m[node].end());
  return piece;
}

LocalMesh unpack(const Piece& piece) {
  LocalMesh local;
  const auto& n = piece.numbers;
  local.order = n[0];
  local.free_nodes = n[3];
  local.owned_nodes = n[4];
  local.first_row = n[5];
  auto at = n.begin() + kHeader;
  const auto take = [&](std::vector<std::int32_t>& into, std::size_t count) {
    into.assign(at, at + static_cast<std::ptrdiff_t>(count));
    at += static_cast<std::ptrdiff_t>(count);
  };
  take(local.tets, static_cast<std::size_t>(n[1]) * local.nodes_per_tet());
  take(local.tet_in_mesh, n[1]);
  take(local.region, n[1]);
  take(local.node_in_mesh, n[2]);
  take(local.row, n[2]);
  take(local.component, n[2]);
  local.nodes_m.resize(n[2]);
  for (std::int32_t i = 0; i < n[2]; ++i)
    for (int k = 0; k < 3; ++k) local.nodes_m[i][k] = piece.positions[3 * i + k];
  if (piece.positions.size() > 3 * local.nodes_m.size()) local.doubt_m.resize(n[2]);
  for (std::size_t i = 0; i < local.doubt_m.size(); ++i)
    for (int k = 0; k < 3; ++k) local.doubt_m[i][k] = piece.positions[3 * (local.nodes_m.size() + i) + k];
  return local;
}

/// Sends and receives of any length.
template <typename T>
void send(MPI_Comm comm, const std::vector<T>& data, int to, MPI_Datatype type) {
  const auto size = static_cast<std::int64_t>(data.size());
  for (std::int64_t done = 0; done < size; done += kBlock)
    MPI_Send(data.data() + done, static_cast<int>(std::min(size - done, kBlock)), type, to, 1, comm);
}

template <typename T>
void receive(MPI_Comm comm, std::vector<T>& data, MPI_Datatype type) {
  const auto size = static_cast<std::int64_t>(data.size());
  for (std::int64_t done = 0; done < size; done += kBlock)
    MPI_Recv(data.data() + done, static_cast<int>(std::min(size - done, kBlock)), type, 0, 1, comm, MPI_STATUS_IGNORE);
}

/// A piece travels in three steps, so that neither side waits for a side that ran out of memory: its sizes (-1: it could not be packed),
/// the answer whether there is room for it, and then the piece itself.
void send_piece(MPI_Comm comm, const Piece* piece, int to) {
  std::array<std::int64_t, 2> sizes{-1, -1};
  if (piece != nullptr) sizes = {static_cast<std::int64_t>(piece->numbers.size()), static_cast<std::int64_t>(piece->positions.size())};
  MPI_Send(sizes.data(), 2, MPI_INT64_T, to, 0, comm);
  if (piece == nullptr) return;
  int has_room = 0;
  MPI_Recv(&has_room, 1, MPI_INT, to, 0, comm, MPI_STATUS_IGNORE);
  if (has_room == 0) return;
  send(comm, piece->numbers, to, MPI_INT32_T);
  send(comm, piece->positions, to, MPI_DOUBLE);
}

LocalMesh receive_piece(MPI_Comm comm) {
  std::array<std::int64_t, 2> sizes{};
  MPI_Recv(sizes.data(), 2, MPI_INT64_T, 0, 0, comm, MPI_STATUS_IGNORE);
  if (sizes[0] < 0) return {};  // rank 0 says why
  Piece piece;
  int has_room = 1;
  std::exception_ptr error;
  try {
    piece.numbers.resize(sizes[0]);
    piece.positions.resize(sizes[1]);
  } catch (...) {
    has_room = 0;
    error = std::current_exception();
  }
  MPI_Send(&has_room, 1, MPI_INT, 0, 0, comm);
  if (error) std::rethrow_exception(error);
  receive(comm, piece.numbers, MPI_INT32_T);
  receive(comm, piece.positions, MPI_DOUBLE);
  return unpack(piece);
}

/// Rank 0 packs and sends one rank's piece at a time and keeps its own.
LocalMesh send_pieces(MPI_Comm comm, const mesh::TetMesh& mesh, const Plan& plan, int ranks) {
  std::exception_ptr error;
  std::vector<std::vector<std::int32_t>> elements;
  std::vector<std::int32_t> scratch;
  const auto attempt = [&](auto&& work) {
    try {
      if (!error) work();
    } catch (...) {
      error = std::current_exception();
    }
  };
  attempt([&] {
    elements.resize(ranks);
    for (std::size_t e = 0; e < plan.part.size(); ++e) elements[plan.part[e]].push_back(static_cast<std::int32_t>(e));
    scratch.assign(mesh.nodes.size(), -1);
  });
  for (int to = 1; to < ranks; ++to) {
    Piece piece;
    attempt([&] { piece = pack(mesh, plan, elements[to], to, scratch); });
    send_piece(comm, error ? nullptr : &piece, to);
  }
  LocalMesh own;
  attempt([&] { own = unpack(pack(mesh, plan, elements[0], 0, scratch)); });
  if (error) std::rethrow_exception(error);
  return own;
}

/// Per component its held points, from rank 0 to all. Collective.
void share_held_points(MPI_Comm comm, std::vector<std::vector<Vec3>>& held_m) {
  std::vector<std::int32_t> counts;
  std::vector<Vec3> points;
  petsc::run_agreed(comm, [&] {
    for (const auto& list : held_m) {
      counts.push_back(static_cast<std::int32_t>(list.size()));
      points.insert(points.end(), list.begin(), list.end());
    }
  });
  std::array<std::int64_t, 2> sizes{static_cast<std::int64_t>(counts.size()), static_cast<std::int64_t>(points.size())};
  MPI_Bcast(sizes.data(), 2, MPI_INT64_T, 0, comm);
  petsc::run_agreed(comm, [&] {
    counts.resize(sizes[0]);
    points.resize(sizes[1]);
  });
  MPI_Bcast(counts.data(), petsc::to_petsc_int(sizes[0]), MPI_INT32_T, 0, comm);
  MPI_Bcast(points.data(), petsc::to_petsc_int(3 * sizes[1]), MPI_DOUBLE, 0, comm);
  petsc::run_agreed(comm, [&] {
    held_m.assign(counts.size(), {});
    auto at = points.begin();
    for (std::size_t c = 0; c < counts.size(); at += counts[c++]) held_m[c].assign(at, at + counts[c]);
  });
}

void share_facts(MPI_Comm comm, Distribution& out) {
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  std::array<std::int64_t, 6> numbers{out.nodes, out.tets, out.free_nodes, out.components, out.report.edge_cut, out.report.contiguous};
  MPI_Bcast(numbers.data(), static_cast<int>(numbers.size()), MPI_INT64_T, 0, comm);
  out.nodes = numbers[0];
  out.tets = numbers[1];
  out.free_nodes = numbers[2];
  out.components = static_cast<std::int32_t>(numbers[3]);
  out.report.edge_cut = numbers[4];
  out.report.contiguous = numbers[5] != 0;
  MPI_Bcast(&out.report.element_balance, 1, MPI_DOUBLE, 0, comm);
  static_assert(sizeof(PartitionReport::Rank) == 3 * sizeof(std::int64_t));
  petsc::run_agreed(comm, [&] { out.report.ranks.resize(ranks); });
  const PartitionReport::Rank mine{out.local.tet_count(), out.local.owned_nodes,
                                   static_cast<std::int64_t>(out.local.nodes_m.size()) - out.local.owned_nodes};
  MPI_Allgather(&mine, 3, MPI_INT64_T, out.report.ranks.data(), 3, MPI_INT64_T, comm);
  std::int64_t largest = 0;
  for (const auto& rank : out.report.ranks) largest = std::max(largest, rank.owned_nodes);
  out.report.node_balance = static_cast<double>(largest) * ranks / static_cast<double>(out.nodes);
  share_held_points(comm, out.held_m);
}

}  // namespace

std::vector<Vec3> pick_holding_points(const std::vector<Vec3>& points) {
  if (points.size() <= 3) return points;
  const auto subtract = [](const Vec3& x, const Vec3& y) { return Vec3{x[0] - y[0], x[1] - y[1], x[2] - y[2]}; };
  const auto square = [](const Vec3& x) { return x[0] * x[0] + x[1] * x[1] + x[2] * x[2]; };
  const Vec3 first = points.front();
  const Vec3 second = *std::max_element(
      points.begin(), points.end(), [&](const Vec3& x, const Vec3& y) { return square(subtract(x, first)) < square(subtract(y, first)); });
  const Vec3 line = subtract(second, first);
  const auto off_line = [&](const Vec3& point) {
    const Vec3 arm = subtract(point, first);
    return square({line[1] * arm[2] - line[2] * arm[1], line[2] * arm[0] - line[0] * arm[2], line[0] * arm[1] - line[1] * arm[0]});
  };
  const Vec3 third =
      *std::max_element(points.begin(), points.end(), [&](const Vec3& x, const Vec3& y) { return off_line(x) < off_line(y); });
  return {first, second, third};
}

Distribution distribute(MPI_Comm comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& held_nodes,
                        const DistributeOptions& options) {
  int rank = 0, ranks = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &ranks);
  Distribution out;
  Plan plan;
  petsc::run_agreed(comm, [&] {
    if (rank == 0) plan = make_plan(mesh, held_nodes, ranks, options, out);
  });
  petsc::run_agreed(comm, [&] { out.local = rank == 0 ? send_pieces(comm, mesh, plan, ranks) : receive_piece(comm); });
  out.row_of_node = std::move(plan.row);
  share_facts(comm, out);
  return out;
}

std::string describe(const PartitionReport& report) {
  std::string text = fmt::format("{} rank{}, {} faces cut, balance {:.3f} (elements) {:.3f} (nodes){}\n", report.ranks.size(),
                                 report.ranks.size() == 1 ? "" : "s", report.edge_cut, report.element_balance, report.node_balance,
                                 report.contiguous ? "" : ", not contiguous");
  for (std::size_t r = 0; r < report.ranks.size(); ++r)
    text += fmt::format("  rank {}: {} tetrahedra, {} nodes of its own, {} halo nodes\n", r, report.ranks[r].elements,
                        report.ranks[r].owned_nodes, report.ranks[r].halo_nodes);
  return text;
}

}  // namespace carillon::fem
