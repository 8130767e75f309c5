// The part of PETSc that the factorisation needs, for a simulated MPI: Debian's PETSc is bound to Open MPI. AIJ matrices on given arrays,
// vectors, products, norms. Names are PETSc's; functions return 0, or 1 where nothing is behind them.
#pragma once

#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "precompute/comm/halo_exchange.hpp"

using PetscInt = int;
using PetscScalar = double;
using PetscReal = double;
using PetscErrorCode = int;
enum PetscBool { PETSC_FALSE, PETSC_TRUE };
enum NormType { NORM_INFINITY };
enum MatDuplicateOption { MAT_COPY_VALUES };
enum MatOption { MAT_SYMMETRIC, MAT_SYMMETRY_ETERNAL, MAT_SPD };
inline constexpr PetscInt PETSC_DETERMINE = -1;
inline constexpr const char* MATMPIAIJ = "mpiaij";
inline constexpr const char* MATSEQAIJ = "seqaij";

struct SimulatedObject {
  MPI_Comm comm = MPI_COMM_NULL;
};
/// Rows of one rank, or their columns on this rank or on others.
struct SimulatedMatrix : SimulatedObject {
  PetscInt first = 0, rows = 0, columns = 0;
  const PetscInt* begin = nullptr;
  const PetscInt* column = nullptr;
  const double* value = nullptr;
  SimulatedMatrix* parts[2] = {nullptr, nullptr};  // of a parallel matrix: own columns, those of others
  std::vector<PetscInt> ghosts, place;             // global columns of others, ascending; of each entry
  carillon::comm::HaloExchange halo;
};
struct SimulatedVector : SimulatedObject {
  PetscInt first = 0;
  std::vector<double> own;
  double* values = nullptr;
};
using PetscObject = SimulatedObject*;
using PetscContainer = SimulatedObject*;
using Mat = SimulatedMatrix*;
using Vec = SimulatedVector*;
using IS = SimulatedObject*;
using VecScatter = SimulatedObject*;
using EPS = SimulatedObject*;
using BV = SimulatedObject*;

inline PetscErrorCode MatDestroy(Mat* matrix) {
  for (Mat part : (*matrix)->parts) delete part;
  delete *matrix;
  return 0;
}
inline PetscErrorCode VecDestroy(Vec* vector) {
  delete *vector;
  return 0;
}
inline PetscErrorCode ISDestroy(IS*) { return 1; }
inline PetscErrorCode VecScatterDestroy(VecScatter*) { return 1; }
inline PetscErrorCode EPSDestroy(EPS*) { return 1; }
inline PetscErrorCode BVDestroy(BV*) { return 1; }

// ---- matrices ----

inline PetscErrorCode MatCreateSeqAIJWithArrays(MPI_Comm comm, PetscInt rows, PetscInt columns, PetscInt* begin, PetscInt* column,
                                                double* value, Mat* out) {
  *out = new SimulatedMatrix;
  (*out)->comm = comm;
  (*out)->rows = rows;
  (*out)->columns = columns;
  (*out)->begin = begin;
  (*out)->column = column;
  (*out)->value = value;
  return 0;
}
inline PetscErrorCode MatCreateMPIAIJWithSplitArrays(MPI_Comm comm, PetscInt rows, PetscInt columns, PetscInt, PetscInt, PetscInt* begin,
                                                     PetscInt* column, double* value, PetscInt* ghost_begin, PetscInt* ghost_column,
                                                     double* ghost_value, Mat* out) {
  MatCreateSeqAIJWithArrays(comm, rows, columns, begin, column, value, out);
  SimulatedMatrix& matrix = **out;
  const carillon::comm::IndexPartition owners(comm, rows);
  matrix.first = static_cast<PetscInt>(owners.own_begin());
  const std::span entries(ghost_column, static_cast<std::size_t>(ghost_begin[rows]));
  matrix.ghosts.assign(entries.begin(), entries.end());
  std::sort(matrix.ghosts.begin(), matrix.ghosts.end());
  matrix.ghosts.erase(std::unique(matrix.ghosts.begin(), matrix.ghosts.end()), matrix.ghosts.end());
  for (const PetscInt entry : entries)
    matrix.place.push_back(
        static_cast<PetscInt>(std::lower_bound(matrix.ghosts.begin(), matrix.ghosts.end(), entry) - matrix.ghosts.begin()));
  MatCreateSeqAIJWithArrays(comm, rows, columns, begin, column, value, &matrix.parts[0]);
  MatCreateSeqAIJWithArrays(comm, rows, static_cast<PetscInt>(matrix.ghosts.size()), ghost_begin, matrix.place.data(), ghost_value,
                            &matrix.parts[1]);
  std::vector<PetscInt> places;
  for (std::size_t g = 0; g < matrix.ghosts.size(); ++g) places.push_back(rows + static_cast<PetscInt>(g));
  matrix.halo = carillon::comm::HaloExchange(carillon::comm::Communicator(comm), owners, matrix.ghosts, places);
  matrix.halo.reserve(sizeof(double));
  return 0;
}
inline PetscErrorCode MatSetBlockSize(Mat, PetscInt) { return 0; }
inline PetscErrorCode MatSetOption(Mat, MatOption, PetscBool) { return 0; }
inline PetscErrorCode MatGetOwnershipRange(Mat matrix, PetscInt* begin, PetscInt* end) {
  *begin = matrix->first;
  *end = matrix->first + matrix->rows;
  return 0;
}
inline PetscErrorCode MatGetSize(Mat matrix, PetscInt*, PetscInt* columns) {
  *columns = matrix->columns;
  return 0;
}
inline PetscErrorCode MatGetLocalSize(Mat matrix, PetscInt* rows, PetscInt*) {
  *rows = matrix->rows;
  return 0;
}
inline PetscErrorCode PetscObjectBaseTypeCompare(PetscObject object, const char* type, PetscBool* is_same) {
  const bool is_parallel = static_cast<Mat>(object)->parts[0] != nullptr;
  *is_same = std::strcmp(type, is_parallel ? MATMPIAIJ : MATSEQAIJ) == 0 ? PETSC_TRUE : PETSC_FALSE;
  return 0;
}
inline PetscErrorCode MatMPIAIJGetSeqAIJ(Mat matrix, Mat* own, Mat* ghost, const PetscInt** ghosts) {
  *own = matrix->parts[0];
  *ghost = matrix->parts[1];
  *ghosts = matrix->ghosts.data();
  return 0;
}
inline PetscErrorCode MatGetRowIJ(Mat matrix, PetscInt, PetscBool, PetscBool, PetscInt*, const PetscInt** begin, const PetscInt** column,
                                  PetscBool* is_done) {
  *begin = matrix->begin;
  *column = matrix->column;
  *is_done = PETSC_TRUE;
  return 0;
}
inline PetscErrorCode MatRestoreRowIJ(Mat, PetscInt, PetscBool, PetscBool, PetscInt*, const PetscInt**, const PetscInt**, PetscBool*) {
  return 0;
}
inline PetscErrorCode MatSeqAIJGetArrayRead(Mat matrix, const double** value) {
  *value = matrix->value;
  return 0;
}
inline PetscErrorCode MatSeqAIJRestoreArrayRead(Mat, const double**) { return 0; }
// Copies for bodies whose stiffness spans six decades: not simulated.
inline PetscErrorCode MatDuplicate(Mat, MatDuplicateOption, Mat*) { return 1; }
inline PetscErrorCode MatDiagonalScale(Mat, Vec, Vec) { return 1; }

/// Calls visit(matrix, row) for the parts of each row.
template <typename Visit>
void for_rows(Mat matrix, Visit&& visit) {
  for (PetscInt i = 0; i < matrix->rows; ++i) {
    visit(*matrix, i);
    if (matrix->parts[1] != nullptr) visit(*matrix->parts[1], i);
  }
}
inline PetscErrorCode MatGetDiagonal(Mat matrix, Vec diagonal) {
  for (PetscInt i = 0; i < matrix->rows; ++i)
    for (PetscInt k = matrix->begin[i]; k < matrix->begin[i + 1]; ++k)
      if (matrix->column[k] == i) diagonal->values[i] = matrix->value[k];
  return 0;
}
inline PetscErrorCode MatNorm(Mat matrix, NormType, double* norm) {
  std::vector<double> sums(static_cast<std::size_t>(matrix->rows) + 1);
  for_rows(matrix, [&](const SimulatedMatrix& part, PetscInt i) {
    for (PetscInt k = part.begin[i]; k < part.begin[i + 1]; ++k) sums[i] += std::abs(part.value[k]);
  });
  *norm = carillon::comm::Communicator(matrix->comm).max(*std::max_element(sums.begin(), sums.end()));
  return 0;
}
inline PetscErrorCode MatMult(Mat matrix, Vec x, Vec y) {
  std::vector<double> values(x->values, x->values + matrix->rows);
  values.resize(values.size() + matrix->ghosts.size());
  matrix->halo.copy_to_halo(values.data(), 1);
  std::fill_n(y->values, matrix->rows, 0.0);
  for_rows(matrix, [&](const SimulatedMatrix& part, PetscInt i) {
    const double* from = values.data() + (&part == matrix ? 0 : matrix->rows);
    for (PetscInt k = part.begin[i]; k < part.begin[i + 1]; ++k) y->values[i] += part.value[k] * from[part.column[k]];
  });
  return 0;
}

// ---- vectors ----

inline Vec make_simulated(MPI_Comm comm, PetscInt first, PetscInt rows) {
  Vec vector = new SimulatedVector;
  vector->comm = comm;
  vector->first = first;
  vector->own.resize(rows);
  vector->values = vector->own.data();
  return vector;
}
inline PetscErrorCode MatCreateVecs(Mat matrix, Vec* x, Vec* y) {
  for (Vec* vector : {x, y})
    if (vector != nullptr) *vector = make_simulated(matrix->comm, matrix->first, matrix->rows);
  return 0;
}
inline PetscErrorCode VecDuplicate(Vec vector, Vec* out) {
  *out = make_simulated(vector->comm, vector->first, static_cast<PetscInt>(vector->own.size()));
  return 0;
}
inline PetscErrorCode VecGetOwnershipRange(Vec vector, PetscInt* begin, PetscInt* end) {
  *begin = vector->first;
  *end = vector->first + static_cast<PetscInt>(vector->own.size());
  return 0;
}
inline PetscErrorCode VecGetLocalSize(Vec vector, PetscInt* rows) {
  *rows = static_cast<PetscInt>(vector->own.size());
  return 0;
}
inline PetscErrorCode VecGetArray(Vec vector, double** values) {
  *values = vector->values;
  return 0;
}
inline PetscErrorCode VecRestoreArray(Vec, double**) { return 0; }
inline PetscErrorCode VecGetArrayRead(Vec vector, const double** values) {
  *values = vector->values;
  return 0;
}
inline PetscErrorCode VecRestoreArrayRead(Vec, const double**) { return 0; }
inline PetscErrorCode VecPlaceArray(Vec vector, const double* values) {
  vector->values = const_cast<double*>(values);
  return 0;
}
inline PetscErrorCode VecResetArray(Vec vector) {
  vector->values = vector->own.data();
  return 0;
}
inline PetscErrorCode VecCopy(Vec x, Vec y) {
  std::copy_n(x->values, x->own.size(), y->values);
  return 0;
}
inline PetscErrorCode VecScale(Vec x, double factor) {
  for (std::size_t i = 0; i < x->own.size(); ++i) x->values[i] *= factor;
  return 0;
}
inline PetscErrorCode VecAXPY(Vec y, double factor, Vec x) {
  for (std::size_t i = 0; i < x->own.size(); ++i) y->values[i] += factor * x->values[i];
  return 0;
}
inline PetscErrorCode VecNorm(Vec x, NormType, double* norm) {
  double largest = 0;
  for (std::size_t i = 0; i < x->own.size(); ++i) largest = std::max(largest, std::abs(x->values[i]));
  *norm = carillon::comm::Communicator(x->comm).max(largest);
  return 0;
}

// ---- owners of the arrays of a matrix: these live to the end of the program ----

inline PetscErrorCode PetscContainerCreate(MPI_Comm, PetscContainer*) { return 0; }
inline PetscErrorCode PetscContainerSetPointer(PetscContainer, void*) { return 0; }
inline PetscErrorCode PetscContainerSetUserDestroy(PetscContainer, PetscErrorCode (*)(void*)) { return 0; }
inline PetscErrorCode PetscObjectCompose(PetscObject, const char*, PetscObject) { return 0; }
inline PetscErrorCode PetscContainerDestroy(PetscContainer*) { return 0; }
