// Method: the neighbours of a node are the nodes of its elements; since neighbourhood is symmetric, appending each node to its neighbours
//   in ascending order yields sorted rows. Blocks of own nodes are summed in the upper triangle and mirrored once. Rows of other ranks'
//   nodes are summed separately and sent. PETSc takes over the arrays without a copy.
// Source: PETSc manual, MatCreateSeqAIJWithArrays, MatCreateMPIAIJWithSplitArrays.
#include "precompute/fem/block_rows.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <numeric>
#include <utility>

#include "precompute/comm/exchange.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::fem {
namespace {

using mesh::LocalMesh;

/// Tetrahedra of each local node.
struct Incidence {
  std::vector<std::int64_t> begin;
  std::vector<std::int32_t> tet;
};

Incidence find_incidence(const LocalMesh& local) {
  Incidence incidence{std::vector<std::int64_t>(local.nodes_m.size() + 1, 0), std::vector<std::int32_t>(local.tets.size())};
  for (const std::int32_t node : local.tets) ++incidence.begin[node + 1];
  std::partial_sum(incidence.begin.begin(), incidence.begin.end(), incidence.begin.begin());
  std::vector<std::int64_t> next(incidence.begin.begin(), incidence.begin.end() - 1);
  const int width = local.nodes_per_tet();
  for (std::size_t i = 0; i < local.tets.size(); ++i) incidence.tet[next[local.tets[i]]++] = static_cast<std::int32_t>(i / width);
  return incidence;
}

/// Calls visit(neighbour) once for each free node that shares a tetrahedron with `node`, including itself.
class Neighbours {
 public:
  explicit Neighbours(const LocalMesh& local) : local_(local), incidence_(find_incidence(local)), stamp_(local.nodes_m.size(), -1) {}

  template <class Visit>
  void visit(std::int32_t node, Visit&& visit) {
    const int width = local_.nodes_per_tet();
    for (std::int64_t t = incidence_.begin[node]; t < incidence_.begin[node + 1]; ++t) {
      const std::int32_t* tet = &local_.tets[static_cast<std::size_t>(incidence_.tet[t]) * width];
      for (int i = 0; i < width; ++i) {
        const std::int32_t other = tet[i];
        if (stamp_[other] == node) continue;
        stamp_[other] = node;
        if (local_.row[other] >= 0) visit(other);
      }
    }
  }

 private:
  const LocalMesh& local_;
  Incidence incidence_;
  std::vector<std::int32_t> stamp_;
};

/// Symmetric pattern with sorted rows, from unsorted rows.
void sort_by_transposing(BlockRows& rows) {
  std::vector<std::int64_t> next(rows.begin.begin(), rows.begin.end() - 1);
  std::vector<std::int32_t> sorted(rows.column.size());
  for (std::int64_t i = 0; i < rows.row_count(); ++i)
    for (std::int64_t p = rows.begin[i]; p < rows.begin[i + 1]; ++p) sorted[next[rows.column[p]]++] = static_cast<std::int32_t>(i);
  rows.column = std::move(sorted);
}

void find_own_pattern(const LocalMesh& local, Neighbours& neighbours, LocalRows& rows) {
  rows.own.begin.reserve(local.free_nodes + 1);
  rows.off.begin.reserve(local.free_nodes + 1);
  rows.own.column.reserve(std::size_t{16} * local.free_nodes);
  for (std::int32_t i = 0; i < local.free_nodes; ++i) {
    neighbours.visit(i, [&](std::int32_t other) {
      if (other < local.free_nodes) {
        rows.own.column.push_back(other);
      } else {
        rows.off.column.push_back(local.row[other]);
      }
    });
    rows.own.begin.push_back(static_cast<std::int64_t>(rows.own.column.size()));
    std::sort(rows.off.column.begin() + rows.off.begin.back(), rows.off.column.end());
    rows.off.begin.push_back(static_cast<std::int64_t>(rows.off.column.size()));
  }
  sort_by_transposing(rows.own);
}

void find_halo_pattern(const LocalMesh& local, Neighbours& neighbours, LocalRows& rows) {
  const auto nodes = static_cast<std::int32_t>(local.nodes_m.size());
  std::vector<std::int32_t> halo;
  for (std::int32_t v = local.owned_nodes; v < nodes; ++v)
    if (local.row[v] >= 0) halo.push_back(v);
  std::sort(halo.begin(), halo.end(), [&](std::int32_t a, std::int32_t b) { return local.row[a] < local.row[b]; });
  rows.slot.assign(nodes, -1);
  std::iota(rows.slot.begin(), rows.slot.begin() + local.free_nodes, 0);
  for (const std::int32_t v : halo) {
    rows.slot[v] = -2 - static_cast<std::int32_t>(rows.halo_row.size());
    rows.halo_row.push_back(local.row[v]);
    neighbours.visit(v, [&](std::int32_t other) { rows.halo.column.push_back(local.row[other]); });
    std::sort(rows.halo.column.begin() + rows.halo.begin.back(), rows.halo.column.end());
    rows.halo.begin.push_back(static_cast<std::int64_t>(rows.halo.column.size()));
  }
}

/// First halo row of each rank, then the number of halo rows.
std::vector<std::int64_t> find_halo_ranges(const LocalRows& rows) {
  std::vector<std::int64_t> at;
  for (const std::int32_t first : rows.first_row)
    at.push_back(std::lower_bound(rows.halo_row.begin(), rows.halo_row.end(), first) - rows.halo_row.begin());
  return at;
}

/// Calls visit(place in the list of columns, row, columns) for each row in a list of (row, number of columns, columns).
template <class Visit>
void for_each_row(const std::vector<std::int32_t>& list, Visit&& visit) {
  for (std::size_t at = 0; at < list.size(); at += 2 + list[at + 1]) visit(list[at], std::span(&list[at + 2], list[at + 1]));
}

using Place = std::pair<std::int32_t, std::int32_t>;  // row, column

/// Inserts missing entries. `places` ascending, unique.
void insert(BlockRows& rows, const std::vector<Place>& places) {
  if (places.empty()) return;
  BlockRows merged;
  merged.column.reserve(rows.column.size() + places.size());
  auto place = places.begin();
  std::vector<std::int32_t> more;
  for (std::int64_t i = 0; i < rows.row_count(); ++i) {
    more.clear();
    for (; place != places.end() && place->first == i; ++place) more.push_back(place->second);
    std::set_union(rows.column.begin() + rows.begin[i], rows.column.begin() + rows.begin[i + 1], more.begin(), more.end(),
                   std::back_inserter(merged.column));
    merged.begin.push_back(static_cast<std::int64_t>(merged.column.size()));
  }
  rows = std::move(merged);
}

/// Sends the owners of halo rows their columns. Collective.
void share_pattern(const comm::Communicator& comm, LocalRows& rows) {
  const std::vector<std::int64_t> halo_at = find_halo_ranges(rows);
  const auto list_halo_rows = [&] {
    comm::ByRank<std::int32_t> sent{{}, {0}};
    for (std::size_t r = 0; r + 1 < halo_at.size(); ++r) {
      for (std::int64_t h = halo_at[r]; h < halo_at[r + 1]; ++h) {
        const auto columns = std::span(rows.halo.column).subspan(rows.halo.begin[h], rows.halo.begin[h + 1] - rows.halo.begin[h]);
        sent.items.push_back(rows.halo_row[h]);
        sent.items.push_back(static_cast<std::int32_t>(columns.size()));
        sent.items.insert(sent.items.end(), columns.begin(), columns.end());
      }
      sent.begin.push_back(static_cast<std::int64_t>(sent.items.size()));
    }
    return sent;
  };
  rows.arriving = comm::all_to_all(comm, list_halo_rows).items;
  std::vector<Place> own, off;
  const std::int32_t end = rows.first_own + static_cast<std::int32_t>(rows.own.row_count());
  comm.agree([&] {
    for_each_row(rows.arriving, [&](std::int32_t row, std::span<const std::int32_t> columns) {
      for (const std::int32_t c : columns) {
        const bool is_own = c >= rows.first_own && c < end;
        (is_own ? own : off).emplace_back(row - rows.first_own, is_own ? c - rows.first_own : c);
      }
    });
    for (auto* places : {&own, &off}) {
      std::sort(places->begin(), places->end());
      places->erase(std::unique(places->begin(), places->end()), places->end());
    }
    insert(rows.own, own);
    insert(rows.off, off);
  });
}

/// Mirrors the upper triangle to the lower.
void mirror(BlockRows& rows) {
  std::vector<std::int64_t> next(rows.begin.begin(), rows.begin.end() - 1);  // the next column below the diagonal of each row
  for (std::int64_t i = 0; i < rows.row_count(); ++i) {
    const std::int64_t begin = rows.begin[i], width = 3 * (rows.begin[i + 1] - begin);
    for (std::int64_t p = begin; p < rows.begin[i + 1]; ++p) {
      const std::int64_t j = rows.column[p];
      if (j <= i) continue;
      const std::int64_t q = next[j]++, other = rows.begin[j], other_width = 3 * (rows.begin[j + 1] - other);
      const double* from = &rows.stiffness[9 * begin + 3 * (p - begin)];
      double* to = &rows.stiffness[9 * other + 3 * (q - other)];
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) to[c * other_width + r] = from[r * width + c];
      if (!rows.mass.empty()) rows.mass[q] = rows.mass[p];
    }
  }
}

/// Arrays of one sequential AIJ matrix.
struct Arrays {
  std::vector<PetscInt> begin;
  std::unique_ptr<PetscInt[]> column;
  std::vector<double> value;
};

/// `per_node` scalar columns per block column: 3 for the stiffness, 1 (the row's own direction) for the mass.
void number_columns(const BlockRows& rows, int per_node, Arrays& out) {
  const std::int64_t nodes = rows.row_count();
  out.begin.resize(3 * nodes + 1);
  out.begin[0] = 0;
  out.column.reset(new PetscInt[3 * per_node * rows.column.size()]);
  PetscInt* at = out.column.get();
  for (std::int64_t i = 0; i < nodes; ++i)
    for (int d = 0; d < 3; ++d) {
      for (std::int64_t p = rows.begin[i]; p < rows.begin[i + 1]; ++p)
        for (int c = 0; c < per_node; ++c) *at++ = 3 * rows.column[p] + (per_node == 3 ? c : d);
      out.begin[3 * i + d + 1] = static_cast<PetscInt>(at - out.column.get());
    }
}

Arrays take_stiffness_arrays(BlockRows& rows) {
  Arrays arrays;
  number_columns(rows, 3, arrays);
  arrays.value = std::exchange(rows.stiffness, {});
  return arrays;
}

Arrays take_mass_arrays(BlockRows& rows) {
  Arrays arrays;
  number_columns(rows, 1, arrays);
  arrays.value.reserve(3 * rows.mass.size());
  for (std::int64_t i = 0; i < rows.row_count(); ++i)
    for (int d = 0; d < 3; ++d)
      arrays.value.insert(arrays.value.end(), rows.mass.begin() + rows.begin[i], rows.mass.begin() + rows.begin[i + 1]);
  rows.mass = {};
  return arrays;
}

Arrays take_lumped_arrays(const std::vector<double>& lumped, std::int64_t rows, bool is_diagonal) {
  Arrays arrays;
  arrays.begin.assign(3 * rows + 1, 0);
  arrays.column.reset(new PetscInt[3 * rows]);
  if (!is_diagonal) return arrays;
  std::iota(arrays.begin.begin(), arrays.begin.end(), 0);
  std::iota(arrays.column.get(), arrays.column.get() + 3 * rows, 0);
  for (std::int64_t i = 0; i < rows; ++i) arrays.value.insert(arrays.value.end(), 3, lumped[i]);
  return arrays;
}

/// Matrix on arrays whose lifetime is tied to it. Collective.
petsc::MatHandle make_matrix(const comm::Communicator& comm, Arrays own, Arrays off) {
  using Both = std::array<Arrays, 2>;
  auto* arrays = new Both{std::move(own), std::move(off)};
  const auto rows = static_cast<PetscInt>((*arrays)[0].begin.size()) - 1;
  // PETSc requires non-null arrays.
  for (Arrays& part : *arrays) part.value.reserve(1);
  petsc::MatHandle matrix;
  auto& [a, b] = *arrays;
  if (comm.size() == 1) {
    petsc::check(MatCreateSeqAIJWithArrays(comm, rows, rows, a.begin.data(), a.column.get(), a.value.data(), matrix.out()));
  } else {
    petsc::check(MatCreateMPIAIJWithSplitArrays(comm, rows, rows, PETSC_DETERMINE, PETSC_DETERMINE, a.begin.data(), a.column.get(),
                                                a.value.data(), b.begin.data(), b.column.get(), b.value.data(), matrix.out()));
  }
  PetscContainer owner = nullptr;
  petsc::check(PetscContainerCreate(comm, &owner));
  petsc::check(PetscContainerSetPointer(owner, arrays));
  petsc::check(PetscContainerSetUserDestroy(owner, [](void* pointer) -> PetscErrorCode {
    delete static_cast<Both*>(pointer);
    return 0;
  }));
  petsc::check(PetscObjectCompose(reinterpret_cast<PetscObject>(matrix.get()), "carillon_arrays", reinterpret_cast<PetscObject>(owner)));
  petsc::check(PetscContainerDestroy(&owner));
  petsc::check(MatSetBlockSize(matrix, 3));
  petsc::check(MatSetOption(matrix, MAT_SYMMETRIC, PETSC_TRUE));
  petsc::check(MatSetOption(matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  return matrix;
}

}  // namespace

void BlockRows::add(std::int64_t row, std::int32_t c, const double* k, int stride, double m) {
  const std::int64_t first = begin[row], count = begin[row + 1] - first;
  // Branchless bisection: the position of a column in its row is unpredictable for the processor.
  const std::int32_t* at = &column[first];
  for (std::int64_t left = count; left > 1;) {
    const std::int64_t half = left / 2;
    at += at[half] <= c ? half : 0;
    left -= half;
  }
  const std::int64_t place = at - &column[first];
  double* block = &stiffness[9 * first + 3 * place];
  for (int r = 0; r < 3; ++r)
    for (int d = 0; d < 3; ++d) block[3 * r * count + d] += k[r * stride + d];
  if (!mass.empty()) mass[first + place] += m;
}

void LocalRows::add(std::span<const std::int32_t> nodes, const LocalMesh& local, const ElementMatrices& element) {
  const int n = element.nodes, stride = 3 * n;
  for (int i = 0; i < n; ++i) {
    const std::int32_t row = slot[nodes[i]];
    if (row == -1) continue;
    if (is_lumped) lumped[row >= 0 ? row : own.row_count() - 2 - row] += element.mass[i * n + i];
    for (int j = 0; j < n; ++j) {
      const std::int32_t column = slot[nodes[j]];
      if (column == -1) continue;
      const double* k = &element.stiffness[3 * i * stride + 3 * j];
      const double m = element.mass[i * n + j];
      if (row < 0) {
        halo.add(-2 - row, local.row[nodes[j]], k, stride, m);
      } else if (column < 0) {
        off.add(row, local.row[nodes[j]], k, stride, m);
      } else if (row <= column) {
        own.add(row, column, k, stride, m);
      }
    }
  }
}

LocalRows make_rows(const comm::Communicator& comm, const LocalMesh& local, bool lumped) {
  LocalRows rows;
  rows.is_lumped = lumped;
  const std::vector<std::int32_t> counts = comm.all_gather(std::vector{local.free_nodes});
  rows.first_row.assign(counts.size() + 1, 0);
  std::partial_sum(counts.begin(), counts.end(), rows.first_row.begin() + 1);
  rows.first_own = rows.first_row[comm.rank()];
  comm.agree([&] {
    Neighbours neighbours(local);
    find_own_pattern(local, neighbours, rows);
    find_halo_pattern(local, neighbours, rows);
  });
  if (comm.size() > 1) share_pattern(comm, rows);
  comm.agree([&] {
    for (BlockRows* part : {&rows.own, &rows.off, &rows.halo}) {
      if (9 * part->column.size() > static_cast<std::size_t>(std::numeric_limits<PetscInt>::max()))
        throw SystemError("a rank's part of the stiffness matrix is beyond 32-bit indices; use more ranks or a coarser mesh");
      part->stiffness.assign(9 * part->column.size(), 0.0);
      if (!lumped) part->mass.assign(part->column.size(), 0.0);
    }
    if (lumped) rows.lumped.assign(rows.own.row_count() + rows.halo.row_count(), 0.0);
  });
  return rows;
}

void finish(const comm::Communicator& comm, LocalRows& rows) {
  if (rows.first_row.size() > 2) {
    const bool lumped = rows.is_lumped;
    const std::vector<std::int64_t> halo_at = find_halo_ranges(rows);
    auto sent = comm.agree([&] {
      comm::ByRank<double> values{{}, {0}};
      values.items.reserve(10 * rows.halo.column.size());
      for (std::size_t r = 0; r + 1 < halo_at.size(); ++r) {
        for (std::int64_t h = halo_at[r]; h < halo_at[r + 1]; ++h) {
          const std::int64_t begin = rows.halo.begin[h], end = rows.halo.begin[h + 1];
          values.items.insert(values.items.end(), rows.halo.stiffness.begin() + 9 * begin, rows.halo.stiffness.begin() + 9 * end);
          if (lumped) {
            values.items.push_back(rows.lumped[rows.own.row_count() + h]);
          } else {
            values.items.insert(values.items.end(), rows.halo.mass.begin() + begin, rows.halo.mass.begin() + end);
          }
        }
        values.begin.push_back(static_cast<std::int64_t>(values.items.size()));
      }
      return values;
    });
    rows.halo = {};
    const auto arrived = comm::all_to_all(comm, sent);
    const double* at = arrived.items.data();
    const std::int32_t end = rows.first_own + static_cast<std::int32_t>(rows.own.row_count());
    for_each_row(rows.arriving, [&](std::int32_t global_row, std::span<const std::int32_t> columns) {
      const std::int32_t row = global_row - rows.first_own;
      const std::size_t n = columns.size();
      for (std::size_t p = 0; p < n; ++p) {
        const std::int32_t c = columns[p];
        const double m = lumped ? 0.0 : at[9 * n + p];
        if (c < rows.first_own || c >= end) {
          rows.off.add(row, c, at + 3 * p, static_cast<int>(3 * n), m);
        } else if (row <= c - rows.first_own) {
          rows.own.add(row, c - rows.first_own, at + 3 * p, static_cast<int>(3 * n), m);
        }
      }
      if (lumped) rows.lumped[row] += at[9 * n];
      at += lumped ? 9 * n + 1 : 10 * n;
    });
    rows.arriving = {};
  }
  mirror(rows.own);
}

petsc::MatHandle take_stiffness(const comm::Communicator& comm, LocalRows& rows) {
  Arrays own, off;
  comm.agree([&] {
    own = take_stiffness_arrays(rows.own);
    off = take_stiffness_arrays(rows.off);
  });
  return make_matrix(comm, std::move(own), std::move(off));
}

petsc::MatHandle take_mass(const comm::Communicator& comm, LocalRows& rows) {
  Arrays own, off;
  comm.agree([&] {
    if (!rows.is_lumped) {
      own = take_mass_arrays(rows.own);
      off = take_mass_arrays(rows.off);
    } else {
      own = take_lumped_arrays(rows.lumped, rows.own.row_count(), true);
      off = take_lumped_arrays(rows.lumped, rows.own.row_count(), false);
    }
  });
  petsc::MatHandle matrix = make_matrix(comm, std::move(own), std::move(off));
  petsc::check(MatSetOption(matrix, MAT_SPD, PETSC_TRUE));
  return matrix;
}

}  // namespace carillon::fem
