// Jobs named on a command line: files, folders, manifests.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "jobs/cli/shared.hpp"
#include "jobs/store/identity.hpp"
#include "precompute/job/job_spec.hpp"

namespace carillon::cli {

/// One job, or its error.
struct Source {
  std::string job_file;  // store::to_text() of an absolute path, with "#7" for line 7 of a manifest
  store::JobOrder order;
  store::Request request;
  std::string error;  // empty: valid
};

/// A .json file is a job; a folder stands for its *.json except *.resolved.json; any other file is a manifest with one job file or one job
/// as JSON per line (blank lines and lines with # are skipped); "-" is standard input. Reads all jobs and hashes their inputs; errors of a
/// job go to `error`. InputError for a word without any job.
std::vector<Source> gather(const std::vector<std::string>& words, const std::string& solver);

/// One job file, or one line of a manifest ("sweep.txt#21"). InputError for an invalid job.
Source gather_one(const std::string& word, const std::string& solver);

/// True for an existing file, folder or line of a manifest.
bool is_of_jobs(const std::string& word);
/// True for a folder or a manifest.
bool is_of_many(const std::string& word);
/// The job files of a word, as Source::job_file. InputError for a word without a valid job.
std::vector<std::string> list_job_files(const std::string& word);

/// A job with its displayed name.
struct Named {
  store::Id id;
  std::optional<registry::Job> job;  // none: never submitted
  std::string name;                  // "bar.json", "sweep.txt#21"
};
/// Jobs by the current content of files, folders, manifests and their lines; ids and names from the registry.
std::vector<Named> find_all_by_content(Shared& shared, const std::vector<std::string>& words);
/// Id by the current content of a job file, and its row if there is one.
std::pair<store::Id, std::optional<registry::Job>> find_by_content(Shared& shared, const std::string& word);

}  // namespace carillon::cli
