// --validate and --estimate: branches of the prediction.
#include "precompute/run/validate.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::run {
namespace {

using testing::HasSubstr;

constexpr const char* kBar = R"({"shape": "bar", "length_m": 0.2, "width_m": 0.03, "thickness_m": 0.02, "nodes": 300})";

class Validate : public testing::Test {
 protected:
  std::string validate(const std::string& job, bool json) {
    base::write_file(folder_.path() / "job.json", job);
    RunOptions options;
    options.quiet = true;
    options.validate = true;
    options.json = json;
    return validate_job(MPI_COMM_WORLD, folder_.path() / "job.json", options);
  }
  base::Json validate_as_json(const std::string& body, const std::string& more = "") {
    return base::Json::parse(validate(R"({"body": )" + body + R"(, "material": "steel")" + more + "}", true)).value();
  }
  base::TemporaryFolder folder_{"carillon-test-"};
};

TEST_F(Validate, counts_the_modes_and_bounds_the_memory) {
  const base::Json found = validate_as_json(kBar, R"(, "band_hz": [20, 30000])");
  EXPECT_EQ(found["ok"].line(), "true");
  EXPECT_EQ(found["modes"]["how"].as_string(), "counted");
  EXPECT_GT(found["modes"]["count"].as_double(), 5);
  EXPECT_EQ(found["modes"]["low"].as_double(), found["modes"]["high"].as_double());
  EXPECT_EQ(found["unknowns"].as_double(), 3 * found["mesh"]["nodes"].as_double());
  EXPECT_EQ(found["factor"]["how"].as_string(), "analysed");
  EXPECT_GT(found["memory_bytes"]["4"].as_double(), found["memory_bytes"]["1"].as_double());
  EXPECT_LT(found["wall_seconds"]["4"].as_double(), found["wall_seconds"]["1"].as_double());
  EXPECT_EQ(found["fits_here"].line(), "true");
  EXPECT_FALSE(found.has("notes"));
}

TEST_F(Validate, lists_no_more_modes_than_requested) {
  const base::Json found = validate_as_json(kBar, R"(, "band_hz": [20, 60000], "max_modes": 3)");
  EXPECT_EQ(found["modes"]["count"].as_double(), 3);
  const std::string text =
      validate(fmt::format(R"({{"body": {}, "material": "steel", "max_modes": 3, "band_hz": [20, 60000]}})", kBar), false);
  EXPECT_THAT(text, HasSubstr("3 modes in 20 .. 60000 Hz, counted by inertia"));
  EXPECT_THAT(text, HasSubstr("lowest 3 corrected ones"));
}

TEST_F(Validate, notes_that_an_accuracy_needs_more_than_the_first_trial) {
  const base::Json found = validate_as_json(R"({"shape": "bar", "length_m": 0.2, "width_m": 0.03, "thickness_m": 0.02})",
                                            R"(, "accuracy_cents": 20, "band_hz": [20, 10000])");
  EXPECT_THAT(found["notes"][0].as_string(), HasSubstr("accuracy_cents"));
}

TEST_F(Validate, known_bodies_are_made) {
  try {
    const base::Json found =
        validate_as_json(R"({"beam": {"length_m": 0.3, "width_m": 0.02, "thickness_m": 0.004, "ends": ["free", "free"]}})");
    EXPECT_EQ(found["modes"]["how"].as_string(), "counted");
    EXPECT_GT(found["modes"]["count"].as_double(), 3);
  } catch (const InputError& error) {
    FAIL() << error.what();
  }
}

TEST_F(Validate, refuses_an_invalid_job_like_a_run) {
  EXPECT_THROW(validate(R"({"body": {"shape": "bar"}})", true), InputError);
  EXPECT_THROW(validate(fmt::format(R"({{"body": {}, "material": "steel", "fixed": [{{"node_set": "nowhere"}}]}})", kBar), true),
               InputError);
}

TEST(DescribeFailure, is_one_json_object) { EXPECT_EQ(describe_failure("a \"b\"", 2), R"({"code":2,"error":"a \"b\"","ok":false})"); }

TEST(PredictCost, grows_with_nodes_and_modes_and_refuses_other_text) {
  const auto get_seconds = [](const std::string& size) { return base::Json::parse(predict_cost(size)).value()["cpu_seconds"].as_double(); };
  EXPECT_GT(get_seconds(R"({"nodes": 9000})"), get_seconds(R"({"nodes": 4000})"));
  EXPECT_GT(get_seconds(R"({"nodes": 9000, "modes": 400})"), get_seconds(R"({"nodes": 9000, "modes": 100})"));
  for (const char* text : {"", "{}", R"({"nodes": 3})", R"({"nodes": 9000, "element": "T5"})", R"({"nodes": 9000, "edges": 1})"})
    EXPECT_THROW(predict_cost(text), InputError) << text;
}

}  // namespace
}  // namespace carillon::run
