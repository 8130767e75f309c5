// An invalid job, and parts of the expected message.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "precompute/job/job_spec.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::tests {

struct BadJob {
  const char* name;
  std::string text;
  const char* place;
  const char* words;
};

/// Fails unless the text is refused with both the place and the words.
inline void expect_refused(const BadJob& job) {
  tests::expect_error<InputError>({job.place, job.words}, [&] { job::parse_job(job.text, "/jobs/job.json"); });
}

}  // namespace carillon::tests
