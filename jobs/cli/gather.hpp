// The jobs that a command line names: files, folders, manifests.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "jobs/cli/shared.hpp"
#include "jobs/store/identity.hpp"
#include "precompute/job/job_spec.hpp"

namespace carillon::cli {

/// One job as it was named, or why it cannot be used.
struct Source {
  std::string job_file;  // store::to_text() of an absolute path, with "#7" for line 7 of a manifest
  store::JobOrder order;
  store::Request request;
  std::string error;  // empty: it can be used
};

/// A .json file is a job; a folder stands for its *.json, *.resolved.json left out; any other file is a manifest: one job file a line, or
/// one job written out as JSON on one line; blank lines and lines that begin with # are passed over, "-" is standard input. Reads all and
/// hashes their inputs; what is wrong with one job is in its `error`. Throws InputError for a word that leads to no job at all.
std::vector<Source> gather(const std::vector<std::string>& words, const std::string& solver);

/// One job file, or one line of a manifest ("sweep.txt#21"). Throws InputError for an unusable job.
Source gather_one(const std::string& word, const std::string& solver);

/// True for an existing file, folder or line of a manifest.
bool is_of_jobs(const std::string& word);
/// True for a folder or a manifest.
bool is_of_many(const std::string& word);
/// The job files of a word, as Source::job_file. Throws as gather(), and for a word without any usable job.
std::vector<std::string> list_job_files(const std::string& word);

/// A job with its displayed name.
struct Named {
  store::Id id;
  std::optional<registry::Job> job;  // none: never submitted
  std::string name;                  // "bar.json", "sweep.txt#21"
};
/// Jobs by the present content of files, folders, manifests and their lines; ids and names as in the registry.
std::vector<Named> find_all_by_content(Shared& shared, const std::vector<std::string>& words);
/// The id that a word means by its content, and its row if there is one: the job file of now, not of its last submission.
std::pair<store::Id, std::optional<registry::Job>> find_by_content(Shared& shared, const std::string& word);

}  // namespace carillon::cli
