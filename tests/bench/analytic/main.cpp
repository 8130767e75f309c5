#include <fmt/core.h>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <vector>
#include "precompute/analytic/polygon.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/clock.hpp"
using namespace carillon;
using namespace carillon::analytic;
int main(int argc, char** argv) {
  petsc::Session session(argc, argv);
  const double pi = std::numbers::pi;
  std::map<std::string, std::vector<Point2>> shapes{
      {"square", {{0, 0}, {1, 0}, {1, 1}, {0, 1}}},
      {"L", {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}}},
      {"U", {{0, 0}, {3, 0}, {3, 2}, {2, 2}, {2, 1}, {1, 1}, {1, 2}, {0, 2}}},
      {"slit", {{0, -1}, {1, -1}, {1, 1}, {-1, 1}, {-1, std::tan(pi / 36)}, {0, 0}, {-1, -std::tan(pi / 36)}, {-1, -1}}},
      {"round", [] { std::vector<Point2> p; for (int i = 0; i < 200; ++i) p.push_back({std::cos(i * 2 * std::numbers::pi / 200), std::sin(i * 2 * std::numbers::pi / 200)}); return p; }()},
      {"quad", {{0, 0}, {0.5, 0.1}, {0.3, 0.4}, {0.1, 0.2}}}};
  for (int i = 1; i + 6 < argc; i += 7) {
    job::MembraneBody body;
    body.corners_m = shapes.at(argv[i]);
    body.shape = "polygon";
    body.tension_n_m = 1.0;
    body.density_kg_m2 = 1.0;
    body.thickness_m = 0.01;
    double area = 0;
    for (std::size_t c = 0; c < body.corners_m.size(); ++c) {
      const auto &a = body.corners_m[c], &b = body.corners_m[(c + 1) % body.corners_m.size()];
      area += 0.5 * (a[0] * b[1] - a[1] * b[0]);
    }
    PolygonSetting setting;
    const double kappa = 4 * pi * std::stod(argv[i + 1]) / area;
    setting.order = std::stoi(argv[i + 2]);
    setting.edge_radians = std::stod(argv[i + 3]);
    setting.corner_error = std::stod(argv[i + 4]);
    setting.uses_particular_solutions = std::stoi(argv[i + 5]) != 0; setting.ratio = std::stod(argv[i + 6]);
    material::Material material;
    material.density_kg_m3 = 100;
    Polygon polygon(body, material, setting);
    const double begin = base::get_process_cpu_s();
    const auto solved = polygon.solve(kappa);
    const double seconds = base::get_process_cpu_s() - begin;
    fmt::print("{} kappa<{:.4g} p={} kh={} ce={} mps={} ratio={}: {} modes {:.3f} s", argv[i], kappa, setting.order, setting.edge_radians, setting.corner_error, argv[i+5], argv[i+6], solved.kappa.size(), seconds);
    double bar = 0;
    for (double e : solved.error) bar = std::max(bar, e);
    fmt::print(" bar {:.2e}", bar);
    if (std::string(argv[i]) == "square") {
      std::vector<double> wanted;
      for (int m = 1; m < 200; ++m) for (int n = 1; n < 200; ++n) wanted.push_back(pi * pi * (m * m + n * n));
      std::sort(wanted.begin(), wanted.end());
      double worst = 0;
      for (std::size_t m = 0; m < solved.kappa.size(); ++m) worst = std::max(worst, std::abs(solved.kappa[m] / wanted[m] - 1));
      fmt::print(" error {:.2e}", worst);
    } else {
      static std::map<std::string, std::vector<double>> truth;
      auto& t = truth[argv[i]];
      if (t.empty()) t = solved.kappa;
      double worst = 0; double over = 0;
      for (std::size_t m = 0; m < std::min(t.size(), solved.kappa.size()); ++m) { const double e = std::abs(solved.kappa[m] / t[m] - 1); worst = std::max(worst, e); over = std::max(over, e / solved.error[m]); if (std::getenv("V") && e > solved.error[m]) fmt::print("   {} kappa {:.6f} e {:.2e} bar {:.2e}\n", m, t[m], e, solved.error[m]); }
      fmt::print(" differs from first {:.2e}, over bar {:.2g}", worst, over);
    }
    fmt::print("\n");
    std::fflush(stdout);
  }
}
