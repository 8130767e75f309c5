// Makes one rank of an MPI program fail while it shares a front with others, through MPI's profiling interface:
// LD_PRELOAD=libfault.so CARILLON_FAULT=die|memory CARILLON_FAULT_RANK=1 CARILLON_FAULT_LETTER=20 mpirun ... program
// When that many letters have come to the rank by MPI_Improbe, which only shared fronts use, it dies as if it were killed, or gets no more
// memory from the system.
#define _GNU_SOURCE
#include <mpi.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

static int letters = 0;

static void fail(void) {
  const char* kind = getenv("CARILLON_FAULT");
  if (kind == NULL) return;
  if (kind[0] == 'd') kill(getpid(), SIGKILL);
  long pages = 0;
  FILE* file = fopen("/proc/self/statm", "r");
  if (file == NULL || fscanf(file, "%ld", &pages) != 1) abort();
  fclose(file);
  struct rlimit limit;
  getrlimit(RLIMIT_AS, &limit);
  limit.rlim_cur = (rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE);
  setrlimit(RLIMIT_AS, &limit);
}

int MPI_Improbe(int source, int tag, MPI_Comm comm, int* flag, MPI_Message* message, MPI_Status* status) {
  const int code = PMPI_Improbe(source, tag, comm, flag, message, status);
  if (!*flag) return code;
  const char* rank = getenv("CARILLON_FAULT_RANK");
  const char* letter = getenv("CARILLON_FAULT_LETTER");
  int own = 0;
  PMPI_Comm_rank(MPI_COMM_WORLD, &own);
  if (rank != NULL && letter != NULL && own == atoi(rank) && ++letters == atoi(letter)) fail();
  return code;
}
