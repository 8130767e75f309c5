// Shared state of the commands: store, registry, profile; lookup of jobs; text and JSON output.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "jobs/queue/slurm_settings.hpp"
#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"

namespace carillon::slurm {
class Engine;
}

namespace carillon::cli {

/// Exit code of an unfinished job.
inline constexpr int kExitNotYet = 1;

/// profile.json: defaults of the user; all keys are optional.
struct Profile {
  std::filesystem::path file;                         // empty: none
  std::filesystem::path store;                        // "store"
  store::JobEngine engine = store::JobEngine::local;  // "on"
  queue::SlurmSettings slurm;                         // "slurm"
  std::vector<std::string> mpirun_options;            // arguments of mpirun, here and in Slurm
};

/// Store and registry, opened on first use.
class Shared {
 public:
  std::string store_option;      // --store
  std::string profile_option;    // --profile
  bool json = false;             // --json
  bool only_reads = false;       // the command works on a read-only store
  bool works_when_full = false;  // the command works on a full disk, with a registry in memory

  const Profile& profile();
  const store::Store& store();
  registry::Registry& registry();
  /// Settles rows whose process is gone; every command that uses states calls it first. A read-only store is read again.
  void settle();
  /// True while a registry in memory is used because the disk is full.
  bool is_disk_full() const { return is_disk_full_; }
  /// Reopens the registry after the disk was full.
  void reopen();

  bool hands_over = false;                      // settle() also submits to Slurm
  bool has_pictures = false;                    // draw pictures for jobs submitted to Slurm
  std::shared_ptr<slurm::Engine> slurm_engine;  // created on first use
  double slurm_asked_s = 0.0;                   // boot time

 private:
  std::optional<Profile> profile_;
  std::optional<store::Store> store_;
  std::optional<registry::Registry> registry_;
  bool is_disk_full_ = false, is_full_shown_ = false;
  bool fall_back(const SystemError& error);
};

/// Untrusted text for a terminal: no control characters, valid UTF-8, about `max` bytes.
std::string show(const std::string& text, std::size_t max = 200);
/// An error message as in show(), without truncation.
std::string show_message(const std::string& text);
/// For JSON: valid UTF-8.
base::Json to_json(const std::string& text);
/// "2026-11-20T20:22:30Z"; null for 0.
base::Json to_json_time(double unix_s);
/// Prints one document and a newline. SystemError if standard output fails.
void print_json(const base::Json& root);
/// "1 h 04 min", "12.3 s".
std::string format_seconds(double seconds);
/// "1.2 GB"
std::string format_bytes(double bytes);

/// Output of carillon-precompute --version. SystemError if it cannot be started.
std::string read_solver_version();
/// The same for another program of this installation.
std::string read_program_version(const std::string& name);
/// Replaces this process by a program of this installation. SystemError on failure.
[[noreturn]] void become(const std::string& program, std::vector<std::string> arguments);

/// The rows of `words`: ids, unique prefixes of ids, job files (last submission), names of carillon status, folders and manifests (without
/// jobs never submitted). InputError for any other word.
std::vector<registry::Job> find_jobs(Shared& shared, const std::vector<std::string>& words);
/// The same for one word and one job.
registry::Job find_job(Shared& shared, const std::string& word);

/// True if carillon submit requeues an ended row; `has_work`: its folder of work exists.
bool is_submitted_again(const registry::Job& job, bool has_work);

/// A row with progress, bank and log as JSON; keys: docs/howto/jobs.md.
base::Json describe(Shared& shared, const registry::Job& job);
/// Files of a finished job by key: "bank", or "sound", "motion" ... of a simulation.
std::map<std::string, std::filesystem::path> list_results(const store::Store& store, const store::Id& id);
/// Warnings of the solver for a finished job; `name` replaces its job file.
std::vector<std::string> find_warnings(Shared& shared, const registry::Job& job, const std::string& name = "the job");
/// A list of texts as JSON.
base::Json to_json(const std::vector<std::string>& texts);
/// The reason of a row, with the submitted input file instead of its copy in the store.
std::string find_reason(Shared& shared, const registry::Job& job);

}  // namespace carillon::cli
