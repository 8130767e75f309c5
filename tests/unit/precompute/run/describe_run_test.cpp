// The record of a run: phases of the last setting, damping laws, materials.
#include <gtest/gtest.h>

#include <string>

#include "precompute/run/stages.hpp"

namespace carillon::run {
namespace {

material::Material parse_material(const std::string& text) {
  return job::parse_job(R"({"body": {"shape": "sphere", "radius_m": 1}, "bank": "b.hdf", "material": )" + text + "}", "/tmp/job.json")
      .material;
}

base::Json describe(const std::string& damping) {
  const std::string text = R"({"young_modulus_pa": 2e11, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": )" + damping + "}";
  return describe_materials({parse_material(text)}, {0.5})[0];
}

void run_phase(Run& run, const std::string& name) {
  run.log.begin(name, "");
  run.log.end();
}

TEST(DescribeMaterials, writes_every_damping_law) {
  EXPECT_EQ(describe(R"({"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 0.5}})")["damping"]["rayleigh"]["alpha2_per_s"].as_double(), 0.5);
  EXPECT_EQ(describe(R"({"internal_friction": {"tan_phi": 0.01}})")["damping"]["internal_friction"]["tan_phi"].as_double(), 0.01);
  const base::Json caughey = describe(R"({"caughey": {"powers": [0, 1], "coefficients": [2, 1e-7]}})");
  EXPECT_EQ(caughey["damping"]["caughey"].size(), 2u);
  const base::Json table = describe(R"({"loss_table": [[100, 0.01], [1000, 0.02]]})");
  EXPECT_EQ(table["damping"]["loss_table"][1]["loss_factor"].as_double(), 0.02);
  EXPECT_EQ(table["volume_m3"].as_double(), 0.5);
  EXPECT_FALSE(table.has("orthotropic"));
}

TEST(DescribeMaterials, writes_the_axes_of_an_orthotropic_material) {
  const base::Json found = describe_materials({parse_material("\"spruce\"")}, {1.0})[0];
  EXPECT_EQ(found["orthotropic"]["young_modulus_pa"].size(), 3u);
  EXPECT_EQ(found["orthotropic"]["axes"][0].size(), 3u);
}

TEST(DescribeRun, sums_the_phases_of_the_last_setting_and_separates_trials) {
  run::Run run(MPI_COMM_WORLD, RunOptions{.quiet = true});
  for (const char* phase : {"read", "modes", "errors", "read", "partition", "assemble", "modes", "errors", "collect", "write"})
    run_phase(run, phase);
  run.log.warn_once("a warning");
  run.log.warn_once("a warning");
  Solution found;
  found.setting.element = job::Element::T4;
  found.body.mesher_warnings = {"closed a hole"};
  found.solved.modes.seconds.factor = 2.0;
  found.solved.modes.seconds.solve = 1.0;
  const base::Json record = describe_run(run, found, {});
  const base::Json& seconds = record["phase_seconds"];
  for (const char* phase : {"trials", "read", "partition", "assemble", "factor", "solve", "orthogonalise", "errors", "write"})
    EXPECT_TRUE(seconds.has(phase)) << phase;
  EXPECT_FALSE(seconds.has("modes"));
  EXPECT_EQ(seconds["factor"].as_double(), 2.0);
  EXPECT_EQ(seconds["solve"].as_double(), 1.0);
  EXPECT_EQ(seconds["orthogonalise"].as_double(), 0.0);
  EXPECT_EQ(record["stations"].size(), 10u);
  EXPECT_EQ(record["chosen"]["element"].as_string(), "T4");
  EXPECT_EQ(record["mesh"]["warnings"][0].as_string(), "closed a hole");
  EXPECT_EQ(record["warnings"].size(), 1u);
  EXPECT_FALSE(record["work"]["factor"].has("messages"));
}

}  // namespace
}  // namespace carillon::run
