// The store: banks by the hash of what they are made of, read-only; inputs as they were when submitted; a folder for each job that is not
// done. Layout (ids are 64 hex digits, ab the first two):
//
//   VERSION                    "carillon store 1"
//   banks/ab/<id>/             read-only: bank.hdf, job.json, request.json, outcome.json, log, report.html ...
//   inputs/ab/<sha256>.<end>   read-only snapshots of meshes and surfaces
//   work/ab/<id>/              job.json (for carillon-precompute: mesh in inputs/, bank "bank.hdf"), request.json, attempt.json,
//   outcome.json,
//                              log, progress.jsonl, checkpoint.hdf, bank.hdf
//   tmp/                       what will get its name when it is whole
//   submissions.jsonl          which job file asked for which id, appended
//   lock                       shared by those who add, exclusive for gc
//   registry.sqlite            jobs/registry (elsewhere when the store is on a network file system)
//
// work/ and banks/ have the same depth: relative paths inside job.json stay right when a folder moves from one to the other.
// Truth on disk: banks/ab/<id>/ exists <=> the job is done. Any number of processes may use a store at once.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "jobs/store/id.hpp"
#include "jobs/store/records.hpp"

namespace carillon::store {

inline constexpr const char* kBankFile = "bank.hdf";
inline constexpr const char* kJobFile = "job.json";
inline constexpr const char* kLogFile = "log";
inline constexpr const char* kRequestFile = "request.json";
inline constexpr const char* kStandingFile = "state.json";
inline constexpr const char* kProgressFile = "progress.jsonl";
inline constexpr const char* kCheckpointFile = "checkpoint.hdf";
inline constexpr const char* kReportFile = "report.html";

/// Holds the store's lock while it lives.
class Lock {
 public:
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;
  Lock(Lock&& other) noexcept;
  ~Lock();

 private:
  friend class Store;
  explicit Lock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

class Store {
 public:
  /// Opens the store in `folder`, which is made when there is none. Throws InputError: the folder holds something else, or a newer store;
  /// no right to write there (names owner, group and mend). SystemError: the disk refuses. Where the folder is writable by its group, all
  /// that this process makes from then on is too (umask).
  static Store open(const std::filesystem::path& folder);
  /// The same, but a store that this process may only read (another user's, a disk mounted read-only) is taken as it is and nothing is made
  /// in it: may_write() is false then. InputError when it may not be read either.
  static Store open_to_read(const std::filesystem::path& folder);

  bool may_write() const { return may_write_; }
  const std::filesystem::path& root() const { return root_; }
  std::filesystem::path registry_folder() const;  // where registry.sqlite goes; made when there is none

  std::filesystem::path bank_folder(const Id& id) const;
  std::filesystem::path work_folder(const Id& id) const;
  std::filesystem::path input_file(const Id& sha256, const std::string& format) const;
  bool has_bank(const Id& id) const;
  bool has_work(const Id& id) const;
  /// bank_folder() when the job is done, else work_folder().
  std::filesystem::path find_folder(const Id& id) const;
  /// All ids with a folder there, sorted. Names that are no ids are passed over.
  std::vector<Id> list_banks() const;
  std::vector<Id> list_work() const;

  /// A new empty folder in tmp/, on the file system of the rest, whose name tells the process it belongs to.
  std::filesystem::path make_temporary() const;

  /// Makes a folder whose content is whole the bank of `id`: files 0444, fsync of all, rename into banks/, folder 0555, fsync. A lost race
  /// is no error: false, and `folder` is removed. What is left of work/ab/<id> is removed by remove_work(). SystemError when the disk
  /// refuses; `folder` stays then.
  bool publish(const Id& id, const std::filesystem::path& folder) const;
  /// The same into work/ for any number at once, with one sync for all; nothing is made read-only. Per folder: true when it got its name.
  struct Prepared {
    Id id;
    std::filesystem::path folder;
  };
  std::vector<bool> publish_work(const std::vector<Prepared>& prepared) const;

  /// Removes work/ab/<id> or banks/ab/<id>: renamed into tmp/ first, so that it is there whole or not at all.
  void remove_work(const Id& id) const;
  void remove_bank(const Id& id) const;

  Lock lock_shared() const;     // waits
  Lock lock_exclusive() const;  // waits

 private:
  Lock take_lock(int operation) const;
  void remove_folder(const std::filesystem::path& folder) const;
  explicit Store(std::filesystem::path root) : root_(std::move(root)) {}
  std::filesystem::path root_;  // absolute
  bool may_write_ = true;
};

/// Where the store is when nobody says: $XDG_DATA_HOME/carillon, else ~/.local/share/carillon.
std::filesystem::path find_default_store();

/// "nfs", "lustre", "cifs" ... when `folder` lies on a file system shared by hosts, else empty.
std::string find_network_file_system(const std::filesystem::path& folder);

}  // namespace carillon::store
