// Results do not depend on ranks, partition, or the round trip through a resolved job.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "precompute/mesh/shapes/shapes.hpp"
#include "runtime/base/json.hpp"
#include "tests/system/path/run_program.hpp"

namespace carillon::tests {
namespace {

using testing::HasSubstr;

TEST(Ranks, give_one_answer_on_1_2_and_3) {
  // A brick without symmetry between its axes: distinct frequencies, so shapes compare one by one.
  JobFolder folder;
  mesh::write_gmsh(shapes::make_box({0.05, 0.065, 0.085}, {3, 4, 5}, 2), folder / "mesh.msh");
  folder.write_job({}, R"("band_hz": [20, 50000], "max_modes": 12,)");
  const bank::Bank one = folder.solve(1);
  ASSERT_EQ(one.mode_count(), 12u);
  for (const int ranks : {2, 3}) {
    const bank::Bank other = folder.solve(ranks);
    ASSERT_EQ(other.mode_count(), one.mode_count());
    EXPECT_EQ(other.vertices_m, one.vertices_m);
    EXPECT_EQ(other.triangles, one.triangles);
    for (std::size_t m = 0; m < one.mode_count(); ++m) {
      EXPECT_NEAR(other.eigenvalue_rad2_s2[m] / one.eigenvalue_rad2_s2[m], 1, 1e-9);
      EXPECT_NEAR(other.radiation_gain[m] / one.radiation_gain[m], 1, 1e-5);
      double worst = 0;
      for (std::size_t v = 0; v < one.vertex_count(); ++v)
        for (int d = 0; d < 3; ++d) worst = std::max(worst, std::abs(other.shape_at(v, m)[d] - one.shape_at(v, m)[d]));
      EXPECT_LT(worst, 3 * one.shape_scale[m]) << "mode " << m << " on " << ranks << " ranks";
    }
    EXPECT_NEAR(other.rigid.mass_kg, one.rigid.mass_kg, 1e-12);
    EXPECT_THAT(other.provenance, HasSubstr(fmt::format("\"ranks\" : {}", ranks)));
  }
}

/// The job of a resolved JSON, without the record of its run.
std::string find_job(const std::string& text) {
  base::Json root = base::Json::parse(text).value();
  EXPECT_TRUE(root.has("run"));
  root.erase("run");
  return root.sorted_text();
}

TEST(ResolvedJob, next_to_the_bank_runs_again_and_gives_the_same_bank) {
  JobFolder folder;
  mesh::write_gmsh(shapes::make_box({0.1, 0.02, 0.01}, {8, 2, 1}), folder / "mesh.msh");
  folder.write_job({}, R"("element": "T4", "mass": "lumped",)");
  const bank::Bank first = folder.solve();
  const std::string resolved = read_all(folder / "out.bank.resolved.json");
  EXPECT_EQ(find_job(first.provenance), find_job(resolved));  // the record next to the bank includes the writing of the bank
  for (const char* word : {"\"petsc\"", "\"slepc\"", "\"metis\"", "\"hdf5\"", "\"mpi\"", "\"blas\"", "\"git\"", "\"ranks\"", "\"seconds\"",
                           "\"peak_bytes_largest_rank\"", "\"edge_cut\"", "\"halo_nodes\"", "\"tolerance\"", "\"band_hz\""})
    EXPECT_THAT(resolved, HasSubstr(word));
  std::filesystem::remove(folder / "out.bank");
  const bank::Bank again = folder.solve(1, "out.bank.resolved.json");
  EXPECT_EQ(again.mode_count(), first.mode_count());
  EXPECT_NEAR(again.freq_hz(0) / first.freq_hz(0), 1, 1e-12);
  EXPECT_EQ(again.shape, first.shape);
}

TEST(TwoBodies, in_one_mesh_have_twelve_rigid_modes_and_every_frequency_twice) {
  mesh::TetMesh both = shapes::make_box({0.1, 0.02, 0.01}, {8, 2, 1}, 2);
  const mesh::TetMesh one = both;
  const auto shift = static_cast<std::int32_t>(one.nodes_m.size());
  for (auto x : one.nodes_m) both.nodes_m.push_back({x[0], x[1] + 0.1, x[2]});
  for (const auto node : one.tets) both.tets.push_back(node + shift);
  both.regions.insert(both.regions.end(), one.regions.begin(), one.regions.end());
  both.node_sets.clear();
  JobFolder folder;
  mesh::write_gmsh(both, folder / "mesh.msh");
  folder.write_job({}, R"("max_modes": 6,)");
  const bank::Bank bank = folder.solve(2);
  EXPECT_EQ(bank.counts.components, 2);
  EXPECT_EQ(bank.counts.rigid_modes, 12);
  ASSERT_EQ(bank.mode_count(), 6u);
  for (std::size_t m = 0; m < 6; m += 2) EXPECT_NEAR(bank.freq_hz(m + 1) / bank.freq_hz(m), 1, 1e-6);
  EXPECT_GT(bank.freq_hz(2), 1.01 * bank.freq_hz(1));
}

TEST(MaxModes, gives_the_lowest_of_the_band_and_says_that_there_are_more) {
  JobFolder folder;
  mesh::write_gmsh(shapes::make_box({0.1, 0.02, 0.01}, {8, 2, 1}), folder / "mesh.msh");
  folder.write_job({}, R"("element": "T4", "band_hz": [20, 40000],)");
  const bank::Bank all = folder.solve();
  EXPECT_TRUE(all.complete);
  ASSERT_GT(all.mode_count(), 3u);
  folder.write_job({}, R"("element": "T4", "band_hz": [20, 40000], "max_modes": 3,)");
  const bank::Bank three = folder.solve();
  EXPECT_FALSE(three.complete);
  ASSERT_EQ(three.mode_count(), 3u);
  // Modes of the lowest corrected frequencies; on this mesh bending is too high, so the lowest uncorrected ones differ.
  std::vector<double> wanted = all.corrected.freq_hz, found = three.corrected.freq_hz;
  std::sort(wanted.begin(), wanted.end());
  std::sort(found.begin(), found.end());
  for (std::size_t m = 0; m < 3; ++m) EXPECT_NEAR(found[m] / wanted[m], 1, 1e-8);
}

TEST(HeldNodes, by_name_and_by_box_give_the_same_modes) {
  JobFolder folder;
  mesh::write_gmsh(shapes::make_box({0.1, 0.02, 0.01}, {8, 2, 1}), folder / "mesh.msh");
  folder.write_job({}, R"("element": "T10", "max_modes": 3, "fixed": {"node_set": "x-max"},)");
  const bank::Bank named = folder.solve();
  folder.write_job({}, R"("element": "T10", "max_modes": 3, "fixed": {"box_m": {"min": [0.05, -1, -1], "max": [0.05, 1, 1]}},)");
  const bank::Bank boxed = folder.solve(2);
  for (std::size_t m = 0; m < 3; ++m) EXPECT_NEAR(named.freq_hz(m) / boxed.freq_hz(m), 1, 1e-8);
  EXPECT_EQ(named.counts.rigid_modes, 0);
}

TEST(Progress, names_every_phase_begins_with_wide_bars_and_quiet_shows_them_alone) {
  JobFolder folder;
  mesh::write_gmsh(shapes::make_box({0.1, 0.02, 0.01}, {4, 2, 1}), folder / "mesh.msh");
  folder.write_job({}, R"("element": "T4", "max_modes": 1,)");
  const Outcome loud = folder.run(2);
  EXPECT_EQ(loud.code, 0);
  for (const char* word : {"on 2 ranks\n", "read ", "partition ", "faces cut", "halo nodes", "assemble ", "modes ", "errors ", "collect ",
                           "write ", " MB peak", "modes in 20 .. 20000 Hz", "by inertia, 6 rigid", "of the body to about"})
    EXPECT_THAT(loud.output, HasSubstr(word));
  EXPECT_EQ(loud.output.find("BLAS"), std::string::npos) << loud.output;
  // A first-order bar of four elements is off by hundreds of cents; the warning precedes the bank and its figures.
  const std::size_t warning = loud.output.find("warning: frequencies can be wrong by ");
  ASSERT_NE(warning, std::string::npos) << loud.output;
  EXPECT_LT(warning, loud.output.find("modes in 20 .. 20000 Hz"));
  EXPECT_NE(loud.output.find("\"accuracy_cents\"", warning), std::string::npos);
  const Outcome quiet = folder.run(1, "--quiet job.json");
  EXPECT_EQ(quiet.code, 0);
  EXPECT_THAT(quiet.output, testing::StartsWith("carillon-precompute: warning: frequencies can be wrong by "));
  EXPECT_EQ(std::count(quiet.output.begin(), quiet.output.end(), '\n'), 1) << quiet.output;
}

}  // namespace
}  // namespace carillon::tests
