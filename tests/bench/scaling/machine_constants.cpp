// What this machine does, for the model: one line of JSON on rank 0. Best of several tries, as CPU time (transfers: wall time).
//   dgemm_gflops      2000^3                                   tall_gflops  (100000 x 400)^T (100000 x 16), the orthogonalisation's shape
//   triad_gb_s        a = b + s c, 3 x 80 MB, one rank          latency_s, transfer_gb_s   ping-pong between ranks 0 and 1, 8 B and 4 MB
// Kernels of the factorisation, as simulated/cluster.xml has them:
//   own_gflops        a panel of 72 applied to a front of 1,500 rows        shared_gflops   the same to tiles of 72 columns, 4 MB of them
//   panel_gflops      W = A L^-T, 288 rows: rows n^2                        block_gflops    a diagonal block of 72: n^3
//   solve_gflops      288 rows of L from 32 MB, 16 columns
#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <numeric>
#include <vector>

#include "precompute/ldlt/buffer.hpp"
#include "precompute/ldlt/kernels.hpp"

extern "C" void dgemm_(const char*, const char*, const int*, const int*, const int*, const double*, const double*, const int*,
                       const double*, const int*, const double*, double*, const int*);

namespace {

double find_cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <class Work>
double find_best_seconds(int tries, Work&& work) {
  double best = 1e300;
  for (int i = 0; i < tries; ++i) {
    const double start = find_cpu_seconds();
    work();
    best = std::min(best, find_cpu_seconds() - start);
  }
  return best;
}

double measure_gemm(const char* left, int m, int n, int k) {
  std::vector<double> a(static_cast<std::size_t>(m) * k, 0.5), b(static_cast<std::size_t>(k) * n, 0.25), c(static_cast<std::size_t>(m) * n);
  const double one = 1, zero = 0;
  const int stride = *left == 'N' ? m : k;
  const double seconds =
      find_best_seconds(5, [&] { dgemm_(left, "N", &m, &n, &k, &one, a.data(), &stride, b.data(), &k, &zero, c.data(), &m); });
  return 2e-9 * m * n * k / seconds;
}

double measure_triad() {
  const std::size_t n = 10000000;
  std::vector<double> a(n, 0.0), b(n, 1.0), c(n, 2.0);
  double s = 0.5;
  const double seconds = find_best_seconds(8, [&] {
    for (std::size_t i = 0; i < n; ++i) a[i] = b[i] + s * c[i];
    s += a[n / 2] * 1e-9;
  });
  return 3e-9 * sizeof(double) * static_cast<double>(n) / seconds;
}

struct KernelRates {
  double own, shared, panel, block, solve;
};

KernelRates measure_kernels() {
  using namespace carillon::ldlt;
  constexpr int n = kMaxBlock, rows = 288, front = 1500, tiles = 24, repeats = 20;
  const FactorKernels& kernels = find_factor_kernels();
  const auto make = [](std::int64_t count) {
    Buffer numbers(count);
    for (std::int64_t i = 0; i < count; ++i) numbers.data()[i] = 1e-3 * std::sin(static_cast<double>(i));
    return numbers;
  };
  const Buffer given = make(n * n), block = make(n * n), triangle = make(count_triangle(n)), wide = make(front * n), l = make(1 << 22),
               c = make(std::int64_t{front} * front);
  for (int i = 0; i < n; ++i) given.data()[i * n + i] = 2;
  BlockPivots pivots;
  double* columns[front];
  const auto rate = [&](double flops, auto&& work) {
    return 1e-9 * flops * repeats / find_best_seconds(10, [&] {
             for (int r = 0; r < repeats; ++r) work(r);
           });
  };
  KernelRates rates{};
  rates.block = rate(double(n) * n * n, [&](int) {
    std::copy_n(given.data(), n * n, block.data());
    kernels.factorise_block(block.data(), n, pivots, triangle.data());
  });
  const auto place = [&](const double* first, int height) {
    for (int k = 0; k < n; ++k) columns[k] = const_cast<double*>(first) + std::ptrdiff_t{k} * height;
  };
  place(c.data(), rows);
  rates.panel = rate(double(rows) * n * n, [&](int) { kernels.trsm(columns, 0, rows, n, triangle.data(), wide.data()); });
  rates.shared = rate(2.0 * rows * n * n, [&](int r) {
    place(c.data() + std::ptrdiff_t{r % tiles} * rows * n, rows);
    kernels.update_columns(l.data(), n, wide.data(), 0, rows, n, columns);
  });
  for (int k = 0; k < front; ++k) columns[k] = c.data() + std::ptrdiff_t{k} * front;
  const double behind = front - n;
  rates.own = rate(n * behind * (behind + 1), [&](int) { kernels.update({l.data(), wide.data(), n, n}, front, front, false, columns); });
  std::vector<int> nodes(rows / 3);
  std::iota(nodes.begin(), nodes.end(), 0);
  rates.solve = rate(32.0 * rows * n, [&](int r) {
    find_solve_kernels().subtract_product(l.data() + std::ptrdiff_t{r} * rows * n, rows, n, 2, wide.data(), nodes.data(), c.data());
  });
  return rates;
}

/// One way [s], the best of several hundred.
double measure_transfer(int rank, int bytes, int tries) {
  std::vector<char> data(bytes);
  double best = 1e300;
  for (int i = 0; i < tries; ++i) {
    const double start = MPI_Wtime();
    if (rank == 0) {
      MPI_Send(data.data(), bytes, MPI_BYTE, 1, 0, MPI_COMM_WORLD);
      MPI_Recv(data.data(), bytes, MPI_BYTE, 1, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    } else if (rank == 1) {
      MPI_Recv(data.data(), bytes, MPI_BYTE, 0, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
      MPI_Send(data.data(), bytes, MPI_BYTE, 0, 0, MPI_COMM_WORLD);
    }
    best = std::min(best, (MPI_Wtime() - start) / 2);
  }
  return best;
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int rank = 0, size = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &size);
  if (size < 2) {
    std::fputs("machine_constants: start it on two ranks: mpirun -np 2\n", stderr);
    MPI_Abort(MPI_COMM_WORLD, 2);
  }
  const double latency_s = measure_transfer(rank, 8, 2000);
  const int big = 4 << 20;
  const double transfer_s = measure_transfer(rank, big, 100);
  if (rank == 0) {
    const double dgemm = measure_gemm("N", 2000, 2000, 2000);
    const double tall = measure_gemm("T", 400, 16, 100000);
    const KernelRates kernels = measure_kernels();
    std::printf(
        "{\"dgemm_gflops\": %.1f, \"tall_gflops\": %.1f, \"triad_gb_s\": %.1f, \"latency_s\": %.3g, \"transfer_gb_s\": %.2f, "
        "\"own_gflops\": %.1f, \"shared_gflops\": %.1f, \"panel_gflops\": %.1f, \"block_gflops\": %.1f, \"solve_gflops\": %.1f}\n",
        dgemm, tall, measure_triad(), latency_s, 1e-9 * big / transfer_s, kernels.own, kernels.shared, kernels.panel, kernels.block,
        kernels.solve);
  }
  MPI_Finalize();
}
