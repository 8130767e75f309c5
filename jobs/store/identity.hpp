// The id of a bank: a hash of its job, its inputs and the version of the solver.
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

/// The resolved job as one line of JSON with sorted keys, without paths, "run" and "resources". Equivalent job files give the same line.
std::string make_canonical_job(const job::JobSpec& job);

/// Makes requests. Hashes of unchanged input files are cached.
class RequestMaker {
 public:
  /// `solver`: output of carillon-precompute --version; `simulator`: of carillon-simulate, needed for simulations only.
  explicit RequestMaker(std::string solver, std::string simulator = "") : solver_(std::move(solver)), simulator_(std::move(simulator)) {}
  /// Hashes the inputs and fills the request, except its engine. InputError for an unreadable mesh or surface.
  Request make(const JobOrder& order);

 private:
  struct Known {
    Id sha256;
    std::string head;                  // first 4096 bytes
    std::array<long long, 5> stamp{};  // device, inode, size, mtime, ctime
    bool has_includes = false;
  };
  const Known& find_input(const std::filesystem::path& file, const std::string& what);
  Input find_hashed(const NamedInput& named);
  std::string solver_, simulator_;
  std::map<std::filesystem::path, Known> known_;
};

/// A job and its request.
struct Asked {
  const JobOrder* order = nullptr;
  const Request* request = nullptr;
};

/// Copies missing or damaged inputs into the store and creates work/ab/<id> with job.json and request.json where there is neither a bank
/// nor a folder of work, with one sync for all. Damaged banks are set aside, damaged folders of work replaced. Per job: true if this call
/// created its folder or copied its input. InputError when an input has changed since it was hashed, SystemError when the disk refuses.
std::vector<bool> prepare_work(const Store& store, const std::vector<Asked>& asked);

/// Recomputes the id from the other members of a request.
Id calc_id(const Request& request);

/// First fault of the inputs of a request in inputs/, in one sentence; none if all are as submitted. Reads all of them.
std::optional<std::string> find_input_fault(const Store& store, const Request& request);
/// The same for one input.
std::optional<std::string> find_input_fault(const Store& store, const Input& input);
/// Path of an input in the store.
std::filesystem::path find_input_file(const Store& store, const Input& input);

/// Why request.json or job.json of work/ab/<id> are not those submitted as `id`; none if they are.
std::optional<std::string> find_job_fault(const Store& store, const Id& id);

/// Why the files of a simulation are incomplete or of another request; none if neither.
std::optional<std::string> find_output_fault(const std::filesystem::path& folder, const Request& request);

/// Why a bank with this provenance (JSON) does not belong to the request; none if it does.
std::optional<std::string> find_origin_fault(const std::string& provenance, const Request& request);

/// Why request.json or job.json next to a bank do not belong to `id`, in one sentence; none if they do. `folder`: of the bank.
std::optional<std::string> find_resolved_fault(const std::filesystem::path& folder, const Id& id);

/// Warnings of the solver from job.json next to the bank of `id` (member "run"): each text once, at most fifty. Empty if that record is
/// damaged or of another job. `name` replaces the path of the store's copy of the job file, as in name_job().
std::vector<std::string> read_warnings(const Store& store, const Id& id, const std::string& name = "the job");

/// Replaces "PATH:LINE" of the store's copy of a job file at the beginning of a message by `name`.
std::string name_job(const std::string& message, const Id& id, const std::string& name);

/// Copies damaged or missing inputs again from their original paths. False if one has been removed or has changed.
bool restore_input(const Store& store, const Request& request);

/// Creates work/ab/<id> from a request, replacing a damaged one; its input must be in the store. False if another process created it.
bool restore_work(const Store& store, const Request& request);

}  // namespace carillon::store
