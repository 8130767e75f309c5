// The boundary elements against fields that are known, one JSON document on standard output:
//   bench_air spheres N ORDER K...                spheres of 10 N^2 + 2 nodes and radius 1 that move in every harmonic to ORDER
//   bench_air sources plate|bowl|bell SPACING     monopoles and dipoles in a body whose nodes are about so far apart [m]
//   bench_air sources FILE                        the same in a closed surface: "nodes facets", then nodes [m], then facets
// At COUNT wave numbers from k R = 0.1 to six nodes a wave length; errors over directions in dB, times in CPU seconds.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "tests/unit/precompute/air/bodies.hpp"
#include "tests/unit/precompute/air/sources.hpp"
#include "tests/unit/precompute/air/spheres.hpp"

namespace {

using namespace carillon;
using namespace carillon::air;
using testing::Skin;
using testing::Source;
using testing::Sources;

constexpr std::size_t kCount = 12;
constexpr double kNodesPerWave = 6.0;

double find_cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void measure_spheres(int n, int order, const std::vector<double>& wave_numbers) {
  std::vector<testing::Harmonic> harmonics;
  for (int l = 0; l <= order; ++l)
    for (int m = -l; m <= l; ++m) harmonics.emplace_back(l, m);
  testing::Spheres spheres(n, harmonics);
  std::printf("{\"nodes\": %d, \"static_cpu_s\": %.2f, \"rows\": [", 10 * n * n + 2, find_cpu_s());
  for (const double k : wave_numbers) {
    const double begin_s = find_cpu_s();
    const testing::Outcome& outcome = spheres.solve(k);
    std::printf("%s\n {\"ka\": %g, \"products\": %d, \"converged\": %s, \"cpu_s\": %.2f, \"harmonics\": [", k == wave_numbers[0] ? "" : ",",
                k, outcome.gmres.products, outcome.gmres.is_converged ? "true" : "false", find_cpu_s() - begin_s);
    for (std::size_t side = 0; side < harmonics.size(); ++side)
      std::printf("%s\n  {\"l\": %d, \"m\": %d, \"share\": %.3e, \"near_db\": %.2f, \"far_db\": %.2f, \"power\": %.6g}",
                  side == 0 ? "" : ",", harmonics[side].first, harmonics[side].second, spheres.find_share(side, k),
                  spheres.find_error_db(side, k, 2.0), spheres.find_error_db(side, k, 0.0), spheres.find_power_ratio(side, k));
    std::printf("]}");
    std::fflush(stdout);
  }
  std::printf("]}\n");
}

Skin read_skin(const char* path) {
  std::ifstream file(path);
  std::size_t nodes = 0, facets = 0;
  file >> nodes >> facets;
  Skin skin;
  skin.nodes_m.resize(nodes);
  skin.triangles.resize(facets);
  for (Vec3& node : skin.nodes_m) file >> node[0] >> node[1] >> node[2];
  for (Triangle& t : skin.triangles) file >> t[0] >> t[1] >> t[2];
  if (!file || !testing::is_closed(skin)) {
    std::fprintf(stderr, "bench_air: %s is no closed surface of nodes and facets\n", path);
    std::exit(2);
  }
  return skin;
}

/// How often the surface goes around a place: 1 inside. A. van Oosterom, J. Strackee, IEEE Trans. BME-30 (1983).
double calc_winding(const Skin& skin, const Vec3& place) {
  double sum = 0.0;
  for (const Triangle& t : skin.triangles) {
    const Vec3 a = skin.nodes_m[t[0]] - place, b = skin.nodes_m[t[1]] - place, c = skin.nodes_m[t[2]] - place;
    const double x = norm(a), y = norm(b), z = norm(c);
    sum += 2.0 * std::atan2(dot(a, cross(b, c)), x * y * z + dot(a, b) * z + dot(b, c) * x + dot(c, a) * y);
  }
  return sum / (4.0 * std::numbers::pi);
}

/// Eight sources far from the surface and from each other, monopoles and dipoles of changing sign.
Sources fill_body(const Skin& skin) {
  const Sphere sphere = find_enclosing_sphere(skin.nodes_m);
  struct Place {
    Vec3 at_m{};
    double room_m = 0.0;
  };
  std::vector<Place> places;
  const int steps = 15;
  for (int i = -steps; i <= steps; ++i)
    for (int j = -steps; j <= steps; ++j)
      for (int k = -steps; k <= steps; ++k) {
        const Vec3 at = sphere.centre_m + (sphere.radius_m / steps) * Vec3{1.0 * i, 1.0 * j, 1.0 * k};
        double room = 1e300;
        for (const Vec3& node : skin.nodes_m) room = std::min(room, norm(node - at));
        if (room > 0.05 * sphere.radius_m && calc_winding(skin, at) > 0.5) places.push_back({at, room});
      }
  Sources sources;
  while (sources.size() < 8 && !places.empty()) {
    const auto best = std::max_element(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.room_m < b.room_m; });
    const double sign = sources.size() % 2 == 0 ? 1.0 : -1.0, turn = 2.4 * static_cast<double>(sources.size());
    const Vec3 to = normalise(Vec3{std::cos(turn), std::sin(turn), 0.5 * sign});
    sources.push_back({best->at_m, sign, 0.2 * sphere.radius_m * to});
    const Vec3 taken = best->at_m;
    for (Place& place : places) place.room_m = std::min(place.room_m, 0.5 * norm(place.at_m - taken));
  }
  return sources;
}

void measure_sources(const char* name, const Skin& skin, const Sources& sources) {
  const RadiatingSurface surface = skin.make_surface();
  const double radius = find_enclosing_sphere(surface.get_nodes()).radius_m;
  const double spacing = std::sqrt(surface.calc_area_m2() / (static_cast<double>(surface.count_nodes()) * std::sqrt(3.0) / 2.0));
  const double highest = 2.0 * std::numbers::pi / (kNodesPerWave * spacing);
  const auto found = testing::find_source_errors(surface, sources, testing::spread_wave_numbers(0.1 / radius, highest, kCount));
  std::printf("{\"name\": \"%s\", \"nodes\": %zu, \"radius_m\": %g, \"sources\": %zu, \"rows\": [", name, surface.count_nodes(), radius,
              sources.size());
  for (const testing::SourceErrors& one : found)
    std::printf("%s\n {\"k\": %g, \"kr\": %g, \"near_db\": %.2f, \"far_db\": %.2f, \"products\": %d, \"converged\": %s}",
                &one == &found[0] ? "" : ",", one.k, one.k * radius, one.near_db, one.far_db, one.products,
                one.is_converged ? "true" : "false");
  std::printf("], \"cpu_s\": %.1f}\n", find_cpu_s());
}

int run(int count, char** words) {
  const std::string what = count > 2 ? words[1] : "";
  if (what == "spheres" && count > 4) {
    std::vector<double> wave_numbers;
    for (int i = 4; i < count; ++i) wave_numbers.push_back(std::atof(words[i]));
    measure_spheres(std::atoi(words[2]), std::atoi(words[3]), wave_numbers);
    return 0;
  }
  if (what != "sources") {
    std::fprintf(stderr, "usage: bench_air spheres N ORDER K... | bench_air sources plate|bowl|bell SPACING_M | bench_air sources FILE\n");
    return 2;
  }
  const std::string body = words[2];
  if (count < 4) {
    const Skin skin = read_skin(words[2]);
    measure_sources("surface", skin, fill_body(skin));
    return 0;
  }
  const double spacing = std::atof(words[3]);
  if (body == "plate") {
    const auto cut = [&](double length) { return std::max(1, static_cast<int>(std::lround(length / spacing))); };
    measure_sources("plate", testing::make_box({0.3, 0.2, 0.01}, {cut(0.3), cut(0.2), cut(0.01)}),
                    testing::fill_plate(0.004, {34, 22}, 1.0));
  } else if (body == "bowl") {
    measure_sources("bowl", testing::make_bowl(0.15, spacing), testing::fill_bowl(0.15, 0.075));
  } else {
    measure_sources("bell", testing::make_bell(spacing), testing::fill_bell(0.04));
  }
  return 0;
}

}  // namespace

int main(int count, char** words) { return run(count, words); }
