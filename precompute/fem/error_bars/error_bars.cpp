// Method: discretisation: modal strains are smoothed over patches of elements; the energy of the difference is about lambda_h - lambda,
//   since lambda_h - lambda = |u - u_h|_E^2 - lambda |u - u_h|_M^2 for a consistent mass and the second term is of higher order. Smoothed
//   strains miss errors common to a patch: the tractions on the free surface (recovery.cpp) are added for T10. A lumped mass adds lambda
//   phi^T (M_l - M) phi, known exactly. A smooth surface cut short by the mesh changes lambda by Hadamard's formula, integral (2 W - lambda
//   rho |u|^2) V_n dS. Cents: predict.cpp. Modes may change order: intervals of the k-th lowest follow from those of the modes.
// Source: Zienkiewicz and Zhu 1992, IJNME 33, 1331; Strang and Fix 1973, ch. 6; Hadamard 1908; algebraic part: algebraic.cpp.
// Deviations: the error energies are estimates, with measured safety factors (docs/error-bars.md).
#include "precompute/fem/error_bars/error_bars.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "precompute/fem/element.hpp"
#include "precompute/fem/error_bars/algebraic.hpp"
#include "precompute/fem/error_bars/order.hpp"
#include "precompute/fem/error_bars/recovery.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::error_bars {
namespace {

constexpr double kNegligible = 0.05;  // of the bar: doubts at some creases of a scan

void check_arguments(const comm::Communicator& comm, const mesh::LocalMesh& local, std::span<const Solid> solids,
                     std::span<const std::int32_t> material_of_tet, const Solution& solution) {
  comm.agree([&] {
    if (solids.empty()) throw InputError("error bars need a material");
    if (material_of_tet.empty() ? solids.size() > 1 : std::ssize(material_of_tet) != local.tet_count())
      throw InputError(fmt::format("{} elements have {} materials", local.tet_count(), material_of_tet.size()));
    for (const std::int32_t m : material_of_tet)
      if (m < 0 || m >= static_cast<std::int32_t>(solids.size())) throw InputError(fmt::format("there is no material {}", m));
    if (solution.residual.size() != solution.lambda.size())
      throw InputError(fmt::format("{} modes have {} residuals", solution.lambda.size(), solution.residual.size()));
    for (const double lambda : solution.lambda)
      if (!(lambda > 0)) throw InputError("error bars are for modes with a positive frequency");
    if (solution.lambda.empty()) return;
    PetscInt rows = 0, columns = 0, own = 0;
    petsc::check(MatGetLocalSize(solution.shapes, &own, nullptr));
    petsc::check(MatGetSize(solution.shapes, &rows, &columns));
    if (own != 3 * local.free_nodes || columns != static_cast<PetscInt>(solution.lambda.size()))
      throw InputError(fmt::format("{} rows and {} mode shapes do not fit {} nodes and {} modes", own, columns, local.free_nodes,
                                   solution.lambda.size()));
  });
}

/// Buffers of a block of modes.
struct Room {
  std::vector<FloatLanes> displacement;    // (nodes, 3), divided by omega; T4
  std::vector<DoubleLanes> displacement2;  // T10
  std::vector<Strain> strains;             // (e, s); T10
  std::vector<Strain> patches;             // (vertices * materials, t)
  std::vector<Strain> values;              // (nodes * materials); T4: the patches themselves
};

/// to: (nodes, 3, kLanes).
template <typename Number>
void load_displacement(const mesh::LocalMesh& local, const std::vector<std::int32_t>& place, const double* shapes, std::size_t stride,
                       std::size_t first, std::size_t count, const Solution& solution, Number* to) {
  std::array<const double*, kLanes> column{};
  std::array<double, kLanes> scale{};  // 0: an unused lane
  for (std::size_t m = 0; m < kLanes; ++m) {
    column[m] = shapes + (first + std::min(m, count - 1)) * stride;
    if (m < count) scale[m] = 1 / std::sqrt(solution.lambda[first + m]);
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(local.free_nodes); ++i) {
    Number* row = to + 3 * static_cast<std::size_t>(place[i]) * kLanes;
    for (std::size_t k = 3 * i; k < 3 * i + 3; ++k, row += kLanes)
      for (std::size_t m = 0; m < kLanes; ++m) row[m] = static_cast<Number>(column[m][k] * scale[m]);
  }
}

/// Sums of one block of modes over this rank's elements: error, energy, lumping, change, magnitude, the last two again for the alternative
/// surface, the error of singular elements, that of bent ones, and that of tractions on free faces.
constexpr int kSums = 10;
using Sums = std::array<DoubleLanes, kSums>;

Sums calc_block(const ElementKernels& kernels, Recovery& recovery, Room& room, job::Mass mass_kind, const DoubleLanes& lambda) {
  const Elements& elements = recovery.elements;
  Sums sums{};
  const void* displacement = room.displacement.data();
  if (elements.terms > 1) {
    recovery.nodes.copy_to_halo(room.displacement2.data()->lane, 3 * kLanes);
    displacement = room.displacement2.data();
  } else {
    recovery.nodes.copy_to_halo(reinterpret_cast<float*>(room.displacement.data()), 3 * kLanes);
  }
  std::fill(room.patches.begin(), room.patches.end(), Strain{});
  kernels.add_strains(elements, mass_kind == job::Mass::lumped, displacement, room.strains.data(), room.patches.data(), sums[2]);
  recovery.vertices.sum(reinterpret_cast<float*>(room.patches.data()),
                        static_cast<std::size_t>(elements.terms) * elements.materials * 6 * kLanes);
  const Strain* values = room.patches.data();
  if (elements.terms > 1) {
    for (std::size_t v = 0; v < recovery.vertex_node.size(); ++v)
      for (int m = 0; m < elements.materials; ++m)
        room.values[static_cast<std::size_t>(recovery.vertex_node[v]) * elements.materials + m] =
            room.patches[(v * elements.materials + m) * elements.terms];
    kernels.find_middles(recovery.middles, elements.materials, room.patches.data(), room.values.data());
    values = room.values.data();
  }
  kernels.add_energies(elements, recovery.value_of.data(), values, displacement, room.strains.data(), sums[0], sums[7], sums[8], sums[1]);
  kernels.add_shifts(recovery.shifts, values, displacement, lambda, sums[3], sums[4]);
  kernels.add_tractions(recovery.tractions, values, sums[9]);
  kernels.add_shifts(recovery.doubts, values, displacement, lambda, sums[5], sums[6]);
  for (int m = 0; m < kLanes; ++m) sums[2].lane[m] *= lambda.lane[m];
  return sums;
}

/// (modes, kSums), shares of lambda, summed over the ranks.
std::vector<double> calc_sums(const comm::Communicator& comm, const mesh::LocalMesh& local, Recovery& recovery, job::Mass mass_kind,
                              const Solution& solution) {
  const Elements& elements = recovery.elements;
  const std::size_t count = solution.lambda.size(), materials = elements.materials;
  Room room;
  std::vector<double> result(count * kSums, 0.0);
  comm.agree([&] {
    if (elements.terms > 1) {
      room.displacement2.resize(3 * local.nodes_m.size());
      room.strains.resize(elements.count * elements.samples);
    } else {
      room.displacement.resize(3 * local.nodes_m.size());
    }
    room.patches.resize(recovery.vertex_node.size() * materials * elements.terms);
    if (elements.terms > 1) room.values.resize(local.nodes_m.size() * materials);
    recovery.nodes.reserve(3 * kLanes * sizeof(double));
    recovery.vertices.reserve(static_cast<std::size_t>(elements.terms) * materials * 6 * kLanes * sizeof(float));
  });
  const ElementKernels& kernels = find_kernels(elements.nodes);
  PetscInt stride = 0;
  const PetscScalar* shapes = nullptr;
  petsc::check(MatDenseGetLDA(solution.shapes, &stride));
  petsc::check(MatDenseGetArrayRead(solution.shapes, &shapes));
  for (std::size_t first = 0; first < count; first += kLanes) {
    const std::size_t modes = std::min<std::size_t>(kLanes, count - first);
    DoubleLanes lambda{};
    for (std::size_t m = 0; m < modes; ++m) lambda.lane[m] = solution.lambda[first + m];
    const auto load = [&](auto* to) {
      load_displacement(local, recovery.place, shapes, static_cast<std::size_t>(stride), first, modes, solution, to);
    };
    elements.terms > 1 ? load(room.displacement2.data()->lane) : load(reinterpret_cast<float*>(room.displacement.data()));
    const Sums sums = calc_block(kernels, recovery, room, mass_kind, lambda);
    for (std::size_t m = 0; m < modes; ++m)
      for (int s = 0; s < kSums; ++s) result[(first + m) * kSums + s] = sums[s].lane[m];
  }
  petsc::check(MatDenseRestoreArrayRead(solution.shapes, &shapes));
  comm.sum(result);
  return result;
}

bool is_curved(const comm::Communicator& comm, const mesh::LocalMesh& local) {
  bool is_straight = true;
  if (local.order == 2)
    for (std::size_t e = 0; e < local.tets.size() && is_straight; e += 10) {
      std::array<Vec3, 10> x;
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = local.nodes_m[local.tets[e + i]];
      is_straight = fem::is_straight(x);
    }
  return !comm.all(is_straight);
}

}  // namespace

ErrorBars calc_error_bars(const comm::Communicator& comm, const mesh::LocalMesh& local, Mat stiffness, Mat mass,
                          std::span<const Solid> solids, std::span<const std::int32_t> material_of_tet, job::Mass mass_kind,
                          const Solution& solution) {
  check_arguments(comm, local, solids, material_of_tet, solution);
  ErrorBars bars;
  if (solution.lambda.empty()) return bars;
  bars.algebraic_cents = calc_algebraic_cents(comm, stiffness, mass, find_mass_bounds(comm, local, mass_kind), solution);
  Recovery recovery = make_recovery(comm, local, solids, material_of_tet, mass_kind);
  const std::vector<double> sums = calc_sums(comm, local, recovery, mass_kind, solution);
  Level& level = bars.level;
  level.kind = local.order == 1 ? Kind::kT4 : is_curved(comm, local) ? Kind::kT10Curved : Kind::kT10;
  level.is_lumped = mass_kind == job::Mass::lumped;
  level.lambda.assign(solution.lambda.begin(), solution.lambda.end());
  level.one_layer = recovery.one_layer;
  level.is_guessed = recovery.is_guessed;
  level.has_rims = recovery.has_rims;
  level.unlisted = {solution.high_hz, solution.low_hz, solution.below};
  OwnIntervals own;
  for (std::size_t m = 0; m < solution.lambda.size(); ++m) {
    const double* sum = &sums[m * kSums];
    ErrorParts parts;
    parts.interpolation = sum[0] + sum[9];
    parts.tractions = sum[9];
    parts.singular = sum[7];
    parts.bent = sum[8];
    parts.energy = sum[1];
    parts.lumping = sum[2];
    parts.geometry = sum[3];
    parts.geometry_noise = sum[4];
    parts.doubt = sum[5];
    parts.doubt_noise = sum[6];
    level.parts.push_back(parts);
    const double cents = calc_cents(parts, level.kind);
    parts.interpolation = parts.bent = 0.0;  // elements that cannot represent a mode are too stiff: the true value is lower
    own.stated.push_back(0.0);
    own.low.push_back(-cents);
    own.high.push_back(cents);
    own.above.push_back(calc_cents(parts, level.kind));
  }
  if (level.is_guessed && std::all_of(level.parts.begin(), level.parts.end(), [&](const ErrorParts& parts) {
        return calc_facet_cents(parts) < kNegligible * calc_cents(parts, level.kind);
      })) {
    for (ErrorParts& parts : level.parts) parts.doubt = parts.doubt_noise = 0.0;
    level.is_guessed = false;
  }
  bars.discretisation_cents = widen_for_order(solution.lambda, own, level.unlisted);
  bars.facet_cents = find_facet_cents(level, own, bars.discretisation_cents);
  bars.corrected = calc_corrections(level);
  if (is_too_short(level)) bars.discretisation_cents = bars.corrected.cents;
  return bars;
}

}  // namespace carillon::error_bars
