// Needs of jobs from their requests.
#include "jobs/queue/needs.hpp"

#include <gtest/gtest.h>

#include "jobs/queue/admission.hpp"
#include "jobs/store/outcome/outcome.hpp"
#include "precompute/job/cost/calibration.hpp"
#include "precompute/job/cost/seconds.hpp"
#include "tests/unit/jobs/store/registry/jobs.hpp"

namespace carillon::tests {
namespace {

class Needs : public testing::Test {
 protected:
  queue::JobNeeds find(const std::string& text, store::InputKind kind) {
    registry::Submission submission = make_submission(++number_);
    submission.request.job = text;
    submission.request.input_kind = kind;
    if (kind == store::InputKind::surface) {
      submission.request.input_sha256 = make_id(1000).text();
      submission.request.input_format = "obj";
      submission.request.input_file = "/jobs/a.obj";
    }
    make_work(store_, submission);
    return queue::find_needs(store_, registry::Job{.id = make_id(number_)});
  }
  static double predict(std::int64_t nodes, std::int64_t modes = cost::kDefaultModes) {
    cost::ProblemSize size = cost::estimate_meshed_size(nodes, true);
    size.modes = modes;
    return cost::predict_seconds(size).sum();
  }

  int number_ = 0;
  const Folder folder_;
  const store::Store store_ = store::Store::open(folder_ / "store");
};

TEST_F(Needs, surface_without_mesh_size_needs_no_prediction) {
  const queue::JobNeeds needs = find(R"({"body": {"surface": "a.obj"}})", store::InputKind::surface);
  EXPECT_FALSE(needs.wants_prediction);
  EXPECT_DOUBLE_EQ(needs.need.seconds, predict(cost::kDefaultNodes));
  EXPECT_TRUE(find(R"({"body": {"surface": "a.obj", "edge_m": 0.001}})", store::InputKind::surface).wants_prediction);
  EXPECT_DOUBLE_EQ(find(R"({"body": {"surface": "a.obj", "nodes": 700}})", store::InputKind::surface).need.seconds, predict(700));
}

TEST_F(Needs, memory_is_raised_after_running_out_of_memory) {
  const char* const text = R"({"body": {"shape": "bar", "nodes": 5000}})";
  const double before_gb = queue::calc_memory(find(text, store::InputKind::shape).need, 1);
  const auto find_after = [&](outcome::Cause cause, double asked_gb) {
    outcome::Outcome outcome;
    outcome.cause = cause;
    outcome.memory_need_gb = 100.0;
    outcome::write_outcome(store_.work_folder(make_id(number_)), outcome);
    registry::Job job{.id = make_id(number_)};
    job.resources.memory_gb = asked_gb;
    return queue::calc_memory(queue::find_needs(store_, job).need, 1);
  };
  EXPECT_GT(find_after(outcome::Cause::memory, 0.0), 100.0);
  EXPECT_DOUBLE_EQ(find_after(outcome::Cause::killed, 0.0), before_gb);
  EXPECT_DOUBLE_EQ(find_after(outcome::Cause::memory, 2.0), 2.0);  // a requested limit is not raised
}

TEST_F(Needs, fewer_modes_need_less_time) {
  const queue::JobNeeds needs = find(R"({"body": {"shape": "bar", "nodes": 5000}, "max_modes": 10})", store::InputKind::shape);
  EXPECT_DOUBLE_EQ(needs.need.seconds, predict(5000, 10));
  EXPECT_LT(needs.need.seconds, predict(5000));
}

TEST_F(Needs, serial_part_is_within_the_total_time) {
  const queue::Need need = find(R"({"body": {"shape": "bar", "nodes": 5000}})", store::InputKind::shape).need;
  EXPECT_GT(need.serial_seconds, cost::kStart);
  EXPECT_LT(need.serial_seconds, 0.5 * need.seconds);
}

TEST_F(Needs, simulation_is_detected) {
  EXPECT_TRUE(find("{}", store::InputKind::simulation).is_simulation);
  EXPECT_FALSE(find("{}", store::InputKind::shape).is_simulation);
}

}  // namespace
}  // namespace carillon::tests
