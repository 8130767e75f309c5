// Rates of the full-order motion of solids: forces alone by kind of element, and whole steps on any number of ranks.
//
// usage: bench_transient [--quick]                    a table of rates of forces on one rank, of steps on all
// The instruction set is the best there is, or CARILLON_INSTRUCTIONS. Prints one JSON object; tests/bench/transient/run makes the table.
#include <fmt/format.h>
#include <mpi.h>

#include <chrono>
#include <cstring>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/simulation/transient/domain.hpp"
#include "precompute/simulation/transient/motion.hpp"

namespace {

using namespace carillon;
using namespace carillon::transient;

Law make_law(bool damped) {
  Law law{51e9, 26e9, 0.0, 0.0, 2700.0};
  if (damped) {
    law.phi_pa_s = 1e-9 * law.lambda_pa;
    law.psi_pa_s = 1e-9 * law.mu_pa;
  }
  return law;
}

double read_cpu() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double read_wall() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::shared_ptr<const Assembly> make_box(const comm::Communicator& comm, int order, const std::array<int, 3>& cells, bool damped,
                                         bool curved) {
  SolidBody body{"box", {}, make_law(damped), 0.0};
  if (comm.is_root()) {
    body.mesh = shapes::make_box({0.01 * cells[0], 0.01 * cells[1], 0.01 * cells[2]}, cells, order);
    if (curved) {
      std::vector<char> is_mid(body.mesh.nodes_m.size(), 0);
      for (std::int64_t e = 0; e < body.mesh.tet_count(); ++e)
        for (std::size_t a = 4; a < 10; ++a) is_mid[body.mesh.tet(e)[a]] = 1;
      for (std::size_t n = 0; n < is_mid.size(); ++n)
        if (is_mid[n] != 0) body.mesh.nodes_m[n][0] += 1e-4;
    }
  }
  return std::make_shared<Assembly>(make_assembly(comm, std::vector<SolidBody>{body}));
}

/// Element-steps a CPU second of forces alone.
double measure_forces(const comm::Communicator& comm, int order, int cells, bool damped, bool curved, double seconds) {
  Domain domain(comm, make_box(comm, order, {cells, cells, cells}, damped, curved));
  std::vector<Quad> u(domain.node_count()), v(u.size()), f(static_cast<std::size_t>(domain.force_count()));
  for (std::size_t i = 0; i < u.size(); ++i) {
    u[i].x = 1e-7 * static_cast<double>(i % 13);
    v[i].y = 1e-2 * static_cast<double>(i % 7);
  }
  const StepWeights weights{5e-8, 5e-8, 1e-7};
  std::int64_t steps = 0;
  const double begin = read_cpu();
  double now = begin;
  while (now - begin < seconds) {
    for (int i = 0; i < 16; ++i) domain.set_inner_forces(weights, u.data(), v.data(), f.data());
    steps += 16;
    now = read_cpu();
  }
  return static_cast<double>(steps) * domain.get_assembly().element_count() / (now - begin);
}

struct StepRate {
  std::int32_t elements = 0;
  double busiest = 1.0;              // elements of the rank with most, over elements / ranks
  double wall_s = 0.0, cpu_s = 0.0;  // a step; CPU of this rank
};

StepRate measure_steps(const comm::Communicator& comm, int order, const std::array<int, 3>& cells, double seconds) {
  Domain domain(comm, make_box(comm, order, cells, true, false));
  MotionOptions options;
  options.step_check_s = 1e9;
  options.inversion_check_steps = 1 << 30;
  Motion motion(domain, options);
  motion.set_start([](std::int32_t, const Vec3& x) { return Motion::Start{{}, {x[1], 0.1 * x[0], 0.0}}; });
  motion.advance_sample();
  std::int64_t steps = 0;
  MPI_Barrier(comm);
  const double begin = read_wall(), begin_cpu = read_cpu();
  do {
    for (int i = 0; i < 500; ++i) motion.advance();
    steps += 500;
  } while (comm.max(read_wall() - begin) < seconds);
  const std::int32_t elements = domain.get_assembly().element_count();
  const double busiest = static_cast<double>(comm.max(domain.element_count())) * comm.size() / elements;
  return {elements, busiest, (read_wall() - begin) / static_cast<double>(steps), (read_cpu() - begin_cpu) / static_cast<double>(steps)};
}

/// Seconds of one copy to the halo of `nodes` Quads each way.
double measure_halo(const comm::Communicator& comm, int nodes, double seconds) {
  comm::Halo halo;
  const int other = (comm.rank() + 1) % comm.size();
  for (int i = 0; i < nodes; ++i) {
    halo.number.push_back(other * nodes + i);
    halo.owner.push_back(other);
    halo.place.push_back(nodes + i);
  }
  std::vector<Quad> values(2 * nodes);
  comm::HaloExchange exchange(comm, halo, [&](std::int32_t number) { return number - comm.rank() * nodes; });
  exchange.reserve(sizeof(Quad));
  std::int64_t count = 0;
  MPI_Barrier(comm);
  const double begin = read_wall();
  do {
    for (int i = 0; i < 2000; ++i) exchange.copy_to_halo(values.data(), 1);
    count += 2000;
  } while (comm.max(read_wall() - begin) < seconds);
  return (read_wall() - begin) / static_cast<double>(count);
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  {
    const comm::Communicator comm(MPI_COMM_WORLD);
    const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
    const double seconds = quick ? 0.02 : 0.3;
    std::string text = fmt::format("{{\"ranks\": {}, \"lanes\": {}, \"forces\": {{", comm.size(), find_loops().lanes);
    if (comm.size() == 1) {
      struct Kind {
        const char* name;
        int order, cells;
        bool curved;
      };
      const char* separator = "";
      for (const Kind& kind : {Kind{"T4", 1, 12, false}, Kind{"T10", 2, 8, false}, Kind{"curved T10", 2, 8, true}})
        for (const bool damped : {false, true}) {
          text += fmt::format("{}\"{}{}\": {:.4g}", separator, kind.name, damped ? " damped" : "",
                              measure_forces(comm, kind.order, kind.cells, damped, kind.curved, seconds));
          separator = ", ";
        }
    }
    text += "}, \"steps\": [";
    const char* separator = "";
    struct Size {
      int order;
      std::array<int, 3> cells;
    };
    for (const Size& size : {Size{1, {12, 6, 3}}, Size{1, {18, 7, 4}}, Size{1, {24, 7, 5}}, Size{1, {24, 14, 5}}, Size{2, {12, 6, 3}}}) {
      const StepRate rate = measure_steps(comm, size.order, size.cells, seconds);
      text += fmt::format("{}{{\"element\": \"T{}\", \"elements\": {}, \"busiest\": {:.4g}, \"wall_s\": {:.4g}, \"cpu_s\": {:.4g}}}",
                          separator, size.order == 1 ? 4 : 10, rate.elements, rate.busiest, rate.wall_s, rate.cpu_s);
      separator = ", ";
    }
    text += "], \"halo\": [";
    if (comm.size() > 1) {
      separator = "";
      for (const int nodes : {8, 100, 500}) {
        text += fmt::format("{}{{\"nodes\": {}, \"wall_s\": {:.4g}}}", separator, nodes, measure_halo(comm, nodes, seconds));
        separator = ", ";
      }
    }
    text += "]}";
    if (comm.is_root()) fmt::print("{}\n", text);
  }
  MPI_Finalize();
  return 0;
}
