// What the commands share: the store, ways to name a job, and two ways to print: lines for people, one JSON document for programs.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "jobs/queue/slurm/settings.hpp"
#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"

namespace carillon::slurm {
class Engine;
}

namespace carillon::cli {

/// Not an error and not done: the job is not there yet.
inline constexpr int kExitNotYet = 1;

/// profile.json: the user's defaults. Every key may be left out.
struct Profile {
  std::filesystem::path file;                         // empty: there is none
  std::filesystem::path store;                        // "store"
  store::JobEngine engine = store::JobEngine::local;  // "on"
  slurm::Settings slurm;                              // "slurm"
  std::vector<std::string> mpirun_options;            // words for mpirun, here and in Slurm: where the ranks run
};

/// The store and its registry, opened when first asked for.
class Shared {
 public:
  std::string store_option;      // --store
  std::string profile_option;    // --profile
  bool json = false;             // --json
  bool only_reads = false;       // what this command does may be done on a store that may only be read
  bool works_when_full = false;  // and this one, on a full disk, by a registry in memory

  const Profile& profile();
  const store::Store& store();
  registry::Registry& registry();
  /// Rows whose process is gone are settled: what every command does that looks at states. A store that may only be read is read again.
  void settle();
  /// The registry is one in memory because the disk is full: states are as the store's files show them.
  bool is_disk_full() const { return is_disk_full_; }
  /// Opens the registry again when it is next asked for, with room or without.
  void reopen();

  bool hands_over = false;                      // settle() hands over to Slurm too: for a command that waits for its jobs
  bool has_pictures = false;                    // draw them for what is handed over to Slurm, as where the profile says so
  std::shared_ptr<slurm::Engine> slurm_engine;  // made when first needed
  double slurm_asked_s = 0.0;                   // boot time

 private:
  std::optional<Profile> profile_;
  std::optional<store::Store> store_;
  std::optional<registry::Registry> registry_;
  bool is_disk_full_ = false, is_full_shown_ = false;
  bool fall_back(const SystemError& error);
};

/// A text of strangers for a terminal: no control characters, valid UTF-8, at most `max` bytes or so.
std::string show(const std::string& text, std::size_t max = 200);
/// A message of an error: as show(), and long ones whole.
std::string show_message(const std::string& text);
/// For JSON: valid UTF-8.
base::Json to_json(const std::string& text);
/// "2026-11-20T20:22:30Z"; null for 0.
base::Json to_json_time(double unix_s);
/// Prints one document and a line end. SystemError when standard output refuses.
void print_json(const base::Json& root);
/// "1 h 04 min", "12.3 s".
std::string format_seconds(double seconds);
/// "1.2 GB"
std::string format_bytes(double bytes);

/// The line that carillon-precompute --version prints. SystemError when it cannot be started.
std::string read_solver_version();
/// The same of another program of this installation.
std::string read_program_version(const std::string& name);
/// Replaces this process by a program of this installation. Returns only by SystemError.
[[noreturn]] void become(const std::string& program, std::vector<std::string> arguments);

/// The rows of `words`: ids, unique prefixes of ids, job files (their last submission), names as printed by carillon status, folders and
/// manifests (without jobs never submitted). InputError for any other word.
std::vector<registry::Job> find_jobs(Shared& shared, const std::vector<std::string>& words);
/// The same for one word and one job.
registry::Job find_job(Shared& shared, const std::string& word);

/// Whether carillon submit puts a row that has ended back into the queue; `has_work`: its folder of work is there.
bool is_submitted_again(const registry::Job& job, bool has_work);

/// A row with its progress, its bank and its log, under the keys of docs/howto/jobs.md.
base::Json describe(Shared& shared, const registry::Job& job);
/// The files of a job that is done, by the keys of jobs: "bank", or those of a simulation ("sound", "motion" ...).
std::map<std::string, std::filesystem::path> list_results(const store::Store& store, const store::Id& id);
/// What the solver warned of, of a job that is done; `name` stands for its job file.
std::vector<std::string> find_warnings(Shared& shared, const registry::Job& job, const std::string& name = "the job");
/// A list of texts as JSON.
base::Json to_json(const std::vector<std::string>& texts);
/// The reason of a row with the file that the user named in place of its copy in the store.
std::string find_reason(Shared& shared, const registry::Job& job);

}  // namespace carillon::cli
