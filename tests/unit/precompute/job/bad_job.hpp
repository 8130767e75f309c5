// An invalid job, and parts of the expected message.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "precompute/job/job_spec.hpp"

namespace carillon::tests {

struct BadJob {
  const char* name;
  std::string text;
  const char* place;
  const char* words;
};

/// Fails unless the text is refused with both the place and the words.
inline void expect_refused(const BadJob& job) {
  try {
    job::parse_job(job.text, "/jobs/job.json");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    const std::string message = error.what();
    EXPECT_NE(message.find(job.place), std::string::npos) << message;
    EXPECT_NE(message.find(job.words), std::string::npos) << message;
  }
}

}  // namespace carillon::tests
