// What a bank is made of, and so its id.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <string>

#include "jobs/spec/job_spec.hpp"
#include "jobs/store/id.hpp"
#include "jobs/store/records.hpp"
#include "jobs/store/store.hpp"

namespace carillon::store {

/// The resolved job as one line of JSON with sorted keys, without paths, "run" and "resources": the same for all job files that ask for the
/// same.
std::string make_canonical_job(const spec::JobSpec& job);

/// Makes requests; a file that many jobs name is hashed once as long as it does not change.
class RequestMaker {
 public:
  /// `solver`: the line that carillon-precompute --version prints.
  explicit RequestMaker(std::string solver) : solver_(std::move(solver)) {}
  /// Hashes the input and fills the request but its engine. Throws InputError for a mesh or surface that cannot be read.
  Request make(const spec::JobSpec& job);

 private:
  struct Known {
    Id sha256;
    std::string head;                  // the first bytes
    std::array<long long, 5> stamp{};  // device, file, size and times
  };
  const Known& find_input(const std::filesystem::path& file, const std::string& what);
  std::string solver_;
  std::map<std::filesystem::path, Known> known_;
};

/// A job and the request made of it.
struct Asked {
  const spec::JobSpec* job = nullptr;
  const Request* request = nullptr;
};

/// Copies the inputs into the store unless they are there, and makes work/ab/<id> with job.json and request.json unless it is there, with
/// one sync for all of them. Per job: true when this call made it. Throws InputError when an input is no longer what was hashed,
/// SystemError when the disk refuses.
std::vector<bool> prepare_work(const Store& store, const std::vector<Asked>& asked);

}  // namespace carillon::store
