// Method: rank 0 tells each rank which of its rows it wants; the ranks answer one by one, so that rank 0 holds one rank's answer at a time.
// Source: none needed. Deviations: none.
#include "precompute/io/gather.hpp"

#include <algorithm>

#include "precompute/petsc/session.hpp"

namespace carillon::io {
namespace {

constexpr int kWantTag = 11, kAnswerTag = 12;
constexpr std::size_t kBlock = std::size_t{1} << 26;  // entries of one message: MPI's counts are 32-bit

/// The wanted rows of this rank as (count, m, 3).
std::vector<double> copy_rows(Mat shapes, const std::vector<std::int32_t>& wanted, PetscInt modes) {
  PetscInt first = 0, leading = 0;
  const double* values = nullptr;
  petsc::check(MatGetOwnershipRange(shapes, &first, nullptr));
  petsc::check(MatDenseGetLDA(shapes, &leading));
  petsc::check(MatDenseGetArrayRead(shapes, &values));
  std::vector<double> rows(wanted.size() * modes * 3);
  for (std::size_t i = 0; i < wanted.size(); ++i)
    for (PetscInt m = 0; m < modes; ++m)
      for (int d = 0; d < 3; ++d)
        rows[(i * modes + m) * 3 + d] = values[static_cast<std::size_t>(m) * leading + 3 * static_cast<std::size_t>(wanted[i]) + d - first];
  petsc::check(MatDenseRestoreArrayRead(shapes, &values));
  return rows;
}

}  // namespace

std::vector<double> gather_shapes(MPI_Comm comm, Mat shapes, const std::vector<std::int32_t>& row) {
  int rank = 0, ranks = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &ranks);
  if (shapes == nullptr) return {};
  PetscInt modes = 0;
  petsc::check(MatGetSize(shapes, nullptr, &modes));
  const PetscInt* range = nullptr;
  petsc::check(MatGetOwnershipRanges(shapes, &range));

  if (rank != 0) {
    std::int64_t count = 0;
    MPI_Recv(&count, 1, MPI_INT64_T, 0, kWantTag, comm, MPI_STATUS_IGNORE);
    std::vector<std::int32_t> wanted(count);
    MPI_Recv(wanted.data(), static_cast<int>(count), MPI_INT32_T, 0, kWantTag, comm, MPI_STATUS_IGNORE);
    const std::vector<double> rows = copy_rows(shapes, wanted, modes);
    for (std::size_t at = 0; at < rows.size(); at += kBlock)
      MPI_Send(rows.data() + at, static_cast<int>(std::min(kBlock, rows.size() - at)), MPI_DOUBLE, 0, kAnswerTag, comm);
    return {};
  }

  std::vector<double> gathered(row.size() * modes * 3, 0.0);
  for (int from = 0; from < ranks; ++from) {
    std::vector<std::int32_t> wanted;
    std::vector<std::size_t> vertex;
    for (std::size_t v = 0; v < row.size(); ++v)
      if (row[v] >= 0 && 3 * static_cast<std::int64_t>(row[v]) >= range[from] && 3 * static_cast<std::int64_t>(row[v]) < range[from + 1]) {
        wanted.push_back(row[v]);
        vertex.push_back(v);
      }
    std::vector<double> rows;
    if (from == 0) {
      rows = copy_rows(shapes, wanted, modes);
    } else {
      const auto count = static_cast<std::int64_t>(wanted.size());
      MPI_Send(&count, 1, MPI_INT64_T, from, kWantTag, comm);
      MPI_Send(wanted.data(), static_cast<int>(count), MPI_INT32_T, from, kWantTag, comm);
      rows.resize(wanted.size() * modes * 3);
      for (std::size_t at = 0; at < rows.size(); at += kBlock)
        MPI_Recv(rows.data() + at, static_cast<int>(std::min(kBlock, rows.size() - at)), MPI_DOUBLE, from, kAnswerTag, comm,
                 MPI_STATUS_IGNORE);
    }
    for (std::size_t i = 0; i < vertex.size(); ++i)
      std::copy_n(rows.begin() + static_cast<std::ptrdiff_t>(i * modes * 3), modes * 3,
                  gathered.begin() + static_cast<std::ptrdiff_t>(vertex[i] * modes * 3));
  }
  return gathered;
}

}  // namespace carillon::io
