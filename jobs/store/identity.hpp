// What a bank is made of, and so its id.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <string>

#include "jobs/store/id.hpp"
#include "jobs/store/order.hpp"
#include "jobs/store/records.hpp"
#include "jobs/store/store.hpp"
#include "precompute/job/job_spec.hpp"

namespace carillon::store {

/// The resolved job as one line of JSON with sorted keys, without paths, "run" and "resources": the same for all job files that ask for the
/// same.
std::string make_canonical_job(const job::JobSpec& job);

/// Makes requests; a file that many jobs name is hashed once as long as it does not change.
class RequestMaker {
 public:
  /// `solver`: the line that carillon-precompute --version prints; `simulator`: that of carillon-simulate, where there are simulations.
  explicit RequestMaker(std::string solver, std::string simulator = "") : solver_(std::move(solver)), simulator_(std::move(simulator)) {}
  /// Hashes the inputs and fills the request but its engine. Throws InputError for a mesh or surface that cannot be read.
  Request make(const JobOrder& order);

 private:
  struct Known {
    Id sha256;
    std::string head;                  // the first bytes
    std::array<long long, 5> stamp{};  // device, file, size and times
  };
  const Known& find_input(const std::filesystem::path& file, const std::string& what);
  Input find_hashed(const NamedInput& named);
  std::string solver_, simulator_;
  std::map<std::filesystem::path, Known> known_;
};

/// A job and the request made of it.
struct Asked {
  const JobOrder* order = nullptr;
  const Request* request = nullptr;
};

/// Copies the inputs into the store unless they are there and whole, and makes work/ab/<id> with job.json and request.json unless it is
/// there, with one sync for all of them. A bank or a folder of work that is damaged is set aside, or removed, and made again. Per job: true
/// when this call made it, or made its input whole. Throws InputError when an input is no longer what was hashed, SystemError when the disk
/// refuses.
std::vector<bool> prepare_work(const Store& store, const std::vector<Asked>& asked);

/// The id that follows from the parts in a request.
Id calc_id(const Request& request);

/// Why an input of a request in inputs/ is not what was submitted, in one sentence; none when all are. Reads all of them.
std::optional<std::string> find_input_fault(const Store& store, const Request& request);
/// The same of one.
std::optional<std::string> find_input_fault(const Store& store, const Input& input);
/// Where it is in the store.
std::filesystem::path find_input_file(const Store& store, const Input& input);

/// Why work/ab/<id> is not what was submitted: its request gives another id, its job.json asks for something else. None when it is.
/// `folder` is that folder (a link to its descriptor will do).
std::optional<std::string> find_job_fault(const Store& store, const Id& id, const std::filesystem::path& folder);

/// Why the files of a simulation in this folder are not whole, or not made of that request; none when they are.
std::optional<std::string> find_output_fault(const std::filesystem::path& folder, const Request& request);

/// Why a bank with this record of its making (JSON) was not made of that request; none when it was.
std::optional<std::string> find_origin_fault(const std::string& provenance, const Request& request);

/// Why request.json or job.json next to a bank do not belong to `id`, in one sentence; none when they do. `folder` is that of the bank.
std::optional<std::string> find_resolved_fault(const std::filesystem::path& folder, const Id& id);

/// What the solver warned of, from the record next to the bank of `id` (member "run" of job.json): each text once, at most fifty. None when
/// that record is damaged or another job's. `name` stands for the store's copy of the job file, as in name_job().
std::vector<std::string> read_warnings(const Store& store, const Id& id, const std::string& name = "the job");

/// A message that begins with the store's copy of a job file and a line of it, with `name` for both.
std::string name_job(const std::string& message, const Id& id, const std::string& name);

/// Copies damaged or missing inputs again from where they were submitted from. False when one is gone or another by now.
bool restore_input(const Store& store, const Request& request);

/// Makes work/ab/<id> again from a request alone, in place of one that is damaged; its input has to be in the store. False when there is
/// one by now.
bool restore_work(const Store& store, const Request& request);

}  // namespace carillon::store
