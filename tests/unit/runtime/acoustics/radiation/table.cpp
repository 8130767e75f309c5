// radiation_table: the table of docs/decisions/radiation-gain.md, by both kinds of gain on a meshed sphere.
#include <cstdio>
#include <exception>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/surface.hpp"
#include "tests/support/paths.hpp"
#include "tests/unit/runtime/acoustics/radiation/sphere_bank.hpp"

namespace {

using namespace carillon;

constexpr double kRadius = 0.1;
constexpr int kLevel = 4;

/// Formula E6 of docs/equations.md, as carillon-precompute writes it into banks.
double calc_osg02_gain(const bank::Bank& bank, std::size_t mode) {
  double flow = 0.0, area = 0.0;
  for (const Triangle& triangle : bank.triangles) {
    const carillon::Vec3 normal = bank::calc_normal(bank.vertices_m, triangle);
    double through = 0.0;
    for (const std::int32_t v : triangle)
      for (int k = 0; k < 3; ++k) through += bank.shape_at(v, mode)[k] * normal[k] / 6.0;
    flow += std::abs(through);
    area += 0.5 * std::hypot(normal[0], normal[1], normal[2]);
  }
  const double omega = std::sqrt(bank.eigenvalue_rad2_s2[mode]), a = std::sqrt(area / (4.0 * std::numbers::pi));
  return bank::kAirDensityKgM3 * omega / (4.0 * std::numbers::pi * std::hypot(1.0, omega / bank::kSoundSpeedMs * a)) * flow;
}

void print_table() {
  const auto rows =
      testing::read_sphere_rows(carillon::tests::get_source_dir() + "/tests/unit/runtime/acoustics/radiation/data/spheres.csv");
  const bank::Bank bank = testing::make_lobed_sphere(rows, kRadius, kLevel);
  const std::vector<double> sphere = radiation::calc_gains(bank, radiation::GainKind::kSphere);
  std::printf("| ka | l = 0 | l = 1 | l = 2 | l = 3 | l = 4 |\n|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < rows.size() / 5; ++i) {
    std::printf("| %g |", rows[i].ka);
    for (std::size_t m = i; m < rows.size(); m += rows.size() / 5) {
      const double exact = testing::calc_exact_gain(rows[m], kRadius);
      std::printf(" %.1f, **%.2f** |", 20.0 * std::log10(calc_osg02_gain(bank, m) / exact), 20.0 * std::log10(sphere[m] / exact));
    }
    std::printf("\n");
  }
}

}  // namespace

int main() {
  try {
    print_table();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "radiation_table: %s\n", error.what());
    return 1;
  }
  return 0;
}
