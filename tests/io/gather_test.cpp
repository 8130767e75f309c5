#include "precompute/io/gather.hpp"

#include <gtest/gtest.h>

#include "precompute/io/run_record.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::io {
namespace {

int get_rank() {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  return rank;
}

/// A value that tells row and column apart.
double value_at(PetscInt row, PetscInt column) { return 1000.0 * row + column + 0.25; }

/// A dense matrix of uneven row blocks: rank r owns 2 + 3 r nodes.
petsc::MatHandle make_shapes(PetscInt modes) {
  petsc::MatHandle shapes;
  petsc::check(MatCreateDense(MPI_COMM_WORLD, 3 * (2 + 3 * get_rank()), PETSC_DECIDE, PETSC_DETERMINE, modes, nullptr, shapes.out()));
  PetscInt first = 0, end = 0;
  petsc::check(MatGetOwnershipRange(shapes, &first, &end));
  for (PetscInt row = first; row < end; ++row)
    for (PetscInt column = 0; column < modes; ++column)
      petsc::check(MatSetValue(shapes, row, column, value_at(row, column), INSERT_VALUES));
  petsc::check(MatAssemblyBegin(shapes, MAT_FINAL_ASSEMBLY));
  petsc::check(MatAssemblyEnd(shapes, MAT_FINAL_ASSEMBLY));
  return shapes;
}

TEST(Gather, brings_the_wanted_rows_in_their_order_and_zeros_for_held_nodes) {
  constexpr PetscInt kModes = 4;
  const auto shapes = make_shapes(kModes);
  PetscInt rows = 0;
  petsc::check(MatGetSize(shapes, &rows, nullptr));
  const auto nodes = static_cast<std::int32_t>(rows / 3);
  std::vector<std::int32_t> wanted;
  if (get_rank() == 0) wanted = {nodes - 1, -1, 0, nodes / 2, 0};
  const std::vector<double> gathered = gather_shapes(MPI_COMM_WORLD, shapes, wanted);
  if (get_rank() != 0) {
    EXPECT_TRUE(gathered.empty());
    return;
  }
  ASSERT_EQ(gathered.size(), wanted.size() * kModes * 3);
  for (std::size_t v = 0; v < wanted.size(); ++v)
    for (PetscInt m = 0; m < kModes; ++m)
      for (int d = 0; d < 3; ++d)
        EXPECT_EQ(gathered[(v * kModes + m) * 3 + d], wanted[v] < 0 ? 0.0 : value_at(3 * wanted[v] + d, m)) << v << ' ' << m << ' ' << d;
}

TEST(Gather, of_no_modes_is_empty) { EXPECT_TRUE(gather_shapes(MPI_COMM_WORLD, nullptr, {0, 1, 2}).empty()); }

TEST(Stations, take_the_seconds_of_the_slowest_rank_and_the_memory_of_all) {
  Stations stations(MPI_COMM_WORLD, true);
  stations.begin("sleep", "the last rank is slow");
  int ranks = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  if (get_rank() == ranks - 1) {
    const double start = MPI_Wtime();
    while (MPI_Wtime() < start + 0.05) {
    }
  }
  const Station& station = stations.end();
  EXPECT_GE(station.seconds, 0.05);
  EXPECT_GT(station.peak_bytes, 1 << 20);
  EXPECT_GE(station.peak_sum_bytes, station.peak_bytes);
  EXPECT_LE(station.peak_sum_bytes, ranks * station.peak_bytes);
}

TEST(Record, names_every_library_with_a_version) {
  for (const auto& [name, version] : find_versions())
    EXPECT_NE(version.find_first_of("0123456789"), std::string::npos) << name << ": " << version;
  EXPECT_EQ(find_versions().size(), 6u);
  const std::string id = git_id();
  EXPECT_TRUE(id == "unknown" || id.find_first_not_of("0123456789abcdef") == std::string::npos || id.ends_with("-dirty")) << id;
}

}  // namespace
}  // namespace carillon::io
