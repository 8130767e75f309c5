// Invalid jobs and meshes: exit code, one message with place and remedy, no files left behind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "precompute/mesh/shapes/shapes.hpp"
#include "tests/system/path/run_program.hpp"

namespace carillon::tests {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct BadCase {
  std::string name;
  int ranks = 1;
  std::function<void(const JobFolder&)> spoil;  // modifies the valid job.json and mesh.msh
  std::vector<std::string> words;               // expected in the message
};

void write_good(const JobFolder& folder) {
  mesh::write_gmsh(shapes::make_box({0.1, 0.02, 0.01}, {1, 1, 1}), folder / "mesh.msh");
  folder.write_job({}, R"("element": "T4",)");
}

int count(const std::string& text, const std::string& word) {
  int times = 0;
  for (auto at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++times;
  return times;
}

void PrintTo(const BadCase& bad, std::ostream* out) { *out << bad.name; }

class BadJobs : public testing::TestWithParam<BadCase> {};

TEST_P(BadJobs, end_with_code_2_and_one_message_and_leave_nothing_behind) {
  JobFolder folder;
  write_good(folder);
  GetParam().spoil(folder);
  const auto before = folder.list();
  const Outcome outcome = folder.run(GetParam().ranks);
  EXPECT_EQ(outcome.code, 2) << outcome.output;
  for (const auto& word : GetParam().words) EXPECT_THAT(outcome.output, HasSubstr(word));
  EXPECT_EQ(count(outcome.output, "carillon-precompute: error:"), 1) << outcome.output;
  EXPECT_EQ(folder.list(), before);
}

INSTANTIATE_TEST_SUITE_P(
    All, BadJobs,
    testing::Values(
        BadCase{"no_job", 2, [](const JobFolder& f) { std::filesystem::remove(f / "job.json"); }, {"job.json", "job file"}},
        BadCase{"unknown_key", 3, [](const JobFolder& f) { f.write_job({}, "\"elmnt\": \"T4\","); }, {"job.json:1", "elmnt", "element"}},
        BadCase{"no_json", 1, [](const JobFolder& f) { f.write("job.json", "{ \"mesh\": "); }, {"job.json:1"}},
        BadCase{"no_mesh", 2, [](const JobFolder& f) { std::filesystem::remove(f / "mesh.msh"); }, {"mesh.msh"}},
        BadCase{"no_mesh_format", 2, [](const JobFolder& f) { f.write("mesh.msh", "this is no mesh\n"); }, {"mesh.msh"}},
        BadCase{"flat_element",
                2,
                [](const JobFolder& f) {
                  mesh::TetMesh flat;
                  flat.nodes_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
                  flat.tets = {0, 1, 2, 3};
                  flat.regions = {0};
                  mesh::write_gmsh(flat, f / "mesh.msh");
                },
                {"mesh.msh"}},
        BadCase{"more_ranks_than_elements", 7, [](const JobFolder&) {}, {"mesh.msh: ", "6 tetrahedra", "7 ranks", "at most 6"}},
        BadCase{"dense_beyond_its_size",
                2,
                [](const JobFolder& f) {
                  mesh::write_gmsh(shapes::make_box({0.1, 0.02, 0.01}, {40, 8, 7}), f / "mesh.msh");
                  f.write_job({}, R"("element": "T4", "solver": {"method": "dense"},)");
                },
                {"job.json", "solver.method", "8000 unknowns", "8856", "automatic"}},
        BadCase{"unknown_node_set",
                2,
                [](const JobFolder& f) { f.write_job({}, R"("fixed": "x-mim",)"); },
                {"job.json", "fixed", "x-mim", "x-min"}},
        BadCase{"empty_box",
                1,
                [](const JobFolder& f) { f.write_job({}, R"("fixed": {"box_m": {"min": [5, 5, 5], "max": [6, 6, 6]}},)"); },
                {"job.json", "fixed"}},
        BadCase{
            "everything_held",
            2,
            [](const JobFolder& f) { f.write_job({}, R"("element": "T4", "fixed": {"box_m": {"min": [-1, -1, -1], "max": [1, 1, 1]}},)"); },
            {"mesh.msh: ", "names every node"}},
        BadCase{
            "bank_in_place_of_a_folder", 2, [](const JobFolder& f) { std::filesystem::create_directory(f / "out.bank"); }, {"out.bank"}},
        BadCase{"bank_below_a_file",
                1,
                [](const JobFolder& f) {
                  std::string job = read_all(f / "job.json");
                  job.replace(job.find("out.bank"), 8, "mesh.msh/out.bank");
                  f.write("job.json", job);
                },
                {"mesh.msh", "bank"}}),
    [](const auto& info) { return info.param.name; });

TEST(CommandLine, without_a_job_says_how_to_call_it) {
  const JobFolder folder;
  const Outcome outcome = folder.run(2, "");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(count(outcome.output, "JOB is required"), 1) << outcome.output;
  const Outcome help = folder.run(1, "--help");
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.output, AllOf(HasSubstr("mpirun -np"), HasSubstr("JOB"), HasSubstr("--quiet")));
  const Outcome version = folder.run(1, "--version");
  EXPECT_EQ(version.code, 0);
  EXPECT_THAT(version.output, HasSubstr("carillon-precompute "));
}

TEST(Output, folder_that_is_missing_is_made) {
  JobFolder folder;
  write_good(folder);
  std::string job = read_all(folder / "job.json");
  job.replace(job.find("out.bank"), 8, "new/deep/out.bank");
  folder.write("job.json", job);
  EXPECT_EQ(folder.solve(1, "job.json", "new/deep/out.bank").counts.tets, 6);
}

TEST(FailedRun, leaves_an_older_bank_as_it_was) {
  JobFolder folder;
  write_good(folder);
  folder.solve();
  const std::string before = read_all(folder / "out.bank");
  folder.write("mesh.msh", "spoilt");
  EXPECT_EQ(folder.run().code, 2);
  EXPECT_EQ(read_all(folder / "out.bank"), before);
}

TEST(Band, without_a_mode_gives_a_silent_bank_and_a_warning) {
  JobFolder folder;
  write_good(folder);
  folder.write_job({}, R"("element": "T4", "band_hz": [20, 30],)");
  const Outcome outcome = folder.run();
  EXPECT_EQ(outcome.code, 0) << outcome.output;
  EXPECT_THAT(outcome.output, HasSubstr("no mode in the band"));
  EXPECT_EQ(bank::read_bank(folder / "out.bank").mode_count(), 0u);
}

}  // namespace
}  // namespace carillon::tests
