// Method:     One factorisation of K - sigma M, sigma = -1e-5 lambda, for free and held bodies alike: the response on modes of lambda_j is
//   1 / (lambda_j + 1e-5 lambda) instead of 1 / lambda_j. The remaining quadratic strain is minimal at the exact theta, so a relative error
//   of 1e-5 in theta is 1e-10 in its energy.
// Source:     docs/equations.md E13.
// Deviations: the shift.
#include "precompute/coupling/static_answer.hpp"

#include <algorithm>

#include "precompute/eigen/memory.hpp"
#include "precompute/la/node_matrix.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::coupling {
namespace {

constexpr double kShift = -1e-5;

std::unique_ptr<eigen::ShiftedFactor> factorise(const comm::Communicator& comm, const la::Pencil& pencil, double sigma) {
  for (const bool mumps : {false, true}) {
    std::unique_ptr<eigen::ShiftedFactor> factor = mumps ? eigen::make_mumps_factor(pencil, {}) : eigen::make_ldlt_factor(pencil);
    eigen::check_memory(comm, factor->get_peak_bytes(), 0, "The factorisation of K");
    if (factor->factorise(sigma)) return factor;
  }
  throw SolveError("K cannot be factorised: the mesh has nodes without stiffness");
}

void read_own(const Nodal& nodal, const la::Columns& columns) {
  for (std::ptrdiff_t row = 0; row < columns.rows; ++row)
    for (int j = 0; j < columns.count; ++j) columns.column(j)[row] = nodal[row * columns.count + j];
}

void write_own(const la::Columns& columns, Nodal& nodal) {
  for (std::ptrdiff_t row = 0; row < columns.rows; ++row)
    for (int j = 0; j < columns.count; ++j) nodal[row * columns.count + j] = columns.column(j)[row];
}

}  // namespace

comm::HaloExchange make_halo(const comm::Communicator& comm, const mesh::LocalMesh& local) {
  const comm::IndexPartition owners(comm, local.free_nodes);
  std::vector<std::int32_t> numbers, places;
  for (std::size_t i = local.owned_nodes; i < local.row.size(); ++i) {
    if (local.row[i] < 0) continue;
    numbers.push_back(local.row[i]);
    places.push_back(static_cast<std::int32_t>(i));
  }
  return {comm, owners, numbers, places};
}

Nodal spread(const comm::Communicator& comm, comm::HaloExchange& halo, const mesh::LocalMesh& local, const la::Columns& columns) {
  Nodal nodal = comm.agree([&] { return Nodal(3 * local.nodes_m.size() * static_cast<std::size_t>(columns.count), 0.0); });
  write_own(columns, nodal);
  halo.copy_to_halo(nodal.data(), 3 * columns.count);
  return nodal;
}

StaticAnswer::StaticAnswer(const comm::Communicator& comm, const mesh::LocalMesh& local, Mat stiffness, Mat mass, const la::Columns& kept,
                           double lambda)
    : comm_(comm),
      local_(&local),
      halo_(make_halo(comm, local)),
      factor_(factorise(comm, {stiffness, mass}, kShift * lambda)),
      rows_(3 * static_cast<std::ptrdiff_t>(local.free_nodes)),
      kept_count_(kept.count) {
  comm.agree([&] {
    kept_.resize(rows_ * kept.count);
    images_.resize(kept_.size());
    for (int j = 0; j < kept.count; ++j) std::copy_n(kept.column(j), rows_, kept_.data() + j * rows_);
  });
  const la::NodeMatrix mass_by_nodes(mass);
  mass_by_nodes.multiply({kept_.data(), rows_, rows_, kept_count_}, {images_.data(), rows_, rows_, kept_count_});
}

la::Matrix StaticAnswer::solve(Nodal& loads, int width) {
  halo_.sum_to_owner(loads.data(), 3 * width);
  std::vector<double> values = comm_.agree([&] { return std::vector<double>(rows_ * width); });
  const la::Columns columns{values.data(), rows_, rows_, width};
  const la::Columns kept{kept_.data(), rows_, rows_, kept_count_}, images{images_.data(), rows_, rows_, kept_count_};
  read_own(loads, columns);
  const la::Matrix work = la::multiply_transposed(comm_, kept, columns);
  factor_->solve(values.data(), values.data(), rows_, width);
  const la::Matrix share = la::multiply_transposed(comm_, images, columns);
  la::subtract_product(kept, share.data(), kept_count_, columns);
  write_own(columns, loads);
  for (std::size_t i = 0; i < local_->row.size(); ++i)
    if (local_->row[i] < 0) std::fill_n(loads.begin() + static_cast<std::ptrdiff_t>(i) * 3 * width, 3 * width, 0.0);
  halo_.copy_to_halo(loads.data(), 3 * width);
  return work;
}

}  // namespace carillon::coupling
