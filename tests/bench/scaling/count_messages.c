// Counts an MPI program's messages through MPI's profiling interface: LD_PRELOAD=libcount_messages.so mpirun ... program
// Every call is booked under its way through the program (return addresses), so that messages can be assigned to phases afterwards; see
// messages.py. Written at MPI_Finalize to $CARILLON_MESSAGES.RANK, one line a kind and way: kind, calls, bytes sent, CPU seconds inside,
// CPU seconds of the program since its call before, addresses relative to the program. Calls from Fortran (MUMPS) pass by unseen. One
// thread.
#define _GNU_SOURCE
#include <execinfo.h>
#include <link.h>
#include <mpi.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { kDepth = 24, kSkipped = 2, kEntries = 8192, kRequests = 65536 };

typedef struct {
  const char* kind;
  int depth;
  void* way[kDepth];
  long calls;
  double bytes;
  double cpu_s;
  double before_s;
} Entry;

static Entry entries[kEntries];
static int entry_count = 0;
static struct {
  MPI_Request request;
  double bytes;
} persistent[kRequests];
static uintptr_t base = 0;
static uintptr_t end = 0;

static int find_program(struct dl_phdr_info* info, size_t size, void* unused) {
  (void)size;
  (void)unused;
  base = info->dlpi_addr;  // the program itself comes first
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const uintptr_t last = base + info->dlpi_phdr[i].p_vaddr + info->dlpi_phdr[i].p_memsz;
    if (info->dlpi_phdr[i].p_type == PT_LOAD && last > end) end = last;
  }
  return 1;
}

static double find_cpu_seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double find_bytes(long count, MPI_Datatype type) {
  int size = 0;
  PMPI_Type_size(type, &size);
  return (double)count * size;
}

static double last_end_s = 0;

static void book(const char* kind, long calls, double bytes, double start_s, double end_s) {
  void* all[64];
  void* way[kDepth];
  if (base == 0) dl_iterate_phdr(find_program, NULL);
  const int found = backtrace(all, 64);
  int depth = 0;
  for (int i = kSkipped; i < found && depth < kDepth; ++i)
    if ((uintptr_t)all[i] >= base && (uintptr_t)all[i] < end) way[depth++] = all[i];
  for (int i = 0; i < entry_count; ++i) {
    Entry* entry = &entries[i];
    if (entry->kind != kind || entry->depth != depth || memcmp(entry->way, way, sizeof(void*) * (size_t)depth) != 0) continue;
    entry->calls += calls;
    entry->bytes += bytes;
    entry->cpu_s += end_s - start_s;
    entry->before_s += start_s - last_end_s;
    last_end_s = find_cpu_seconds();  // our own work is not counted
    return;
  }
  if (entry_count == kEntries) return;
  Entry* entry = &entries[entry_count++];
  entry->kind = kind;
  entry->depth = depth;
  memcpy(entry->way, way, sizeof(void*) * (size_t)depth);
  entry->calls = calls;
  entry->bytes = bytes;
  entry->cpu_s = end_s - start_s;
  entry->before_s = start_s - last_end_s;
  last_end_s = find_cpu_seconds();
}

// COUNT(kind, bytes, name, parameters, arguments): the call itself, timed and booked.
#define COUNT(kind, bytes, name, parameters, arguments) \
  int name parameters {                                 \
    const double start = find_cpu_seconds();            \
    const int code = P##name arguments;                 \
    book(kind, 1, bytes, start, find_cpu_seconds());    \
    return code;                                        \
  }

static double sum_counts(const int counts[], MPI_Datatype type, MPI_Comm comm) {
  int size = 0;
  long sum = 0;
  PMPI_Comm_size(comm, &size);
  for (int i = 0; i < size; ++i) sum += counts[i];
  return find_bytes(sum, type);
}

COUNT("send", find_bytes(n, t), MPI_Send, (const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c), (b, n, t, r, g, c))
COUNT("send", find_bytes(n, t), MPI_Ssend, (const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c), (b, n, t, r, g, c))
COUNT("send", find_bytes(n, t), MPI_Isend, (const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c, MPI_Request* q),
      (b, n, t, r, g, c, q))
COUNT("send", find_bytes(n, t), MPI_Issend, (const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c, MPI_Request* q),
      (b, n, t, r, g, c, q))
COUNT("wait", 0, MPI_Recv, (void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c, MPI_Status* s), (b, n, t, r, g, c, s))
COUNT("wait", 0, MPI_Wait, (MPI_Request * q, MPI_Status* s), (q, s))
COUNT("wait", 0, MPI_Waitall, (int n, MPI_Request q[], MPI_Status s[]), (n, q, s))
COUNT("wait", 0, MPI_Waitany, (int n, MPI_Request q[], int* i, MPI_Status* s), (n, q, i, s))
COUNT("wait", 0, MPI_Waitsome, (int n, MPI_Request q[], int* o, int i[], MPI_Status s[]), (n, q, o, i, s))
// Who asks whether something has come waits, too.
COUNT("wait", 0, MPI_Test, (MPI_Request * q, int* f, MPI_Status* s), (q, f, s))
COUNT("wait", 0, MPI_Testall, (int n, MPI_Request q[], int* f, MPI_Status s[]), (n, q, f, s))
COUNT("wait", 0, MPI_Iprobe, (int r, int g, MPI_Comm c, int* f, MPI_Status* s), (r, g, c, f, s))
COUNT("wait", 0, MPI_Improbe, (int r, int g, MPI_Comm c, int* f, MPI_Message* m, MPI_Status* s), (r, g, c, f, m, s))
COUNT("wait", 0, MPI_Mrecv, (void* b, int n, MPI_Datatype t, MPI_Message* m, MPI_Status* s), (b, n, t, m, s))
COUNT("allreduce", find_bytes(n, t), MPI_Allreduce, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, MPI_Comm c),
      (b, d, n, t, o, c))
COUNT("allreduce", find_bytes(n, t), MPI_Iallreduce, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, MPI_Comm c, MPI_Request* q),
      (b, d, n, t, o, c, q))
COUNT("reduce", find_bytes(n, t), MPI_Reduce, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, int r, MPI_Comm c),
      (b, d, n, t, o, r, c))
COUNT("scan", find_bytes(n, t), MPI_Scan, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, MPI_Comm c), (b, d, n, t, o, c))
COUNT("scan", find_bytes(n, t), MPI_Exscan, (const void* b, void* d, int n, MPI_Datatype t, MPI_Op o, MPI_Comm c), (b, d, n, t, o, c))
COUNT("bcast", find_bytes(n, t), MPI_Bcast, (void* b, int n, MPI_Datatype t, int r, MPI_Comm c), (b, n, t, r, c))
COUNT("barrier", 0, MPI_Barrier, (MPI_Comm c), (c))
COUNT("barrier", 0, MPI_Ibarrier, (MPI_Comm c, MPI_Request* q), (c, q))
COUNT("allgather", find_bytes(n, t), MPI_Allgather, (const void* b, int n, MPI_Datatype t, void* d, int m, MPI_Datatype u, MPI_Comm c),
      (b, n, t, d, m, u, c))
COUNT("allgather", find_bytes(n, t), MPI_Allgatherv,
      (const void* b, int n, MPI_Datatype t, void* d, const int m[], const int p[], MPI_Datatype u, MPI_Comm c), (b, n, t, d, m, p, u, c))
COUNT("gather", find_bytes(n, t), MPI_Gather, (const void* b, int n, MPI_Datatype t, void* d, int m, MPI_Datatype u, int r, MPI_Comm c),
      (b, n, t, d, m, u, r, c))
COUNT("gather", find_bytes(n, t), MPI_Gatherv,
      (const void* b, int n, MPI_Datatype t, void* d, const int m[], const int p[], MPI_Datatype u, int r, MPI_Comm c),
      (b, n, t, d, m, p, u, r, c))
COUNT("scatter", find_bytes(m, u), MPI_Scatter, (const void* b, int n, MPI_Datatype t, void* d, int m, MPI_Datatype u, int r, MPI_Comm c),
      (b, n, t, d, m, u, r, c))
COUNT("scatter", find_bytes(m, u), MPI_Scatterv,
      (const void* b, const int n[], const int p[], MPI_Datatype t, void* d, int m, MPI_Datatype u, int r, MPI_Comm c),
      (b, n, p, t, d, m, u, r, c))
COUNT("alltoall", find_bytes(n, t), MPI_Alltoall, (const void* b, int n, MPI_Datatype t, void* d, int m, MPI_Datatype u, MPI_Comm c),
      (b, n, t, d, m, u, c))
COUNT("alltoall", sum_counts(n, t, c), MPI_Alltoallv,
      (const void* b, const int n[], const int p[], MPI_Datatype t, void* d, const int m[], const int o[], MPI_Datatype u, MPI_Comm c),
      (b, n, p, t, d, m, o, u, c))

// Persistent sends (PETSc's exchanges) are booked when they start.
static unsigned find_slot(MPI_Request request) {
  unsigned at = (unsigned)(((uintptr_t)request >> 4) % kRequests);
  while (persistent[at].request != NULL && persistent[at].request != request) at = (at + 1) % kRequests;
  return at;
}
int MPI_Send_init(const void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c, MPI_Request* q) {
  const int code = PMPI_Send_init(b, n, t, r, g, c, q);
  const unsigned at = find_slot(*q);
  persistent[at].request = *q;
  persistent[at].bytes = find_bytes(n, t);
  return code;
}
int MPI_Recv_init(void* b, int n, MPI_Datatype t, int r, int g, MPI_Comm c, MPI_Request* q) {
  const int code = PMPI_Recv_init(b, n, t, r, g, c, q);
  const unsigned at = find_slot(*q);  // perhaps the address of a send that is gone
  if (persistent[at].request == *q) persistent[at].bytes = -1;
  return code;
}
int MPI_Startall(int n, MPI_Request q[]) {
  const double start = find_cpu_seconds();
  const int code = PMPI_Startall(n, q);
  const double end_s = find_cpu_seconds();
  long calls = 0;
  double bytes = 0;
  for (int i = 0; i < n; ++i) {
    const unsigned at = find_slot(q[i]);
    if (persistent[at].request != q[i] || persistent[at].bytes < 0) continue;
    ++calls;
    bytes += persistent[at].bytes;
  }
  if (calls > 0) book("send", calls, bytes, start, end_s);
  return code;
}
int MPI_Start(MPI_Request* q) { return MPI_Startall(1, q); }

int MPI_Finalize(void) {
  int rank = 0;
  char name[4096];
  const char* stem = getenv("CARILLON_MESSAGES");
  PMPI_Comm_rank(MPI_COMM_WORLD, &rank);
  snprintf(name, sizeof name, "%s.%d", stem != NULL ? stem : "messages", rank);
  FILE* file = fopen(name, "w");
  if (file != NULL) {
    for (int i = 0; i < entry_count; ++i) {
      fprintf(file, "%s %ld %.0f %.6f %.6f", entries[i].kind, entries[i].calls, entries[i].bytes, entries[i].cpu_s, entries[i].before_s);
      for (int d = 0; d < entries[i].depth; ++d) fprintf(file, " %lx", (unsigned long)((uintptr_t)entries[i].way[d] - base));
      fputc('\n', file);
    }
    fclose(file);
  }
  return PMPI_Finalize();
}
