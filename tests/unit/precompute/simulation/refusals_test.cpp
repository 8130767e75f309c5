// Invalid jobs: one error with file and line, the same with --validate, and no output files.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/simulation/simulate.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/precompute/comm/world.hpp"

namespace carillon::simulation {
namespace {

constexpr std::string_view kMaterial =
    R"("material": {"young_modulus_pa": 70e9, "poisson_ratio": 0.33, "density_kg_m3": 2700,
                 "damping": {"rayleigh": {"alpha1_s": 1e-8, "alpha2_per_s": 2}}})";
constexpr std::string_view kOutputs = R"(, "sound": "bar.wav", "record": "bar.json")";
/// A cantilever struck at its free end, and a square sheet clamped along its rim.
const std::string kBar = fmt::format(R"({{
  "simulate": {{
    "duration_s": 0.002,
    "bodies": [
      {{"name": "bar", "shape": {{"bar": {{"length_m": 0.1, "width_m": 0.02, "thickness_m": 0.01, "nodes": 150}}}},
       "element": "T10",
       "fixed": "x-min",
       {}}}
    ],
    "impulses": [{{"time_s": 0.001, "body": "bar", "point_m": [0.05, 0, 0.005], "impulse_n_s": [0, 0, -0.001], "duration_s": 4e-4}}],
    "microphones": [[0, 0, 0.5]]
  }}{}
}})",
                                     kMaterial, kOutputs);
constexpr std::string_view kSheet = R"("sheet": {"shape": "rectangle", "length_m": 0.3, "width_m": 0.3, "thickness_m": 0.001, "cells": 4})";
const std::string kPlate = fmt::format(R"({{
  "simulate": {{
    "duration_s": 0.002,
    "bodies": [{{"name": "plate", {}, "fixed": "rim", {}}}],
    "microphones": [[0, 0, 0.5]]
  }},
  "sound": "plate.wav"
}})",
                                       kSheet, kMaterial);

struct Refusal {
  std::string name;
  std::string_view job, from, to;  // replaces the first `from` of a valid job by `to`
  std::string_view words;          // part of the message
  bool names_line = true;
};

/// Name of the bar, and its drive.
std::string add_drive(std::string_view path, std::string_view node_set) {
  return fmt::format(R"("name": "bar", "drive": [{{"node_set": "{}", "path": [{}]}}])", node_set, path);
}

const std::vector<Refusal>& list_refusals() {
  static const std::string too_fast = add_drive("[0, 0, 0, 0], [0.001, 0, 0, 1]", "x-max");
  static const std::string no_start = add_drive("[0, 0, 0, 1], [0.1, 0, 0, 1]", "x-max");
  static const std::string held = add_drive("[0, 0, 0, 0], [0.1, 0, 0, 0.001]", "x-min");
  static const std::string with_sheet = fmt::format(R"("name": "bar", {})", kSheet);
  static const std::string two = fmt::format(R"("bodies": [{{"name": "bar", "mesh": "b.msh", {}}}, )", kMaterial);
  static const std::vector<Refusal> refusals = {
      {"unknown key", kBar, "duration_s", "duraton_s", "did you mean"},
      {"overlapping striker", kBar, R"("microphones")",
       R"("strikers": [{"sphere_m": 0.01, "mass_kg": 0.1, "position_m": [0, 0, 0.012]}], "microphones")", "deep in body"},
      {"overlapping floor", kBar, R"("microphones")", R"("obstacles": [{"plane": {"point_m": [0, 0, 0]}}], "microphones")",
       "deep in obstacle"},
      {"faster than sound", kBar, R"("name": "bar")", too_fast, "faster than sound"},
      {"path that does not begin at rest", kBar, R"("name": "bar")", no_start, "[t, 0, 0, 0]"},
      {"fixed and driven", kBar, R"("name": "bar")", held, "follows a path"},
      {"negative modulus", kBar, "70e9", "-1", "greater than 0"},
      {"no such node set", kBar, "x-min", "x-mim", "did you mean 'x-min'"},
      {"empty box", kBar, R"("x-min")", R"([{"box_m": {"min": [9, 9, 9], "max": [9, 9, 9]}}])", "no node lies in the box"},
      {"no output", kBar, kOutputs, "", "nothing is to be written", false},
      {"unknown body", kBar, R"("body": "bar")", R"("body": "bra")", "did you mean \"bar\""},
      {"blow in the air", kBar, "[0.05, 0, 0.005]", "[0, 0, 1]", "from the surface"},
      {"two of a name", kBar, R"("bodies": [)", two, "two bodies"},
      {"sheet and shape", kBar, R"("name": "bar")", with_sheet, "give one"},
      {"element of a sheet", kPlate, R"("fixed": "rim")", R"("fixed": "rim", "element": "T10")", "for solids"},
      {"hinged solid", kBar, R"("fixed": "x-min")", R"("hinged": "x-max")", "for sheets"},
      {"step of nothing", kBar, R"("duration_s": 0.002)", R"("duration_s": 0.002, "step_s": 0)", "out of range"},
      {"fixed and hinged", kPlate, R"("fixed": "rim")", R"("fixed": "rim", "hinged": "x-min")", "is hinged here"},
  };
  return refusals;
}

std::string spoil(const Refusal& refusal) {
  std::string text(refusal.job);
  const std::size_t at = text.find(refusal.from);
  if (at == std::string::npos) ADD_FAILURE() << refusal.name << ": the good job has no " << refusal.from;
  return text.replace(std::min(at, text.size()), refusal.from.size(), refusal.to);
}

TEST(RefusedJobs, one_error_without_output) {
  const auto& world = comm::world();
  const tests::Folder own;  // all ranks use rank 0's
  const std::filesystem::path folder = world.broadcast(own.path().string());
  for (const Refusal& refusal : list_refusals()) {
    const std::filesystem::path job = folder / "job.json";
    if (world.rank() == 0) own.write("job.json", spoil(refusal));
    SimulateOptions options;
    options.quiet = true;
    for (const bool validate : {false, true}) {
      if (validate && refusal.name == "no output") continue;  // a prediction needs none
      SCOPED_TRACE(fmt::format("{}, {}", refusal.name, validate ? "--validate" : "simulated"));
      std::string message;
      try {
        options.validate = validate;
        simulate(world, job, options);
      } catch (const InputError& error) {
        message = error.what();
      }
      EXPECT_NE(message.find(refusal.words), std::string::npos) << message;
      EXPECT_TRUE(std::regex_search(message, std::regex(refusal.names_line ? R"(job\.json:[0-9]+)" : R"(job\.json: )"))) << message;
    }
    const std::filesystem::directory_iterator files(folder);
    EXPECT_EQ(std::distance(begin(files), end(files)), 1) << refusal.name;
    (void)world.sum(0.0);  // barrier before the next job is written
  }
}

/// A step longer than the stable one is only an upper limit.
TEST(RefusedJobs, long_step_accepted) {
  const auto& world = comm::world();
  const tests::Folder own;
  const std::filesystem::path job = std::filesystem::path(world.broadcast(own.path().string())) / "job.json";
  std::string text(kPlate);
  text.replace(text.find(R"("duration_s")"), 12, R"("step_s": 1e-3, "duration_s")");
  if (world.rank() == 0) own.write("job.json", text);
  SimulateOptions options;
  options.quiet = true;
  EXPECT_FALSE(simulate(world, job, options).is_stopped);
  (void)world.sum(0.0);  // barrier before rank 0 removes its folder
}

}  // namespace
}  // namespace carillon::simulation
