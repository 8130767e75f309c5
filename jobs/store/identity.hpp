// What a bank is made of, and so its id.
#pragma once

#include <filesystem>
#include <string>

#include "jobs/spec/job_spec.hpp"
#include "jobs/store/id.hpp"
#include "jobs/store/records.hpp"
#include "jobs/store/store.hpp"

namespace carillon::store {

/// The resolved job as one line of JSON with sorted keys, without paths, "run" and "resources": the same for all job files that ask for the
/// same.
std::string make_canonical_job(const spec::JobSpec& job);

/// Hashes the input and fills id, job, input_*, solver, resources and job_file of a request. `solver` is the line that
/// carillon-precompute --version prints. Throws InputError for a mesh or surface that cannot be read.
Request make_request(const spec::JobSpec& job, const std::string& solver);

/// Copies the input into the store unless it is there, and makes work/ab/<id> with job.json and request.json unless it is there. True when
/// this call made it. Throws InputError when the input is no longer what was hashed, SystemError when the disk refuses.
bool prepare_work(const Store& store, const spec::JobSpec& job, const Request& request);

}  // namespace carillon::store
