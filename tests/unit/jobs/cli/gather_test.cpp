// Jobs from files, folders and manifests.
#include "jobs/cli/gather.hpp"

#include <gtest/gtest.h>

#include "runtime/base/error.hpp"
#include "tests/support/folder.hpp"

namespace carillon::cli {
namespace {

constexpr const char* kJob = R"({"body": {"shape": "bar", "length_m": 0.2, "width_m": 0.02, "thickness_m": 0.005}, "material": "steel"})";

TEST(Gather, folder_without_resolved_jobs) {
  const tests::Folder folder;
  for (const char* name : {"b.json", "a.json", "a.hdf.resolved.json", "note.txt"}) folder.write(name, kJob);
  const std::vector<Source> sources = gather({folder.path().string()}, "solver");
  ASSERT_EQ(sources.size(), 2u);
  EXPECT_TRUE(sources[0].job_file.ends_with("/a.json"));
  EXPECT_EQ(sources[0].request.id, sources[1].request.id);
}

TEST(Gather, manifest_with_comments_inline_jobs_and_errors) {
  const tests::Folder folder;
  folder.write("a.json", kJob);
  const std::string text = std::string("# jobs\n\n  a.json \r\n") + kJob + "\nmissing.json\n";
  const std::string manifest = folder.write("sweep.txt", text).string();
  const std::vector<Source> sources = gather({manifest}, "solver");
  ASSERT_EQ(sources.size(), 3u);
  EXPECT_EQ(sources[0].error, "");
  EXPECT_TRUE(sources[1].job_file.ends_with("sweep.txt#4"));
  EXPECT_NE(sources[2].error.find("sweep.txt:5: "), std::string::npos);
  EXPECT_EQ(gather_one(manifest + "#4", "solver").request.id, sources[0].request.id);
  EXPECT_THROW(gather_one(manifest + "#2", "solver"), InputError);
  EXPECT_THROW(gather_one(manifest + "#5", "solver"), InputError);
  EXPECT_TRUE(is_of_many(manifest));
  EXPECT_FALSE(is_of_many(manifest + "#4"));
  EXPECT_TRUE(is_of_jobs(manifest + "#4"));
}

TEST(Gather, invalid_words) {
  const tests::Folder folder;
  EXPECT_THROW(gather({folder.path().string()}, "solver"), InputError);                                     // empty folder
  EXPECT_THROW(gather({folder.write("empty.txt", "# nothing\n").string()}, "solver"), InputError);          // no jobs
  EXPECT_THROW(gather({folder.write("bank.hdf", std::string("\0\1", 2)).string()}, "solver"), InputError);  // binary
  EXPECT_THROW(list_job_files(folder.write("text.txt", "no job\n").string()), InputError);
  EXPECT_THROW(gather({(folder / "nowhere.txt").string()}, "solver"), InputError);
}

}  // namespace
}  // namespace carillon::cli
