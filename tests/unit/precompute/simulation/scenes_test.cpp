// Small scenes from job to record: visibility, bent bodies, and predictions.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "precompute/simulation/simulate.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/precompute/comm/world.hpp"

namespace carillon::simulation {
namespace {

/// A cantilever along x with a receiver 0.5 m above; `body` and `scene` are further keys, `others` further bodies.
std::string make_scene(const std::string& body, const std::string& scene, const std::string& others = "", double duration_s = 0.004) {
  return fmt::format(R"({{"simulate": {{
    "duration_s": {}, "bodies": [
      {{"name": "bar", "shape": {{"bar": {{"length_m": 0.1, "width_m": 0.02, "thickness_m": 0.01, "nodes": 150}}}}, "fixed": "x-min",
        "material": {{"young_modulus_pa": 70e9, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": {{"rayleigh": {{"alpha1_s": 1e-8}}}}}}{}}}{}],
    "microphones": [[0, 0, 0.5]]{}}}, "sound": "bar.wav", "record": "record.json"}})",
                     duration_s, body, others, scene);
}

struct Record {
  double peak_pa = 0, book_error = 0, energy_j = 0, work_j = 0, mode_hz = 0;
  std::size_t warnings = 0;
};

Record play(const std::string& scene) {
  const tests::Folder own;
  const auto& world = comm::world();
  const std::filesystem::path folder = world.broadcast(own.path().string());
  if (world.is_root()) own.write("job.json", scene);
  SimulateOptions options;
  options.quiet = true;
  simulate(world, folder / "job.json", options);
  Record record;
  if (!world.is_root()) return record;
  const base::Document document = base::parse_document(tests::read_all(folder / "record.json"), "record.json");
  base::Object root = document.root();
  record.peak_pa = root.number("peak_pa");
  record.book_error = root.number("book_error");
  if (root.has("warnings")) record.warnings = root.entries("warnings", 10).size();
  for (base::Object& bent : root.objects("bent")) {
    record.energy_j = bent.number("energy_j");
    if (bent.has("mode_hz")) record.mode_hz = bent.number("mode_hz");
  }
  for (base::Object& book : root.objects("books")) record.work_j = book.number("work_j");
  return record;
}

constexpr const char* kBlow =
    R"(, "impulses": [{"time_s": 0.001, "body": "bar", "point_m": [0.05, 0, 0.005], "impulse_n_s": [0, 0, -0.001]}])";

TEST(Walls, OccludersOfAllKinds) {
  const auto hear = [](const std::string& scene, const std::string& others = "", const std::string& radiation = "rayleigh") {
    return play(make_scene("", fmt::format(R"({}, "radiation": "{}"{})", kBlow, radiation, scene), others)).peak_pa;
  };
  const auto plate = [](double x, const char* more) {
    return fmt::format(R"(, {{"name": "plate", "position_m": [{}, 0, 0.25], "fixed": "rim", {}
      "sheet": {{"shape": "rectangle", "length_m": 0.5, "width_m": 0.5, "thickness_m": 0.001, "cells": 4}}, "material": "steel"}})",
                       x, more);
  };
  const double free = hear("");
  const bool is_root = comm::world().is_root();
  const auto is = [&](double peak, double wanted) { return !is_root || peak == wanted; };
  EXPECT_TRUE(!is_root || free > 0.01) << free;
  EXPECT_TRUE(is(hear(R"(, "obstacles": [{"box": {"min": [-1, -1, 0.2], "max": [1, 1, 0.3]}}])"), 0.0));
  EXPECT_TRUE(is(hear(R"(, "obstacles": [{"sphere": {"centre_m": [0, 0, 0.25], "radius_m": 0.2}}])"), 0.0));
  EXPECT_TRUE(is(hear(R"(, "obstacles": [{"plane": {"point_m": [0, 0, 0.4], "normal": [0, 0, -1]}}])"), 0.0));
  EXPECT_TRUE(is(hear(R"(, "strikers": [{"sphere_m": 0.2, "mass_kg": 1, "position_m": [0, 0, 0.25]}])"), 0.0));
  EXPECT_TRUE(is(hear("", plate(0, R"("sounds": false,)")), 0.0));
  EXPECT_TRUE(is(hear(R"(, "obstacles": [{"box": {"min": [-1, -1, 0.2], "max": [1, 1, 0.3]}}])", "", "paper2001"), 0.0));
  // Obstacle off the line of sight, behind the microphone, and without visibility.
  EXPECT_TRUE(is(hear(R"(, "obstacles": [{"box": {"min": [0.2, -1, 0.2], "max": [1, 1, 0.3]}}])"), free));
  EXPECT_TRUE(is(hear(R"(, "obstacles": [{"box": {"min": [-1, -1, 0.6], "max": [1, 1, 0.7]}}])"), free));
  EXPECT_TRUE(is(hear("", plate(0.6, R"("sounds": false,)")), free));
  EXPECT_GT(hear(R"(, "visibility": false, "obstacles": [{"box": {"min": [-1, -1, 0.2], "max": [1, 1, 0.3]}}])") + (is_root ? 0.0 : 1.0),
            0.5 * free);
  // Microphone inside the obstacle.
  const Record deaf = play(make_scene(
      "", fmt::format(R"({}, "radiation": "rayleigh", "obstacles": [{{"sphere": {{"centre_m": [0, 0, 0.5], "radius_m": 0.1}}}}])", kBlow)));
  EXPECT_TRUE(!is_root || (deaf.peak_pa == 0.0 && deaf.warnings == 1)) << deaf.warnings;
}

TEST(Walls, KirchhoffWithoutVisibility) { EXPECT_THROW(play(make_scene("", R"(, "visibility": true)")), InputError); }

TEST(Bent, ReleasedBody) {
  const bool is_root = comm::world().is_root();
  // Bent by a force, a mode, and a displaced end; no work after the start.
  for (
      const char* bend :
      {R"(, "bend": {"force_n": [0, 0, -10], "point_m": [0.05, 0, 0.005]})", R"(, "bend": {"mode": 1, "amplitude_m": 1e-5})",
       R"(, "bend": {"node_set": "x-max", "displacement_m": [0, 0, -1e-5]})",
       R"(, "bend": [{"table_m": [[0.05, -0.01, -0.005, 0, 0, -1e-5], [0.05, 0.01, -0.005, 0, 0, -1e-5]]}], "position_m": [0, 0, 0.1], "rotation_deg": [0, 0, 30])"}) {
    const Record record = play(make_scene(bend, ""));
    if (!is_root) continue;
    EXPECT_GT(record.peak_pa, 1e-4) << bend;
    EXPECT_GT(record.energy_j, 1e-9) << bend;
    EXPECT_LT(std::abs(record.work_j), 1e-12 * record.energy_j) << bend;
    EXPECT_LT(record.book_error, 1e-6) << bend;
  }
  // Clapeyron: F u / 2, and u = F L^3 / 3 E I to some percent.
  const Record pulled = play(make_scene(R"(, "bend": {"force_n": [0, 0, -10], "point_m": [0.05, 0, 0]})", ""));
  if (is_root) {
    EXPECT_NEAR(pulled.energy_j, 0.5 * 100.0 * 1e-3 / (3.0 * 70e9 * 0.02 * 1e-6 / 12.0), 0.08 * pulled.energy_j);
  }
  // Rotation of the body leaves the energy unchanged.
  const Record turned =
      play(make_scene(R"(, "bend": {"force_n": [0, 0, -10], "point_m": [0.05, 0, 0]}, "rotation_deg": [40, 50, 60])", ""));
  if (is_root) {
    EXPECT_NEAR(turned.energy_j, pulled.energy_j, 1e-6 * pulled.energy_j);
  }
}

TEST(Bent, ReleaseOfDrivenNodes) {
  const Record record =
      play(make_scene(R"(, "drive": [{"node_set": "x-max", "path": [[0, 0, 0, 0], [0.001, 0, 0, -1e-5]], "release_s": 0.0015}])", ""));
  if (!comm::world().is_root()) return;
  EXPECT_LT(record.book_error, 1e-6);
  EXPECT_GT(record.work_j, 0.0);
}

}  // namespace
}  // namespace carillon::simulation
