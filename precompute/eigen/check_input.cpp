#include "precompute/eigen/check_input.hpp"

#include <fmt/core.h>

#include <cmath>

#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {

using petsc::check;

void check_input(const Problem& problem, const Options& options) {
  if (problem.stiffness == nullptr || problem.mass == nullptr) throw InputError("The eigenproblem lacks its stiffness or mass matrix.");
  if (!(options.high_hz > options.low_hz) || !(options.low_hz >= 0) || !std::isfinite(options.high_hz)) {
    throw InputError(fmt::format("The band {} .. {} Hz is empty or negative: give two frequencies, the lower one first.", options.low_hz,
                                 options.high_hz));
  }
  if (options.max_modes && *options.max_modes < 1)
    throw InputError(fmt::format("max_modes is {}: it must be at least 1.", *options.max_modes));
  if (!(options.tolerance > 0) || options.tolerance > 1e-2) {
    throw InputError(fmt::format("The tolerance {} is out of range: take one between 1e-14 and 1e-2.", options.tolerance));
  }
  const comm::Communicator comm = petsc::get_communicator(problem.stiffness);
  comm.agree([&] {
    PetscInt rows = 0, n = 0;
    check(MatGetLocalSize(problem.stiffness, &rows, nullptr));
    check(MatGetSize(problem.stiffness, &n, nullptr));
    if (options.method == Method::kDense && n > kMaxDenseUnknowns)
      throw InputError(fmt::format("LAPACK solves up to {} unknowns densely and there are {}: take another method.", kMaxDenseUnknowns, n));
    const NodeLayout& nodes = problem.nodes;
    if (static_cast<std::size_t>(rows) != 3 * nodes.nodes_m.size() || nodes.nodes_m.size() != nodes.component.size()) {
      throw InputError(fmt::format("The node layout has {} positions and {} components for {} rows of the stiffness matrix.",
                                   nodes.nodes_m.size(), nodes.component.size(), rows));
    }
    for (const std::int32_t c : nodes.component) {
      if (c < 0 || c >= nodes.component_count)
        throw InputError(fmt::format("Component {} is out of range: the layout has {}.", c, nodes.component_count));
    }
    const std::size_t order = nodes.elimination_position.size();
    if (comm.is_root() && order != 0 && 3 * order != static_cast<std::size_t>(n)) {
      throw InputError(fmt::format("The elimination order has {} of {} nodes.", order, n / 3));
    }
  });
}

}  // namespace carillon::eigen
