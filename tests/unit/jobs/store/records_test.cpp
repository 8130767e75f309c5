#include "jobs/store/records.hpp"

#include <gtest/gtest.h>

#include "jobs/store/store.hpp"
#include "jobs/store/warning_kinds.hpp"
#include "tests/support/folder.hpp"

namespace {

using namespace carillon;
using carillon::tests::Folder;

TEST(Records, ids_are_64_lower_case_hex_digits) {
  const std::string good(64, 'a');
  EXPECT_TRUE(store::parse_id(good));
  for (const std::string& bad :
       {std::string(63, 'a'), std::string(65, 'a'), std::string(64, 'A'), std::string(64, 'g'), std::string("../../etc/passwd"),
        std::string(), "../" + std::string(61, 'a'), std::string(63, 'a') + "/", std::string(63, 'a') + std::string(1, '\0')})
    EXPECT_FALSE(store::parse_id(bad)) << bad;
}

TEST(Records, round_trip_of_paths_with_any_bytes) {
  for (const std::string& name :
       {std::string("/a/b.json"), std::string("/\xff\xfe/\x80"), std::string("/a\\x41\\y"), std::string("/ä/\xe2\x82\xac"),
        std::string("/\xed\xa0\x80"), std::string("/\xc0\xaf"), std::string("/a\nb\x1b[2J"), std::string("/\xf4\x90\x80\x80")}) {
    EXPECT_EQ(store::from_text(store::to_text(name)), std::filesystem::path(name));
  }
  EXPECT_EQ(store::to_text("/\xff"), "/\\xff");
  EXPECT_EQ(store::to_text("/ä"), "/ä");
}

TEST(Records, round_trip_of_request_and_state) {
  const Folder folder;
  store::Request request;
  request.id = std::string(64, 'b');
  request.job = "{\"a\":\"\\\"\\n\"}";
  request.input_kind = store::InputKind::mesh;
  request.input_format = "msh";
  request.input_sha256 = std::string(64, '1');
  request.solver = "solver \"1\"";
  request.resources = {3, 1.5, 60.25};
  request.engine = store::JobEngine::slurm;
  request.job_file = "/a; rm -rf \"$HOME\"\n.json";
  request.submitted_unix_s = 1.7e9;
  store::write_request(folder.path(), request);
  const auto read = store::read_request(folder.path());
  ASSERT_TRUE(read);
  EXPECT_EQ(store::format_request(*read), store::format_request(request));
  EXPECT_EQ(read->job_file, request.job_file);
  EXPECT_EQ(read->resources.time_limit_s, 60.25);
  store::write_state(folder.path(), {store::JobState::failed, "no \"mesh\"", 4, 3});
  const auto state = store::read_state(folder.path());
  ASSERT_TRUE(state);
  EXPECT_EQ(state->state, store::JobState::failed);
  EXPECT_EQ(state->reason, "no \"mesh\"");
  EXPECT_EQ(state->attempts * 10 + state->failures, 43);
  EXPECT_EQ(store::format_request(request, true).find('\n'), store::format_request(request, true).size() - 1);
}

TEST(Records, truncated_record_is_an_error) {
  const Folder folder;
  store::Request request;
  request.id = std::string(64, 'b');
  request.input_kind = store::InputKind::shape;
  request.job = "{}";
  request.solver = "solver";
  const std::string text = store::format_request(request);
  for (std::size_t length = 0; length + 1 < text.size(); ++length) {
    folder.write("request.json", text.substr(0, length));
    EXPECT_THROW(store::read_request(folder.path()), InputError) << length;
  }
  EXPECT_FALSE(store::read_state(folder.path()));
}

TEST(Records, progress_is_the_last_complete_line) {
  const Folder folder;
  EXPECT_FALSE(store::read_progress(folder.path()));
  const std::string first = R"({"phase": "solve", "percent": 40, "modes_done": 3, "modes_wanted": 9, "seconds_left": 2.5, "seconds": 7})";
  const std::string second = R"({"phase": "write", "percent": 99.5, "seconds": 8})";
  folder.write("progress.jsonl", first + "\n" + second + "\n");
  auto progress = store::read_progress(folder.path());
  ASSERT_TRUE(progress);
  EXPECT_EQ(progress->phase, "write");
  EXPECT_EQ(progress->percent, 99.5);
  EXPECT_EQ(progress->modes_done, -1);
  for (std::size_t cut = 0; cut <= second.size(); ++cut) {  // the line end of the second is not there yet
    folder.write("progress.jsonl", first + "\n" + second.substr(0, cut));
    progress = store::read_progress(folder.path());
    ASSERT_TRUE(progress) << cut;
    EXPECT_EQ(progress->phase, "solve");
    EXPECT_EQ(progress->modes_wanted, 9);
  }
  folder.write("progress.jsonl", first + "\n[1]\n{\"phase\": 7}\n\x01\xff\n{\"phase\": \"x\", \"percent\": 1e400}\n");
  ASSERT_TRUE(store::read_progress(folder.path()));
}

TEST(Warnings, warnings_are_grouped) {
  store::WarningKinds kinds;
  for (int i = 0; i < 200; ++i) {
    const std::string job = "bar-" + std::to_string(i) + ".json";
    EXPECT_EQ(kinds.add(job, "frequencies can be wrong by " + std::to_string(50 + i) + " cents"), i == 0);
    EXPECT_FALSE(kinds.add(job, "frequencies can be wrong by 1 cents"));  // twice in one job
  }
  EXPECT_TRUE(kinds.add("cup.json", "/jobs/cup.json:3: the density is small"));
  const std::vector<std::string> lines = kinds.list();
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0], "in 200 jobs, as in bar-0.json: frequencies can be wrong by 50 cents");
  EXPECT_EQ(lines[1], "in cup.json: /jobs/cup.json:3: the density is small");
}

}  // namespace
