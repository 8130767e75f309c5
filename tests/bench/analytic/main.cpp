// Cost of accuracy of polygonal membranes: order and size of the elements, their grading to corners, particular solutions. Prints CSV.
//
//   bench_analytic [--quick]
//
// Truth: the closed form of the square; of the L particular solutions; of the others elements of order ten that are half as large.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "precompute/analytic/polygon.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/clock.hpp"

namespace {

using namespace carillon;
using namespace carillon::analytic;
using std::numbers::pi;

struct Shape {
  std::string name;
  std::vector<Point2> corners;
};

std::vector<Shape> make_shapes() {
  const double slit = std::tan(pi / 36);
  return {{"square", {{0, 0}, {1, 0}, {1, 1}, {0, 1}}},
          {"L", {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}}},
          {"U", {{0, 0}, {3, 0}, {3, 2}, {2, 2}, {2, 1}, {1, 1}, {1, 2}, {0, 2}}},
          {"slit of 350 degrees", {{0, -1}, {1, -1}, {1, 1}, {-1, 1}, {-1, slit}, {0, 0}, {-1, -slit}, {-1, -1}}}};
}

double calc_area(const std::vector<Point2>& p) {
  double twice = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) twice += p[i][0] * p[(i + 1) % p.size()][1] - p[i][1] * p[(i + 1) % p.size()][0];
  return 0.5 * twice;
}

struct Outcome {
  Polygon::Solved solved;
  double cpu_s = 0.0;
};

Outcome solve(const Shape& shape, double modes, const PolygonSetting& setting) {
  job::MembraneBody body;
  body.shape = "polygon";
  body.corners_m = shape.corners;
  body.tension_n_m = body.density_kg_m2 = 1.0;
  body.thickness_m = 0.01;
  Polygon polygon(body, {}, setting);
  const double begin_s = base::get_process_cpu_s();
  Outcome outcome{polygon.solve(4.0 * pi * modes / calc_area(shape.corners)), 0.0};
  outcome.cpu_s = base::get_process_cpu_s() - begin_s;
  return outcome;
}

std::vector<double> find_truth(const Shape& shape, double modes) {
  if (shape.name != "square")
    return solve(shape, modes, {.order = 10, .edge_radians = 4.0, .corner_error = 1e-12, .ratio = 0.3}).solved.kappa;
  std::vector<double> kappa;
  for (int m = 1; m < 100; ++m)
    for (int n = 1; n < 100; ++n) kappa.push_back(pi * pi * (m * m + n * n));
  std::sort(kappa.begin(), kappa.end());
  return kappa;
}

void print_row(const Shape& shape, const char* knob, double modes, const PolygonSetting& setting, const std::vector<double>& truth) {
  const Outcome outcome = solve(shape, modes, setting);
  double worst = 0.0, bar = 0.0;
  std::size_t held = 0;
  for (std::size_t m = 0; m < outcome.solved.kappa.size(); ++m) {
    const double error = std::abs(outcome.solved.kappa[m] / truth[m] - 1.0);
    worst = std::max(worst, error);
    bar = std::max(bar, outcome.solved.error[m]);
    held += error <= outcome.solved.error[m] + 1e-12 ? 1 : 0;
  }
  fmt::print("{},{},{},{:g},{:g},{:g},{},{},{:.3f},{:.3e},{:.3e},{}\n", shape.name, knob, setting.order, setting.edge_radians,
             setting.corner_error, setting.ratio, setting.uses_particular_solutions ? 1 : 0, outcome.solved.kappa.size(), outcome.cpu_s,
             worst, bar, held);
}

}  // namespace

int main(int argc, char** argv) {
  const bool is_quick = argc > 1 && std::string(argv[1]) == "--quick";
  petsc::Session session(argc, argv);
  const double modes = is_quick ? 12 : 60;
  fmt::print("shape,knob,order,edge_radians,corner_error,ratio,particular_solutions,modes,cpu_s,error,bar,held\n");
  for (const Shape& shape : make_shapes()) {
    const std::vector<double> truth = find_truth(shape, modes);
    const PolygonSetting plain{.uses_particular_solutions = false};
    for (const int order : {4, 6, 8, 10}) {
      PolygonSetting setting = plain;
      setting.order = order;
      setting.edge_radians = order - 2.0;
      print_row(shape, "order", modes, setting, truth);
    }
    for (const double corner_error : {1e-2, 1e-4, 1e-8, 1e-10}) {
      PolygonSetting setting = plain;
      setting.corner_error = corner_error;
      print_row(shape, "grading", modes, setting, truth);
    }
    if (shape.name == "square" || shape.name == "L") print_row(shape, "particular solutions", modes, {}, truth);  // the others have no such
  }
}
