// The store: finished banks under the hash of their inputs, snapshots of inputs, and a folder for each unfinished job.
//
//   VERSION                    "carillon store 1"
//   banks/ab/<id>/             read-only: bank.hdf, job.json, request.json, outcome.json, log, report.html ...; of a simulation
//                              record.json, sound.wav, motion.vtkhdf ... (order.hpp) instead of bank and report
//   inputs/ab/<sha256>.<end>   read-only snapshots of meshes and surfaces
//   work/ab/<id>/              job.json (for the solver: mesh in inputs/, bank "bank.hdf"), request.json, attempt.json, outcome.json,
//                              result.json, log, progress.jsonl, checkpoint, bank.hdf
//   tmp/                       unpublished folders, each of one process
//   damaged/                   banks that were set aside
//   slurm/                     batches handed over to Slurm
//   submissions.jsonl          log: which job file asked for which id
//   lock                       shared by commands that add, exclusive for gc
//   registry.sqlite            index of jobs (elsewhere when the store is on a network file system)
//
// Ids are 64 hex digits, ab the first two. work/ and banks/ have the same depth, so relative paths in job.json stay valid after
// publication. Invariant: banks/ab/<id>/ exists and is complete if and only if the job is done. Any number of processes may use a store at
// once. All users of a store trust each other: anyone who may write to it may replace its files.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "jobs/store/id.hpp"
#include "jobs/store/records.hpp"
#include "runtime/base/descriptor.hpp"

namespace carillon::store {

inline constexpr const char* kBankFile = "bank.hdf";
inline constexpr const char* kJobFile = "job.json";
inline constexpr const char* kLogFile = "log";
inline constexpr const char* kRequestFile = "request.json";
inline constexpr const char* kStateFile = "state.json";
inline constexpr const char* kProgressFile = "progress.jsonl";
inline constexpr const char* kCheckpointFile = "checkpoint";
inline constexpr const char* kReportFile = "report.html";
inline constexpr const char* kOutcomeFile = "outcome.json";
inline constexpr const char* kResultFile = "result.json";  // of the solver (base::Result)
inline constexpr const char* kSumFile = "bank.sum";        // sizes and hashes at publication

/// A lock on a file, held for the lifetime of the object.
class Lock {
 public:
  /// `operation`: LOCK_SH or LOCK_EX of flock(2). Creates the file; waits. SystemError.
  Lock(const std::filesystem::path& file, int operation);

 private:
  base::Descriptor descriptor_;
};

/// A new folder in tmp/, removed with its content by the destructor unless it was published.
class Temporary {
 public:
  Temporary(Temporary&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  Temporary& operator=(Temporary&&) = delete;
  ~Temporary();
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  friend class Store;
  explicit Temporary(std::filesystem::path path) : path_(std::move(path)) {}
  std::filesystem::path path_;
};

/// Thoroughness of a check of a bank. quick: size, time, and the first bytes (which hold the hash of the rest); full: all bytes; content:
/// all bytes, and the bank is read. Without bank.sum (written by an earlier version) `full` is `content`.
enum class Look { quick, full, content };

/// The folders of one store. Keeps no state.
class Store {
 public:
  /// Opens the store in `folder`, creating it if necessary. InputError: the folder holds something else or a newer store, or no right to
  /// write (names owner, group and remedy). SystemError: the disk refuses. If the group may write to the folder, the umask of this process
  /// is changed so that the group may write to everything it creates.
  static Store open(const std::filesystem::path& folder);
  /// The same, but a store that this process may only read is left unchanged; may_write() is false then. InputError when it may not even
  /// be read.
  static Store open_to_read(const std::filesystem::path& folder);

  bool may_write() const { return may_write_; }
  const std::filesystem::path& root() const { return root_; }
  /// The folder of registry.sqlite, created if necessary.
  std::filesystem::path registry_folder() const;

  std::filesystem::path bank_folder(const Id& id) const;
  std::filesystem::path work_folder(const Id& id) const;
  std::filesystem::path input_file(const Id& sha256, const std::string& format) const {
    return input_folder(sha256) / make_input_name(sha256, format);
  }
  std::filesystem::path input_folder(const Id& sha256) const;  // inputs/ab
  /// True if a quick look finds a complete bank.
  bool has_bank(const Id& id) const { return !find_bank_fault(id, Look::quick); }
  bool has_bank_folder(const Id& id) const;
  bool has_work(const Id& id) const;
  /// Why the bank of `id` differs from the published one, in one sentence; none if it does not.
  std::optional<std::string> find_bank_fault(const Id& id, Look look) const;
  /// Which record next to the bank (job.json, request.json, outcome.json) differs from the published one, in one sentence; none if none
  /// does, or without bank.sum.
  std::optional<std::string> find_record_change(const Id& id) const;
  /// Replaces files next to a bank by those of a temporary folder, read-only, and updates bank.sum if records are among them. SystemError.
  void replace_records(const Id& id, const Temporary& folder) const;
  /// Moves a bank into damaged/. Returns its new name below the root; empty if there was none.
  std::string set_bank_aside(const Id& id) const;
  /// bank_folder() if the job is done, else work_folder().
  std::filesystem::path find_folder(const Id& id) const;
  /// All ids with a folder there, sorted. Other names are skipped.
  std::vector<Id> list_banks() const;
  std::vector<Id> list_work() const;

  /// Its name holds the identity of this process.
  Temporary make_temporary() const;
  /// True for names that make_temporary() gives.
  static bool is_temporary_name(const std::string& name);

  /// Publishes a complete folder as the bank of `id`: files 0444, fsync, rename into banks/, folder 0555, fsync. False if there is a
  /// complete bank already (lost race). A damaged bank of that id is set aside. work/ab/<id> stays. SystemError when the disk refuses.
  bool publish(const Id& id, Temporary& folder) const;
  /// The same into work/ for any number of folders in `folder`, with one sync for all and nothing made read-only. Per folder: true if it
  /// was renamed, false if the name existed.
  struct Prepared {
    Id id;
    std::string name;
  };
  std::vector<bool> publish_work(const Temporary& folder, const std::vector<Prepared>& prepared) const;

  /// Renames a temporary folder to slurm/<batch>, 32 hex digits. SystemError if it exists.
  void publish_batch(const std::string& batch, Temporary& folder) const;

  /// Removes work/ab/<id> or banks/ab/<id> atomically, by a rename into tmp/ (in place on a full disk).
  void remove_work(const Id& id) const;
  void remove_bank(const Id& id) const;

  Lock lock_shared() const;     // waits
  Lock lock_exclusive() const;  // waits

 private:
  void remove_folder(const std::filesystem::path& folder) const;
  explicit Store(std::filesystem::path root) : root_(std::move(root)) {}
  std::filesystem::path root_;  // absolute
  bool may_write_ = true;
};

/// Default path of the store: $XDG_DATA_HOME/carillon, else ~/.local/share/carillon.
std::filesystem::path find_default_store();

/// "nfs", "lustre", "cifs" ... if `folder` is on a file system shared by hosts, else empty.
std::string find_network_file_system(const std::filesystem::path& folder);

}  // namespace carillon::store
