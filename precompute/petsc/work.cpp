// Method:     The program brings its own MPI_Send and so on, which the linker prefers to the library's; each counts and goes on to the next
//             definition, the library's or that of a profiler in LD_PRELOAD.
// Source:     MPI 3.1, chapter 14 (profiling interface). Deviations: the next definition by dlsym(RTLD_NEXT) rather than PMPI_, so that
//             profilers still see the calls.
#include "precompute/petsc/work.hpp"

#include <dlfcn.h>
#include <petscsys.h>

#include <ctime>
#include <unordered_map>

// petscsys.h counts some of the calls by macros of the same names.
#undef MPI_Send
#undef MPI_Ssend
#undef MPI_Isend
#undef MPI_Issend
#undef MPI_Send_init
#undef MPI_Startall
#undef MPI_Start
#undef MPI_Allreduce
#undef MPI_Iallreduce
#undef MPI_Reduce
#undef MPI_Scan
#undef MPI_Exscan
#undef MPI_Bcast
#undef MPI_Barrier
#undef MPI_Ibarrier
#undef MPI_Allgather
#undef MPI_Allgatherv
#undef MPI_Gather
#undef MPI_Gatherv
#undef MPI_Scatter
#undef MPI_Scatterv
#undef MPI_Alltoall
#undef MPI_Alltoallv
#undef MPI_Recv
#undef MPI_Probe
#undef MPI_Wait
#undef MPI_Waitall
#undef MPI_Waitany
#undef MPI_Waitsome

namespace carillon::petsc {
namespace {

WorkTable totals{};
PhaseWork* phase_at_hand = totals.data();
double petsc_flops = 0;  // booked so far

/// PETSc counts on its own; what it has counted since the last look belongs to the phase at hand.
void book_petsc_flops() {
  PetscLogDouble all = 0;
  if (PetscInitializeCalled == PETSC_FALSE || PetscGetFlops(&all) != 0) return;
  phase_at_hand->work.flops += all - petsc_flops;
  petsc_flops = all;
}

double read_clock(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double cpu_booked_s = 0;
double wall_booked_s = read_clock(CLOCK_MONOTONIC);

void book_time() {
  const double cpu_s = read_clock(CLOCK_PROCESS_CPUTIME_ID);
  const double wall_s = read_clock(CLOCK_MONOTONIC);
  phase_at_hand->effort.cpu_seconds += cpu_s - cpu_booked_s;
  phase_at_hand->effort.wall_seconds += wall_s - wall_booked_s;
  cpu_booked_s = cpu_s;
  wall_booked_s = wall_s;
}

/// Books the time of its life as inside MPI.
class Inside {
 public:
  Inside() : start_s_(read_clock(CLOCK_MONOTONIC)) {}
  ~Inside() { phase_at_hand->effort.mpi_seconds += read_clock(CLOCK_MONOTONIC) - start_s_; }
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;

 private:
  double start_s_;
};

double calc_bytes(double count, MPI_Datatype type) {
  int size = 0;
  PMPI_Type_size(type, &size);
  return count * size;
}

void book_send(double count, MPI_Datatype type) {
  phase_at_hand->work.messages += 1;
  phase_at_hand->work.bytes += calc_bytes(count, type);
}

void book_collective(double count, MPI_Datatype type) {
  phase_at_hand->work.collectives += 1;
  phase_at_hand->work.collective_bytes += count > 0 ? calc_bytes(count, type) : 0;
}

double sum_counts(const int* counts, MPI_Comm comm) {
  int size = 0;
  PMPI_Comm_size(comm, &size);
  double sum = 0;
  for (int i = 0; i < size; ++i) sum += counts[i];
  return sum;
}

bool is_root(int root, MPI_Comm comm) {
  int rank = 0;
  PMPI_Comm_rank(comm, &rank);
  return rank == root;
}

std::unordered_map<MPI_Request, double>& get_persistent() {
  static auto* const sends = new std::unordered_map<MPI_Request, double>;  // as long as the process: requests may outlive static objects
  return *sends;
}

void book_start(MPI_Request request) {
  const auto found = get_persistent().find(request);
  if (found == get_persistent().end()) return;
  phase_at_hand->work.messages += 1;
  phase_at_hand->work.bytes += found->second;
}

/// The definition that comes after this program's.
template <typename Function>
Function* find_next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

WorkPhase set_work_phase(WorkPhase phase) {
  book_petsc_flops();
  book_time();
  const auto before = static_cast<WorkPhase>(phase_at_hand - totals.data());
  phase_at_hand = totals.data() + static_cast<std::size_t>(phase);
  return before;
}

void add_flops(double flops) { phase_at_hand->work.flops += flops; }

WorkTable find_work() {
  book_petsc_flops();
  book_time();
  return totals;
}

WorkTable sum_work(MPI_Comm comm) {
  WorkTable sums = find_work();
  PMPI_Allreduce(MPI_IN_PLACE, sums.data(), static_cast<int>(sizeof sums / sizeof(double)), MPI_DOUBLE, MPI_SUM, comm);
  return sums;
}

}  // namespace carillon::petsc

using namespace carillon::petsc;

// CARILLON_COUNT(what is booked, name, (parameters), (arguments))
#define CARILLON_COUNT(booked, name, parameters, arguments)    \
  int name parameters {                                        \
    static const auto next = find_next<decltype(name)>(#name); \
    booked;                                                    \
    const Inside inside;                                       \
    return next arguments;                                     \
  }

extern "C" {

CARILLON_COUNT(book_send(n, t), MPI_Send, (const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c), (b, n, t, r, g, c))
CARILLON_COUNT(book_send(n, t), MPI_Ssend, (const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c), (b, n, t, r, g, c))
CARILLON_COUNT(book_send(n, t), MPI_Isend, (const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c, MPI_Request* q),
               (b, n, t, r, g, c, q))
CARILLON_COUNT(book_send(n, t), MPI_Issend, (const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c, MPI_Request* q),
               (b, n, t, r, g, c, q))
CARILLON_COUNT(book_collective(n, t), MPI_Allreduce, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, MPI_Comm c),
               (b, d, n, t, o, c))
CARILLON_COUNT(book_collective(n, t), MPI_Iallreduce, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, MPI_Comm c, MPI_Request* q),
               (b, d, n, t, o, c, q))
CARILLON_COUNT(book_collective(n, t), MPI_Reduce, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, int r, MPI_Comm c),
               (b, d, n, t, o, r, c))
CARILLON_COUNT(book_collective(n, t), MPI_Scan, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, MPI_Comm c), (b, d, n, t, o, c))
CARILLON_COUNT(book_collective(n, t), MPI_Exscan, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, MPI_Comm c), (b, d, n, t, o, c))
CARILLON_COUNT(book_collective(is_root(r, c) ? n : 0, t), MPI_Bcast, (void* b, int n, MPI_Datatype t, int r, MPI_Comm c), (b, n, t, r, c))
CARILLON_COUNT(book_collective(0, MPI_BYTE), MPI_Barrier, (MPI_Comm c), (c))
CARILLON_COUNT(book_collective(0, MPI_BYTE), MPI_Ibarrier, (MPI_Comm c, MPI_Request* q), (c, q))
CARILLON_COUNT(b == MPI_IN_PLACE ? book_collective(m, u) : book_collective(n, t), MPI_Allgather,
               (const void* b, int n, MPI_Datatype t, void* d, int m, MPI_Datatype u, MPI_Comm c), (b, n, t, d, m, u, c))
CARILLON_COUNT(b == MPI_IN_PLACE ? book_collective(0, u) : book_collective(n, t), MPI_Allgatherv,
               (const void* b, int n, MPI_Datatype t, void* d, const int m[], const int p[], MPI_Datatype u, MPI_Comm c),
               (b, n, t, d, m, p, u, c))
CARILLON_COUNT(b == MPI_IN_PLACE ? book_collective(m, u) : book_collective(n, t), MPI_Gather,
               (const void* b, int n, MPI_Datatype t, void* d, int m, MPI_Datatype u, int r, MPI_Comm c), (b, n, t, d, m, u, r, c))
CARILLON_COUNT(b == MPI_IN_PLACE ? book_collective(0, u) : book_collective(n, t), MPI_Gatherv,
               (const void* b, int n, MPI_Datatype t, void* d, const int m[], const int p[], MPI_Datatype u, int r, MPI_Comm c),
               (b, n, t, d, m, p, u, r, c))
CARILLON_COUNT(d == MPI_IN_PLACE ? book_collective(n, t) : book_collective(m, u), MPI_Scatter,
               (const void* b, int n, MPI_Datatype t, void* d, int m, MPI_Datatype u, int r, MPI_Comm c), (b, n, t, d, m, u, r, c))
CARILLON_COUNT(d == MPI_IN_PLACE ? book_collective(0, t) : book_collective(m, u), MPI_Scatterv,
               (const void* b, const int n[], const int p[], MPI_Datatype t, void* d, int m, MPI_Datatype u, int r, MPI_Comm c),
               (b, n, p, t, d, m, u, r, c))
CARILLON_COUNT(b == MPI_IN_PLACE ? book_collective(m, u) : book_collective(n, t), MPI_Alltoall,
               (const void* b, int n, MPI_Datatype t, void* d, int m, MPI_Datatype u, MPI_Comm c), (b, n, t, d, m, u, c))
CARILLON_COUNT(b == MPI_IN_PLACE ? book_collective(sum_counts(m, c), u) : book_collective(sum_counts(n, c), t), MPI_Alltoallv,
               (const void* b, const int n[], const int p[], MPI_Datatype t, void* d, const int m[], const int o[], MPI_Datatype u,
                MPI_Comm c),
               (b, n, p, t, d, m, o, u, c))
CARILLON_COUNT(book_start(*q), MPI_Start, (MPI_Request * q), (q))
CARILLON_COUNT(for (int i = 0; i < n; ++i) book_start(q[i]), MPI_Startall, (int n, MPI_Request q[]), (n, q))
CARILLON_COUNT(get_persistent().erase(*q), MPI_Request_free, (MPI_Request * q), (q))

CARILLON_COUNT({}, MPI_Recv, (void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c, MPI_Status* s), (b, n, t, r, g, c, s))
CARILLON_COUNT({}, MPI_Probe, (int r, int g, MPI_Comm c, MPI_Status* s), (r, g, c, s))
CARILLON_COUNT({}, MPI_Wait, (MPI_Request * q, MPI_Status* s), (q, s))
CARILLON_COUNT({}, MPI_Waitall, (int n, MPI_Request q[], MPI_Status s[]), (n, q, s))
CARILLON_COUNT({}, MPI_Waitany, (int n, MPI_Request q[], int* i, MPI_Status* s), (n, q, i, s))
CARILLON_COUNT({}, MPI_Waitsome, (int n, MPI_Request q[], int* o, int i[], MPI_Status s[]), (n, q, o, i, s))

int MPI_Send_init(const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c, MPI_Request* q) {
  static const auto next = find_next<decltype(MPI_Send_init)>("MPI_Send_init");
  const int code = next(b, n, t, r, g, c, q);
  if (code == MPI_SUCCESS) get_persistent()[*q] = calc_bytes(n, t);
  return code;
}

}  // extern "C"
