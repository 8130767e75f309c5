// Cost of L D L^T on a body: mpirun -np N bench_ldlt MESH [--mumps | --ptscotch]. The mesh is used as it is (T4 or T10), ceramic,
// consistent mass; seconds are CPU seconds of the slowest rank. --ptscotch: MUMPS with the parallel analysis of PT-SCOTCH, which PETSc's
// MUMPS lacks: with libmumps-ptscotch-5.5, LD_PRELOAD=libdmumps_ptscotch-5.5.so.
#include <fmt/core.h>
#include <petscksp.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <exception>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "precompute/fem/assemble.hpp"
#include "precompute/ldlt/factor.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/run/cut_mesh.hpp"

namespace {

using namespace carillon;

double find_cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Runs `work` and returns the CPU seconds of the slowest rank. Collective.
template <typename Work>
double measure_s(Work&& work) {
  MPI_Barrier(PETSC_COMM_WORLD);
  const double start = find_cpu_s();
  work();
  double own = find_cpu_s() - start;
  MPI_Allreduce(MPI_IN_PLACE, &own, 1, MPI_DOUBLE, MPI_MAX, PETSC_COMM_WORLD);
  return own;
}

void run_own(const fem::System& system, const ldlt::MeshOrder* order, double sigma, int rank) {
  const auto say = [rank](const std::string& line) {
    if (rank == 0) fmt::print("{}\n", line);
  };
  std::unique_ptr<ldlt::Factor> factor;
  say(fmt::format("analysis      {:7.3f} s", measure_s([&] {
                    factor = std::make_unique<ldlt::Factor>(la::Pencil{system.stiffness, system.mass}, order);
                  })));
  const ldlt::Analysis& analysis = factor->get_analysis();
  say(fmt::format("entries {:.4g}, flops {:.4g}, {} fronts, {} shared with {} pivot nodes, peak {:.3f} GB",
                  static_cast<double>(analysis.entries), analysis.flops, analysis.supernodes, analysis.shared_fronts, analysis.shared_nodes,
                  1e-9 * static_cast<double>(analysis.peak_bytes)));
  for (const ldlt::Analysis::Rank& part : analysis.ranks)
    say(fmt::format("  a rank: entries {:.4g}, flops {:.4g}, peak {:.3f} GB", static_cast<double>(part.entries), part.flops,
                    1e-9 * static_cast<double>(part.peak_bytes)));
  for (int repeat = 0; repeat < 3; ++repeat) {
    bool good = false;
    const double seconds = measure_s([&] { good = factor->factorise(sigma); });
    say(fmt::format("factorisation {:7.3f} s, {:.1f} GF/s, {}, {} negative pivots, backward error {:.2g}, growth {:.3g}", seconds,
                    1e-9 * analysis.flops / seconds, good ? "good" : "BAD", factor->get_negative_pivots(), factor->get_backward_error(),
                    factor->get_growth()));
  }
  PetscInt rows = 0;
  petsc::check(MatGetLocalSize(system.stiffness, &rows, nullptr));
  constexpr int kColumns = 64;
  std::vector<double> x(static_cast<std::size_t>(rows) * kColumns);
  for (const int width : {1, 8, 16, 32}) {
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::sin(static_cast<double>(i));
    const double seconds = measure_s([&] {
      for (int first = 0; first < kColumns; first += width) {
        double* block = x.data() + static_cast<std::size_t>(rows) * first;
        factor->solve(block, block, rows, width);
      }
    });
    say(fmt::format("solve by {:2}   {:7.2f} ms a column", width, 1e3 * seconds / kColumns));
  }
}

void run_mumps(const fem::System& system, double sigma, bool with_ptscotch, int rank) {
  petsc::MatHandle shifted;
  petsc::check(MatDuplicate(system.stiffness, MAT_COPY_VALUES, shifted.out()));
  petsc::check(MatAXPY(shifted, -sigma, system.mass, SUBSET_NONZERO_PATTERN));
  petsc::check(MatSetOption(shifted, MAT_SYMMETRIC, PETSC_TRUE));
  petsc::MatHandle factor;
  MatFactorInfo info;
  petsc::check(MatFactorInfoInitialize(&info));
  petsc::check(MatGetFactor(shifted, MATSOLVERMUMPS, MAT_FACTOR_CHOLESKY, factor.out()));
  petsc::check(MatMumpsSetIcntl(factor, 13, 1));
  if (with_ptscotch) petsc::check(MatMumpsSetIcntl(factor, 28, 2));
  if (with_ptscotch) petsc::check(MatMumpsSetIcntl(factor, 29, 1));
  const double analysis = measure_s([&] { petsc::check(MatCholeskyFactorSymbolic(factor, shifted, nullptr, &info)); });
  const auto factorise = [&] { petsc::check(MatCholeskyFactorNumeric(factor, shifted, &info)); };
  const double first = measure_s(factorise);  // with the pages
  const double second = measure_s(factorise);
  PetscInt negative = 0;
  PetscReal flops = 0;
  petsc::check(MatMumpsGetInfog(factor, 12, &negative));
  petsc::check(MatMumpsGetRinfog(factor, 3, &flops));
  PetscInt entries = 0;
  petsc::check(MatMumpsGetInfog(factor, 29, &entries));
  if (rank == 0)
    fmt::print(
        "MUMPS (order {}): analysis {:.3f} s, factorisation {:.3f} s, again {:.3f} s, entries {:.4g}, flops {:.4g}, {} negative "
        "pivots\n",
        with_ptscotch ? "of PT-SCOTCH" : "its own", analysis, first, second, entries < 0 ? -1e6 * entries : 1.0 * entries, flops, negative);
}

void measure_body(const std::string& file, const std::string& other, int rank) {
  mesh::TetMesh body;
  comm::Communicator(PETSC_COMM_WORLD).agree([&] {
    if (rank == 0) body = mesh::read_mesh(file);
  });
  run::CutMesh cut;
  const double order_s = measure_s([&] { cut = run::cut_by_order(PETSC_COMM_WORLD, body, {}); });
  if (rank == 0) fmt::print("order and cut {:7.3f} s\n", order_s);
  material::Material ceramic;
  ceramic.young_modulus_pa = 5.4543e9;
  ceramic.poisson_ratio = 0.3303;
  ceramic.density_kg_m3 = 2700;
  const fem::System system = fem::assemble(PETSC_COMM_WORLD, cut.pieces.local, ceramic, job::Mass::consistent);
  const double omega = 2 * std::numbers::pi * 12'000.0;
  run_own(system, cut.order.get(), omega * omega, rank);
  if (!other.empty()) run_mumps(system, omega * omega, other == "--ptscotch", rank);
}

}  // namespace

int main(int argc, char** argv) {
  const petsc::Session session(argc, argv);
  const std::string other = argc == 3 ? argv[2] : "";
  if (argc < 2 || argv[1][0] == '-' || argc > 3 || (argc == 3 && other != "--mumps" && other != "--ptscotch")) {
    if (session.rank() == 0) fmt::print(stderr, "usage: bench_ldlt MESH [--mumps | --ptscotch]\n");
    return 1;
  }
  try {
    measure_body(argv[1], other, session.rank());
  } catch (const std::exception& error) {
    if (session.rank() == 0) fmt::print(stderr, "bench_ldlt: {}\n", error.what());
    return 1;
  }
}
