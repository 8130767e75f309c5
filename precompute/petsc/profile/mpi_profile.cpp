// Counts the messages of a run. A separate library preloaded by carillon-precompute --profile.
//
// Method: Defines MPI_Send etc.; each counts and calls the next definition by dlsym(RTLD_NEXT) instead of PMPI_Send, so that other
// profilers see the calls as well. Calls from Fortran (MUMPS) and from several threads are not counted.
// Source: MPI 3.1, chapter 14 (profiling interface).
#include <dlfcn.h>
#include <mpi.h>

#include <unordered_map>

#include "precompute/petsc/mpi_counts.hpp"
#include "runtime/base/clock.hpp"

namespace {

CarillonMpiCounts totals{};

/// Adds its lifetime to the time inside MPI.
class Inside {
 public:
  Inside() : start_s_(carillon::base::get_steady_s()) {}
  ~Inside() { totals.seconds += carillon::base::get_steady_s() - start_s_; }
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
  totals.messages += 1;
  totals.bytes += calc_bytes(count, type);
}

void book_collective(double count, MPI_Datatype type) {
  totals.collectives += 1;
  totals.collective_bytes += count > 0 ? calc_bytes(count, type) : 0;
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
  static auto* const sends = new std::unordered_map<MPI_Request, double>;  // never destroyed: requests may outlive static objects
  return *sends;
}

void book_start(MPI_Request request) {
  const auto found = get_persistent().find(request);
  if (found == get_persistent().end()) return;
  totals.messages += 1;
  totals.bytes += found->second;
}

/// The next definition after that of this library.
template <typename Function>
Function* find_next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

// CARILLON_COUNT(count statement, name, (parameters), (arguments))
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

void carillon_get_mpi_counts(CarillonMpiCounts* counts) { *counts = totals; }

}  // extern "C"
