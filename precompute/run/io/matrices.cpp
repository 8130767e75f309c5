// Method: every rank formats the lower triangle of its rows in pieces; rank 0 writes them to the file.
// Source: Boisvert, Pozo, Remington, The Matrix Market exchange formats, NISTIR 5935, 1996.
#include "precompute/run/io/matrices.hpp"

#include <fmt/core.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <functional>
#include <iterator>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "precompute/petsc/session.hpp"
#include "precompute/run/io/node_order.hpp"
#include "runtime/base/file.hpp"

namespace carillon::io {
namespace {

namespace fs = std::filesystem;
using petsc::check;

constexpr std::size_t kPieceBytes = std::size_t{1} << 22;

/// Appends the next piece of this rank's text; an empty one is the last.
using NextPiece = std::function<void(std::string& piece)>;

/// Writes the pieces of rank 0, then those of rank 1 and so on, to one file. Collective; fails on all ranks alike.
void write_in_turn(const comm::Communicator& comm, const fs::path& file, const std::string& head, const NextPiece& next_piece) {
  const int rank = comm.rank();
  std::exception_ptr error;
  const auto attempt = [&](const auto& step) {
    if (error) return;
    try {
      step();
    } catch (...) {
      error = std::current_exception();
    }
  };
  std::optional<base::WholeFile> whole;
  if (rank == 0) {
    attempt([&] {
      whole.emplace(file);
      whole->append(head);
    });
  }
  std::string piece;
  for (int turn = 0; turn < comm.size(); ++turn) {
    for (std::int64_t size = 1; size > 0;) {
      piece.clear();
      if (rank == turn) attempt([&] { next_piece(piece); });
      size = static_cast<std::int64_t>(piece.size());
      MPI_Bcast(&size, 1, MPI_INT64_T, turn, comm);
      if (turn != 0 && rank == turn) MPI_Send(piece.data(), static_cast<int>(size), MPI_CHAR, 0, 0, comm);
      if (turn != 0 && rank == 0) {
        piece.resize(size);
        MPI_Recv(piece.data(), static_cast<int>(size), MPI_CHAR, turn, 0, comm, MPI_STATUS_IGNORE);
      }
      if (rank == 0) attempt([&] { whole->append(piece); });
    }
  }
  comm.agree(error);
  comm.agree([&] {
    if (rank == 0) whole->commit();
  });
}

/// For each node row of K and M: index of the node among the free nodes in mesh order. The same on every rank.
std::vector<std::int32_t> find_places(const comm::Communicator& comm, const mesh::LocalMesh& local) {
  const auto in_mesh =
      comm.all_gather([&] { return std::vector(local.node_in_mesh.begin(), local.node_in_mesh.begin() + local.free_nodes); });
  std::vector<std::int32_t> order(in_mesh.size()), places(in_mesh.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) { return in_mesh[a] < in_mesh[b]; });
  for (std::size_t i = 0; i < order.size(); ++i) places[order[i]] = static_cast<std::int32_t>(i);
  return places;
}

/// Calls visit(row, column, value) for the lower-triangle entries of a row, in mesh order, counted from 1.
template <class Visit>
void visit_row(Mat matrix, PetscInt row, const std::vector<std::int32_t>& places, Visit&& visit) {
  const auto find = [&](PetscInt i) { return 3 * static_cast<std::int64_t>(places[i / 3]) + i % 3 + 1; };
  PetscInt count = 0;
  const PetscInt* columns = nullptr;
  const PetscScalar* values = nullptr;
  check(MatGetRow(matrix, row, &count, &columns, &values));
  const std::int64_t own = find(row);
  for (PetscInt k = 0; k < count; ++k) {
    const std::int64_t other = find(columns[k]);
    if (other <= own && values[k] != 0) visit(own, other, values[k]);
  }
  check(MatRestoreRow(matrix, row, &count, &columns, &values));
}

void write_matrix(const comm::Communicator& comm, const fs::path& file, const std::string& what, Mat matrix,
                  const std::vector<std::int32_t>& places) {
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(matrix, &first, &last));
  std::int64_t entries = 0;
  for (PetscInt row = first; row < last; ++row) visit_row(matrix, row, places, [&](std::int64_t, std::int64_t, double) { ++entries; });
  entries = comm.sum(entries);
  const std::size_t n = 3 * places.size();
  const std::string head =
      fmt::format("%%MatrixMarket matrix coordinate real symmetric\n% {}; rows: nodes.csv\n{} {} {}\n", what, n, n, entries);
  PetscInt row = first;
  write_in_turn(comm, file, head, [&](std::string& piece) {
    for (; row < last && piece.size() < kPieceBytes; ++row) {
      visit_row(matrix, row, places, [&](std::int64_t i, std::int64_t j, double value) {
        fmt::format_to(std::back_inserter(piece), "{} {} {:.17g}\n", i, j, value);
      });
    }
  });
}

void write_nodes(const comm::Communicator& comm, const fs::path& file, const mesh::LocalMesh& local) {
  NodeOrder order(comm, local);
  std::vector<double> positions, numbers;
  for (std::int32_t i = 0; i < local.free_nodes; ++i) {
    for (const double x : local.nodes_m[i]) positions.push_back(x);
    numbers.insert(numbers.end(), 3, local.node_in_mesh[i]);
  }
  NodeOrder::Room room;
  const std::vector<const double*> columns{numbers.data(), positions.data()};
  order.to_records(columns, room);
  std::int64_t node = 0;
  write_in_turn(comm, file, "node,x_m,y_m,z_m\n", [&](std::string& piece) {
    for (; node < order.count() && piece.size() < kPieceBytes; ++node) {
      const double* record = room.records.data() + 6 * node;
      fmt::format_to(std::back_inserter(piece), "{:.0f},{:.17g},{:.17g},{:.17g}\n", record[0], record[1], record[3], record[5]);
    }
  });
}

}  // namespace

void check_matrices(const comm::Communicator& comm, const fs::path& folder) {
  if (folder.empty()) return;
  comm.agree([&] {
    if (!comm.is_root()) return;
    for (const char* name : {"stiffness.mtx", "mass.mtx", "nodes.csv"}) base::check_writable(folder / name, "file of the matrices");
  });
}

void write_matrices(const comm::Communicator& comm, const fs::path& folder, const mesh::LocalMesh& local, const fem::System& system) {
  const std::vector<std::int32_t> places = find_places(comm, local);
  write_matrix(comm, folder / "stiffness.mtx", "stiffness matrix K [N/m]", system.stiffness, places);
  write_matrix(comm, folder / "mass.mtx", "mass matrix M [kg]", system.mass, places);
  write_nodes(comm, folder / "nodes.csv", local);
}

}  // namespace carillon::io
