// Jobs in a store, made without a solver.
#pragma once

#include <fmt/core.h>

#include <fstream>
#include <string>
#include <vector>

#include "jobs/store/registry/registry.hpp"
#include "tests/support/folder.hpp"

namespace carillon::tests {

inline store::Id make_id(int number) { return store::hash_text(std::to_string(number)); }

inline registry::Submission make_submission(int number) {
  store::Request request;
  request.id = make_id(number).text();
  request.job = "{}";
  request.input_kind = store::InputKind::shape;
  request.solver = "solver";
  request.job_file = fmt::format("/jobs/{}.json", number);
  request.resources.ranks = 1 + number % 3;
  return {request.job_file, request};
}

/// A folder in work/, as carillon submit makes it.
inline void make_work(const store::Store& store, const registry::Submission& submission) {
  const auto temporary = store.make_temporary();
  const auto folder = temporary / "0";
  std::filesystem::create_directory(folder);
  store::write_request(folder, submission.request);
  store::write_state(folder, {});
  store.publish_work(temporary, {{store::require_id(submission.request.id, "test"), "0"}});
}

inline void make_bank(const store::Store& store, const registry::Submission& submission) {
  auto folder = store.make_temporary();
  store::write_request(folder.path(), submission.request);
  std::ofstream(folder / store::kBankFile) << "bank";
  store.publish(store::require_id(submission.request.id, "test"), folder);
}

inline void be_silent(const std::string&) {}

/// id, state, failures and reason of every job, in order.
inline std::string describe(const registry::Registry& registry) {
  std::string text;
  for (const registry::Job& job : registry.list())
    text += fmt::format("{} {} {} {} {} {}\n", job.id.short_text(), to_text(job.state), job.name, job.failures, job.resources.ranks,
                        job.reason);
  return text;
}

}  // namespace carillon::tests
