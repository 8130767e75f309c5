// The factorisation and its solves on a simulated cluster: smpirun ... simulate_ldlt.so MESH [COLUMNS [REPEATS]]. Order, mapping, plan,
// factorisation and solves are the real ones, with real numbers; SimGrid's MPI runs the ranks in turn and gives each a clock. Network
// and rates of a core: cluster.xml; kernels are charged by operations, copies by bytes. Not by CPU time: between messages lie microseconds,
// each with the caches of another rank. Prints one line of JSON; seconds are simulated.
#include <fmt/format.h>
#include <simgrid/host.h>
#include <sys/mman.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <numbers>
#include <string>
#include <vector>

#include "precompute/fem/assemble.hpp"
#include "precompute/ldlt/factor.hpp"
#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/mailbox.hpp"
#include "precompute/ldlt/shared.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "precompute/run/cut_mesh.hpp"

namespace {

// SimGrid 3.32 has no matched probes, and its probes poll: who waits for a letter would cost the simulation a call each microsecond. In
// place of a probe one receive is open at any time; it completes when a letter has come whole.
constexpr std::size_t kLargestLetter = std::size_t{1} << 27;  // numbers; pages that no letter needs are never touched
struct Inbox {
  double* letter = static_cast<double*>(
      mmap(nullptr, sizeof(double) * kLargestLetter, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0));
  MPI_Request open = MPI_REQUEST_NULL;
  MPI_Status status;
  bool has_come = false;
};
Inbox inboxes[2];

/// A number of the platform file that describes a core.
double read_core(const char* name) { return std::stod(sg_host_get_property_value(sg_host_self(), name)); }

struct Core {
  double own_flops = 1e9 * read_core("own_gflops");        // C -= L W^T of a front on one rank
  double shared_flops = 1e9 * read_core("shared_gflops");  // the same by tiles
  double panel_flops = 1e9 * read_core("panel_gflops");    // W = A L^-T
  double block_flops = 1e9 * read_core("block_gflops");    // diagonal blocks: n^3
  double solve_flops = 1e9 * read_core("solve_gflops");
  double solve_bytes = 1e9 * read_core("solve_gb_s");  // of L
  double copy_bytes = 1e9 * read_core("copy_gb_s");    // contributions, arriving messages, packing, unpacking
  double message_s = 1e-6 * read_core("message_us");   // to send one, or to receive it
};
const Core& find_core() {
  static const Core core;
  return core;
}

double owed_s = 0;  // charged, not yet on the simulated clock
/// Counters of a rank.
struct Done {
  double waited_s = 0;             // for messages
  double messages = 0, bytes = 0;  // sent
};
Done done;

/// Letters of factorisations (SharedFactoriser) are packed and unpacked. Solves do that by kernels, where they must.
bool is_letter(int tag) { return tag == carillon::ldlt::kLetterTag || tag == carillon::ldlt::kLetterTag + 1; }

/// Adds the charged time to the simulated clock.
void settle() {
  if (owed_s > 0) smpi_execute(owed_s);
  owed_s = 0;
}
void charge_message(double bytes, int copies) { owed_s += find_core().message_s + copies * bytes / find_core().copy_bytes; }

void charge_arrival(const MPI_Status& status) {
  int count = 0;
  MPI_Get_count(&status, MPI_BYTE, &count);
  charge_message(count, 1);
}

template <typename Wait>
int wait_for(Wait&& wait) {
  settle();
  const double start = PMPI_Wtime();
  const int code = wait();
  done.waited_s += PMPI_Wtime() - start;
  return code;
}

Inbox& open_inbox(int tag, MPI_Comm comm) {
  Inbox& inbox = inboxes[tag % 2];
  if (inbox.open == MPI_REQUEST_NULL && !inbox.has_come)
    PMPI_Irecv(inbox.letter, kLargestLetter, MPI_DOUBLE, MPI_ANY_SOURCE, tag, comm, &inbox.open);
  return inbox;
}

}  // namespace

int MPI_Improbe(int, int tag, MPI_Comm comm, int* has_come, MPI_Message* message, MPI_Status* status) {
  settle();
  Inbox& inbox = open_inbox(tag, comm);
  int is_done = inbox.has_come ? 1 : 0;
  if (!inbox.has_come) PMPI_Test(&inbox.open, &is_done, &inbox.status);
  *has_come = is_done;
  inbox.has_come = is_done != 0;
  *status = inbox.status;
  *message = &inbox;
  return MPI_SUCCESS;
}
int MPI_Mrecv(void* to, int count, MPI_Datatype, MPI_Message* message, MPI_Status*) {
  auto* inbox = static_cast<Inbox*>(*message);
  std::memcpy(to, inbox->letter, sizeof(double) * static_cast<std::size_t>(count));
  inbox->has_come = false;
  charge_message(sizeof(double) * static_cast<double>(count), 2);  // as it arrives, and to unpack it
  return MPI_SUCCESS;
}
int MPI_Isend(const void* from, int count, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request* request) {
  int size = 0;
  MPI_Type_size(type, &size);
  const double bytes = static_cast<double>(count) * size;
  ++done.messages;
  done.bytes += bytes;
  charge_message(bytes, is_letter(tag) ? 1 : 0);  // to pack it
  settle();
  return PMPI_Isend(from, count, type, to, tag, comm, request);
}
// Solves wait for one message at a time, and ignore its status.
MPI_Request expected = MPI_REQUEST_NULL;
int MPI_Irecv(void* to, int count, MPI_Datatype type, int from, int tag, MPI_Comm comm, MPI_Request* request) {
  const int code = PMPI_Irecv(to, count, type, from, tag, comm, request);
  expected = *request;
  return code;
}
int MPI_Test(MPI_Request* request, int* has_come, MPI_Status* status) {
  if (*request != expected) return PMPI_Test(request, has_come, status);  // of something sent
  settle();
  MPI_Status arrived;
  const int code = PMPI_Test(request, has_come, &arrived);
  if (*has_come != 0) charge_arrival(arrived);
  return code;
}
int MPI_Wait(MPI_Request* request, MPI_Status*) {
  MPI_Status arrived;
  const int code = wait_for([&] { return PMPI_Wait(request, &arrived); });
  charge_arrival(arrived);
  return code;
}
int MPI_Waitall(int count, MPI_Request* requests, MPI_Status* statuses) {
  return wait_for([&] { return PMPI_Waitall(count, requests, statuses); });
}
int MPI_Iallreduce(const void* from, void* to, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm, MPI_Request* request) {
  settle();
  return PMPI_Iallreduce(from, to, count, type, op, comm, request);
}
int MPI_Allreduce(const void* from, void* to, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm) {
  return wait_for([&] { return PMPI_Allreduce(from, to, count, type, op, comm); });
}
double MPI_Wtime() {
  settle();
  return PMPI_Wtime();
}
int MPI_Barrier(MPI_Comm comm) {
  settle();
  return PMPI_Barrier(comm);
}

namespace carillon {

namespace petsc {
void check(PetscErrorCode code) {
  if (code != 0) throw SolveError("this body needs a part of PETSc that is not simulated");
}
comm::Communicator get_communicator(PetscObject object) { return {object->comm}; }
void add_flops(double /*flops*/) {}
}  // namespace petsc

// Kernels that charge for their work. factor_kernels.cpp and solve_kernels.cpp define those that they call, under these names.
namespace ldlt {
const FactorKernels& find_real_factor_kernels();
const SolveKernels& find_real_solve_kernels();

const FactorKernels& find_factor_kernels() {
  static const FactorKernels& real = find_real_factor_kernels();
  static const FactorKernels counted{
      .factorise_block =
          [](double* block, int n, BlockPivots& pivots, double* tiles) {
            owed_s += double(n) * n * n / find_core().block_flops;
            return real.factorise_block(block, n, pivots, tiles);
          },
      .trsm =
          [](const double* const* columns, int begin, int end, int n, const double* triangle, double* wide) {
            owed_s += double(end - begin) * n * n / find_core().panel_flops;
            real.trsm(columns, begin, end, n, triangle, wide);
          },
      .scale_by_d_inverse =
          [](const double* wide, int begin, int m, int n, const BlockPivots& pivots, double* tiles, double& growth) {
            owed_s += 16.0 * m * n / find_core().copy_bytes;
            real.scale_by_d_inverse(wide, begin, m, n, pivots, tiles, growth);
          },
      .update =
          [](const Panel& panel, int pivots, int end, bool is_made, double* const* columns) {
            const double m = end - panel.begin;
            owed_s += m * (m + 1) * panel.n / find_core().own_flops;
            real.update(panel, pivots, end, is_made, columns);
          },
      .update_columns =
          [](const double* tiles, int width, const double* wide, int begin, int end, int n, double* const* columns) {
            owed_s += 2.0 * (end - begin) * width * n / find_core().shared_flops;
            real.update_columns(tiles, width, wide, begin, end, n, columns);
          },
      .extend_add =
          [](const double* const* source, const RowRun* runs, int count, double* const* target) {
            for (int r = 0; r < count; ++r) owed_s += 3.0 * sizeof(double) * runs[r].length / find_core().copy_bytes;
            real.extend_add(source, runs, count, target);
          },
  };
  return counted;
}

double calc_product_s(double m, double n, int vectors) {
  return std::max(16 * m * n * vectors / find_core().solve_flops, 8 * m * n / find_core().solve_bytes);
}

const SolveKernels& find_solve_kernels() {
  static const SolveKernels& real = find_real_solve_kernels();
  static SolveKernels counted = real;
  counted.subtract_product = [](const double* tiles, int m, int n, int vectors, const double* in, const int* nodes, double* x) {
    owed_s += calc_product_s(m, n, vectors);
    real.subtract_product(tiles, m, n, vectors, in, nodes, x);
  };
  counted.subtract_transposed = [](const double* tiles, int m, int n, int vectors, const int* nodes, double* x, double* out,
                                   const double* next) {
    owed_s += calc_product_s(m, n, vectors);
    real.subtract_transposed(tiles, m, n, vectors, nodes, x, out, next);
  };
  counted.trmm = [](const double* tiles, int n, int vectors, const double* in, double* out) {
    owed_s += calc_product_s(n, 0.5 * n, vectors);
    real.trmm(tiles, n, vectors, in, out);
  };
  counted.add_trmm_transposed = [](const double* tiles, int n, int vectors, double* in, double* out, const double* next) {
    owed_s += calc_product_s(n, 0.5 * n, vectors);
    real.add_trmm_transposed(tiles, n, vectors, in, out, next);
  };
  counted.copy = [](const double* from, long count, double* to) {
    owed_s += static_cast<double>(sizeof(double) * count) / find_core().copy_bytes;
    real.copy(from, count, to);
  };
  counted.add = [](const double* from, long count, double* to) {
    owed_s += static_cast<double>(sizeof(double) * count) / find_core().copy_bytes;
    real.add(from, count, to);
  };
  return counted;
}
}  // namespace ldlt

// Other waits than for a letter last 20 us of simulated time.
void ldlt::Mailbox::rest(bool is_expecting) {
  if (!is_expecting) {
    wait_for([] { return usleep(20); });  // simulated
    return;
  }
  Inbox& inbox = open_inbox(tag_, comm_);
  wait_for([&] { return PMPI_Wait(&inbox.open, &inbox.status); });
  inbox.has_come = true;
}

namespace {

/// Cost of `work` as JSON: simulated seconds until the last rank is done and those that a rank has waited, on average; messages and bytes
/// of all ranks.
template <typename Work>
std::string measure(const comm::Communicator& comm, Work&& work) {
  MPI_Barrier(comm);
  const double start = MPI_Wtime();
  done = {};
  work();
  settle();
  const Done own = done;
  MPI_Barrier(comm);
  const double seconds = MPI_Wtime() - start;
  double sums[3] = {own.waited_s, own.messages, own.bytes};
  comm.sum(sums);
  return fmt::format("{{\"s\": {:.6f}, \"waited_s\": {:.6f}, \"messages\": {}, \"bytes\": {}}}", seconds, sums[0] / comm.size(), sums[1],
                     sums[2]);
}

std::string join(const std::vector<std::string>& texts) { return fmt::format("[{}]", fmt::join(texts, ", ")); }

void simulate(const std::string& file, int columns, int repeats) {
  const comm::Communicator comm(MPI_COMM_WORLD);
  mesh::TetMesh body;
  comm.agree([&] {
    if (comm.is_root()) body = mesh::read_mesh(file);
  });
  run::CutMesh cut = run::cut_by_order(comm, body, {});
  material::Material ceramic;
  ceramic.young_modulus_pa = 5.4543e9;
  ceramic.poisson_ratio = 0.3303;
  ceramic.density_kg_m3 = 2700;
  const fem::System system = fem::assemble(comm, cut.pieces.local, ceramic, job::Mass::consistent);
  ldlt::Factor factor(la::Pencil{system.stiffness, system.mass}, cut.order.get());
  const double omega = 2 * std::numbers::pi * 12'000.0;
  std::vector<std::string> factorisations, solves;
  bool is_good = true;
  for (int repeat = 0; repeat < repeats; ++repeat)
    factorisations.push_back(measure(comm, [&] { is_good = factor.factorise(omega * omega) && is_good; }));
  const std::int64_t negative = factor.get_negative_pivots();
  const bool is_agreed = comm.min(negative) == comm.max(negative);
  // Right-hand sides by the numbers of the mesh, so that any number of ranks solves for the same.
  const mesh::LocalMesh& local = cut.pieces.local;
  const int rows = 3 * local.free_nodes;
  std::vector<double> b(static_cast<std::size_t>(rows) * columns), x(b.size());
  for (int c = 0; c < columns; ++c)
    for (int i = 0; i < rows; ++i) b[static_cast<std::size_t>(c) * rows + i] = std::sin(3.0 * local.node_in_mesh[i / 3] + i % 3 + 0.1 * c);
  for (int repeat = 0; repeat < repeats; ++repeat)
    solves.push_back(measure(comm, [&] { factor.solve(b.data(), x.data(), std::max(rows, 1), columns); }));
  // Moments that no two solutions share.
  double sums[2] = {0, 0};
  for (int c = 0; c < columns; ++c)
    for (int i = 0; i < rows; ++i) {
      const double value = x[static_cast<std::size_t>(c) * rows + i];
      sums[0] += value * std::cos(1.7 * local.node_in_mesh[i / 3] + i % 3 + c);
      sums[1] += value * value;
    }
  comm.sum(sums);
  const ldlt::Analysis& analysis = factor.get_analysis();
  double busiest = 0, fullest = 0;
  for (const ldlt::Analysis::Rank& rank : analysis.ranks) {
    busiest = std::max(busiest, rank.flops);
    fullest = std::max(fullest, static_cast<double>(rank.entries));
  }
  if (comm.is_root())
    fmt::print(
        "{{\"ranks\": {}, \"unknowns\": {}, \"factorisations\": {}, \"solves\": {}, "
        "\"columns\": {}, \"operations\": {:.6g}, \"entries\": {}, \"busiest\": {:.4f}, \"fullest\": {:.4f}, \"shared_fronts\": {}, "
        "\"is_good\": {}, \"is_agreed\": {}, \"negative\": {}, \"backward_error\": {:.3g}, \"moment\": {:.16e}, \"norm\": {:.16e}}}\n",
        comm.size(), 3 * cut.pieces.free_nodes, join(factorisations), join(solves), columns, analysis.flops, analysis.entries,
        busiest * comm.size() / analysis.flops, fullest * comm.size() / static_cast<double>(analysis.entries), analysis.shared_fronts,
        is_good, is_agreed, negative, factor.get_backward_error(), sums[0], std::sqrt(sums[1]));
}

}  // namespace
}  // namespace carillon

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  try {
    carillon::simulate(argv[1], argc > 2 ? std::stoi(argv[2]) : 16, argc > 3 ? std::stoi(argv[3]) : 2);
  } catch (const std::exception& error) {
    fmt::print(stderr, "simulate_ldlt: {}\n", error.what());
    MPI_Abort(MPI_COMM_WORLD, 1);
  }
  MPI_Finalize();
}
