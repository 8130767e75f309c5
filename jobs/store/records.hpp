// JSON files of a job's folder: request, state, progress. All are replaced atomically, except progress.jsonl, to which the solver appends.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/store/id.hpp"
#include "precompute/job/job_spec.hpp"

namespace carillon::store {

using job::Resources;

/// queued: may be claimed. running: claimed. waiting: queued, but not before a given time. done, failed, cancelled: ended.
enum class JobState { queued, running, waiting, done, failed, cancelled };
/// Queued, running or waiting.
constexpr bool is_open(JobState state) { return state == JobState::queued || state == JobState::running || state == JobState::waiting; }
/// Where a job runs: on this machine or in Slurm.
enum class JobEngine { local, slurm };
/// Input of a job in addition to its description; a simulation has any number of meshes and surfaces.
enum class InputKind { mesh, surface, shape, table, simulation };
/// Words for files and the command line.
std::string to_text(JobState state);
std::string to_text(JobEngine engine);
std::string to_text(InputKind kind);
/// None for an unknown word.
std::optional<JobState> find_state(std::string_view word);
std::optional<JobEngine> find_engine(std::string_view word);

/// An input file of a job.
struct Input {
  InputKind kind = InputKind::mesh;
  std::string format;  // "msh", "vtu", "mesh", "tetgen", "hdf", or the extension of a surface, "obj"
  std::string sha256;  // 64 hex digits; of a TetGen pair, of both
  std::string file;    // as submitted, to_text() of an absolute path
};

/// request.json: the parts of the id, and data that are not part of it.
struct Request {
  std::string id;   // 64 hex digits
  std::string job;  // canonical text of the resolved job, without paths
  InputKind input_kind = InputKind::shape;
  std::string input_format;   // as Input::format
  std::string input_sha256;   // as Input::sha256
  std::vector<Input> inputs;  // of a simulation; its input_... are empty
  std::string solver;         // output of carillon-precompute --version or carillon-simulate --version
  Resources resources;
  JobEngine engine = JobEngine::local;
  std::string job_file;    // of the first submission: store::to_text() of an absolute path, with "#7" for line 7 of a manifest
  std::string input_file;  // mesh or surface as submitted, to_text() of an absolute path
  std::string user;
  double submitted_unix_s = 0.0;
};

/// state.json: the part of a job's state that is neither in the bank nor in the last outcome. Written and read by jobs/store/registry.
struct SavedState {
  JobState state = JobState::queued;  // queued, waiting, failed or cancelled
  std::string reason;                 // one sentence, for display
  int attempts = 0;                   // so far
  int failures = 0;                   // consecutive failed attempts
};

/// The last complete line of progress.jsonl.
struct Progress {
  std::string phase;
  double percent = 0.0;
  long long modes_done = -1;  // -1: unknown
  long long modes_wanted = -1;
  double seconds_left = -1.0;  // -1: unknown
  double seconds = 0.0;        // since the start
};

/// None if the file does not exist; InputError if it is damaged.
std::optional<Request> read_request(const std::filesystem::path& folder);
std::optional<SavedState> read_state(const std::filesystem::path& folder);
/// Reads the last 64 kB; truncated and invalid lines are skipped. Never throws for content.
std::optional<Progress> read_progress(const std::filesystem::path& folder);

/// `folder`/request.json and so on. SystemError when the disk refuses.
void write_request(const std::filesystem::path& folder, const Request& request);
/// Text of request.json, or of one line of submissions.jsonl, and its parser.
std::string format_request(const Request& request, bool one_line = false);
Request parse_request(std::string_view text, const std::filesystem::path& name);
std::string format_state(const SavedState& saved);
void write_state(const std::filesystem::path& folder, const SavedState& saved);

/// A path as UTF-8 for JSON and SQLite: any invalid byte (and a backslash before an x) becomes "\xNN".
std::string to_text(const std::filesystem::path& path);
std::filesystem::path from_text(const std::string& text);

/// JSON with control, colour and bidirectional characters as "\uNNNN".
std::string to_plain_json(const std::string& json);

/// Input files of a request of any kind.
std::vector<Input> list_inputs(const Request& request);

/// File name of the mesh or surface as submitted; empty for a shape and for a simulation.
std::string find_input_name(const Request& request);

}  // namespace carillon::store
