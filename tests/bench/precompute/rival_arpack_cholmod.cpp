// ARPACK (dsaupd, mode 3: shift-invert) with CHOLMOD's supernodal factor. ncv = 2 nev, as ARPACK's guide and SLEPc advise.
#include <arpack/arpack.h>
#include <fmt/core.h>

#include <algorithm>
#include <numeric>

#include "tests/bench/precompute/cholmod_operator.hpp"

namespace {

void run(const bench::Arguments& arguments) {
  bench::Phases phases;
  const bench::Matrix stiffness = bench::read_matrix(arguments.stiffness);
  const bench::Matrix mass = bench::read_matrix(arguments.mass);
  phases.end("read");
  bench::CholmodOperator inverse(stiffness, mass, arguments.sigma);
  phases.end("factor");

  const a_int n = static_cast<a_int>(stiffness.n);
  const a_int nev = arguments.modes;
  const a_int ncv = std::min(2 * nev, n);
  const a_int work_size = ncv * (ncv + 8);
  std::vector<double> basis(static_cast<std::size_t>(n) * ncv), work(3 * n), inner(work_size), start(n), product(n);
  a_int parameters[11] = {1, 0, 1000, 1, 0, 0, 3};  // exact shifts, at most 1000 restarts, mode 3
  a_int pointers[14] = {};
  a_int ido = 0, info = 0;
  for (;;) {
    dsaupd_c(&ido, "G", n, "LM", nev, arguments.tolerance, start.data(), ncv, basis.data(), n, parameters, pointers, work.data(),
             inner.data(), work_size, &info);
    double* x = work.data() + pointers[0] - 1;
    double* y = work.data() + pointers[1] - 1;
    if (ido == -1) {
      bench::multiply(mass, x, product.data());
      phases.end("orthogonalise");
      inverse.solve(product.data(), y);
      phases.end("solve");
    } else if (ido == 1) {
      phases.end("orthogonalise");
      inverse.solve(work.data() + pointers[2] - 1, y);  // M x is already available
      phases.end("solve");
    } else if (ido == 2) {
      bench::multiply(mass, x, y);
    } else {
      break;
    }
  }
  bench::demand(info == 0, fmt::format("dsaupd: info {}", info));
  std::vector<double> lambda(nev);
  std::vector<a_int> select(ncv);
  dseupd_c(1, "A", select.data(), lambda.data(), basis.data(), n, arguments.sigma, "G", n, "LM", nev, arguments.tolerance, start.data(),
           ncv, basis.data(), n, parameters, pointers, work.data(), inner.data(), work_size, &info);
  bench::demand(info == 0 && parameters[4] >= nev, fmt::format("dseupd: info {}, {} of {} converged", info, parameters[4], nev));
  phases.end("orthogonalise");
  bench::write_answer(arguments.answer, n, lambda, basis.data());
  phases.end("write");
  phases.count("solves", inverse.get_solves());
  phases.count("factor_entries", inverse.get_entries());
  phases.write(arguments.phases);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    run(bench::parse_arguments(argc, argv));
  } catch (const std::exception& error) {
    fmt::print(stderr, "rival_arpack_cholmod: {}\n", error.what());
    return 3;
  }
}
