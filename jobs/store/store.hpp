// The store: banks by the hash of what they are made of, read-only; inputs as they were when submitted; a folder for each job that is not
// done. Layout (ids are 64 hex digits, ab the first two):
//
//   VERSION                    "carillon store 1"
//   banks/ab/<id>/             read-only: bank.hdf, job.json, request.json, outcome.json, log, report.html ...; of a simulation
//   record.json,
//                              sound.wav, motion.vtkhdf ... (order.hpp) in place of bank and report
//   inputs/ab/<sha256>.<end>   read-only snapshots of meshes and surfaces
//   work/ab/<id>/              job.json (for carillon-precompute or carillon-simulate: mesh in inputs/, bank "bank.hdf"), request.json,
//   attempt.json,
//                              outcome.json, result.json, log, progress.jsonl, checkpoint, bank.hdf
//   tmp/                       what will get its name when it is whole; each entry belongs to one process and to its user alone (0700)
//   damaged/                   banks that were set aside
//   submissions.jsonl          which job file asked for which id, appended
//   lock                       shared by those who add, exclusive for gc
//   registry.sqlite            jobs/store/registry (elsewhere when the store is on a network file system)
//
// work/ and banks/ have the same depth: relative paths inside job.json stay right when a folder moves from one to the other.
// Truth on disk: banks/ab/<id>/ holds a whole bank <=> the job is done. Any number of processes may use a store at once.
// The members of a group may all write to a store, and one of them may put a link where a folder or a file was. Folders are opened by
// descriptor (open_folder.hpp) and no link inside the store is followed.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "jobs/store/id.hpp"
#include "jobs/store/open_folder.hpp"
#include "jobs/store/records.hpp"

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
inline constexpr const char* kSumFile = "bank.sum";        // what the bank and its records were when it was published

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

/// A new folder in tmp/ of this process, which no other user may enter; goes with what is left in it.
class Temporary {
 public:
  Temporary(Temporary&&) noexcept = default;
  Temporary& operator=(Temporary&&) = delete;
  ~Temporary();
  /// Where to write, for this process: rights as those of the store. What is in it is published or lost.
  std::filesystem::path path() const { return content_.path(); }
  std::filesystem::path operator/(const std::string& name) const { return path() / name; }
  const OpenFolder& content() const { return content_; }

 private:
  friend class Store;
  Temporary(OpenFolder parent, std::string name, OpenFolder own, OpenFolder content)
      : parent_(std::move(parent)), name_(std::move(name)), own_(std::move(own)), content_(std::move(content)) {}
  OpenFolder parent_;  // tmp/
  std::string name_;
  OpenFolder own_, content_;
};

/// How thoroughly a bank is looked at: by its size, its first bytes (they hold the hash of the rest) and the time it was written; by all
/// its bytes; or by all its bytes and what they say. A bank without bank.sum (an earlier version made it) is read whole for `full` too.
enum class Look { quick, full, content };

/// The folders of one store. A bank is in banks/ whole or not at all, under the hash of what made it, and never changes there; no link
/// inside the store is followed. Keeps no state: any number of processes may use it at once.
class Store {
 public:
  /// Opens the store in `folder`, which is made when there is none. Throws InputError: the folder holds something else, or a newer store;
  /// one of its own folders is a link or a file;
  /// no right to write there (names owner, group and remedy). SystemError: the disk refuses. Where the folder is writable by its group, all
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
  std::filesystem::path input_file(const Id& sha256, const std::string& format) const {
    return input_folder(sha256) / make_input_name(sha256, format);
  }
  std::filesystem::path input_folder(const Id& sha256) const;  // inputs/ab
  /// A bank that a quick look finds whole; a folder for it, whatever is in it; a folder of work. Links count for nothing.
  bool has_bank(const Id& id) const { return !find_bank_fault(id, Look::quick); }
  bool has_bank_folder(const Id& id) const;
  bool has_work(const Id& id) const;
  /// Why the bank of `id` is not what was published, in one sentence; none when it is.
  std::optional<std::string> find_bank_fault(const Id& id, Look look) const;
  /// Which of the records next to the bank (job.json, request.json, outcome.json) is not what was published, in one sentence; none when all
  /// are, or when bank.sum does not say.
  std::optional<std::string> find_record_change(const Id& id) const;
  /// Puts the files of a temporary folder in place of those next to a bank, read-only; bank.sum follows where records are among them.
  /// SystemError when that cannot be.
  void replace_records(const Id& id, const Temporary& folder) const;
  /// Sets a bank aside into damaged/; the folder's new name there. Empty when there was none.
  std::string set_bank_aside(const Id& id) const;
  /// The folder of work by descriptor, to write in; that of a bank. SystemError when it is not there, or a link.
  OpenFolder open_work(const Id& id) const { return open_job("work", id); }
  OpenFolder open_bank(const Id& id) const { return open_job("banks", id); }
  /// "tmp", "inputs" ... by descriptor; made when it is not there. SystemError when it is a link.
  OpenFolder open_folder(const std::string& name) const;
  /// inputs/ab, made when it is not there.
  OpenFolder open_inputs(const Id& sha256) const { return open_folder("inputs").make(sha256.text().substr(0, 2)); }
  /// bank_folder() when the job is done, else work_folder().
  std::filesystem::path find_folder(const Id& id) const;
  /// All ids with a folder there, sorted. Names that are no ids are passed over.
  std::vector<Id> list_banks() const;
  std::vector<Id> list_work() const;

  /// Its name holds the number of its process.
  Temporary make_temporary() const;
  /// Whether a name in tmp/ is one that make_temporary() gives.
  static bool is_temporary_name(const std::string& name);

  /// Makes a folder whose content is whole the bank of `id`: files 0444, fsync of all, rename into banks/, folder 0555, fsync. A lost race
  /// is no error: false. A damaged bank of that id is set aside. What is left of work/ab/<id> is removed by remove_work(). SystemError when
  /// the disk refuses; `folder` stays then.
  bool publish(const Id& id, const Temporary& folder) const;
  /// The same into work/ for any number of folders in `folder` at once, with one sync for all; nothing is made read-only. Per folder: true
  /// when it got its name.
  struct Prepared {
    Id id;
    std::string name;
  };
  std::vector<bool> publish_work(const Temporary& folder, const std::vector<Prepared>& prepared) const;

  /// Gives a temporary folder the name slurm/<batch>, 32 hex digits. SystemError when there is one.
  void publish_batch(const std::string& batch, const Temporary& folder) const;

  /// Removes work/ab/<id> or banks/ab/<id>: renamed into tmp/ first, so that it is there whole or not at all; on a full disk in place.
  void remove_work(const Id& id) const;
  void remove_bank(const Id& id) const;

  Lock lock_shared() const;     // waits
  Lock lock_exclusive() const;  // waits

 private:
  Lock take_lock(int operation) const;
  std::optional<OpenFolder> find_shard(const char* folder, const Id& id) const;
  OpenFolder open_job(const char* folder, const Id& id) const;
  void remove_folder(const char* folder, const Id& id) const;
  explicit Store(std::filesystem::path root) : root_(std::move(root)) {}
  std::filesystem::path root_;  // absolute
  bool may_write_ = true;
};

/// Default path of the store: $XDG_DATA_HOME/carillon, else ~/.local/share/carillon.
std::filesystem::path find_default_store();

/// "nfs", "lustre", "cifs" ... when `folder` lies on a file system shared by hosts, else empty.
std::string find_network_file_system(const std::filesystem::path& folder);

}  // namespace carillon::store
