// The small JSON files of a job's folder: what was asked for, where it stands, how far it is. All are written whole
// (temporary file, fsync, rename) but progress.jsonl, which carillon-precompute appends to.
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

/// queued: may be claimed. running: claimed. waiting: as queued, but not before a moment. done, failed, cancelled: ended.
enum class JobState { queued, running, waiting, done, failed, cancelled };
/// Where a job runs: the queue of this machine, or Slurm.
enum class JobEngine { local, slurm };
/// What a job is made of, in addition to its description; a simulation of any number of meshes and surfaces.
enum class InputKind { mesh, surface, shape, table, simulation };
/// The words of these in files and on the command line.
std::string to_text(JobState state);
std::string to_text(JobEngine engine);
std::string to_text(InputKind kind);
/// None for a word that is not known.
std::optional<JobState> find_state(std::string_view word);
std::optional<JobEngine> find_engine(std::string_view word);

/// A file that a job is made of.
struct Input {
  InputKind kind = InputKind::mesh;
  std::string format;  // "msh", "vtu", "mesh", "tetgen", "hdf", or the ending of a surface, "obj"
  std::string sha256;  // 64 hex digits; of a TetGen pair, of both
  std::string file;    // as it was named, to_text() of an absolute path
};

/// request.json: the parts of the id, and what is not part of it.
struct Request {
  std::string id;   // 64 hex digits
  std::string job;  // canonical text of the resolved job, without paths
  InputKind input_kind = InputKind::shape;
  std::string input_format;   // "msh", "vtu", "mesh", "tetgen", "hdf", or the ending of a surface, "obj"
  std::string input_sha256;   // 64 hex digits; of a TetGen pair, of both
  std::vector<Input> inputs;  // of a simulation, whose input_... are empty
  std::string solver;         // the line of carillon-precompute --version, or that of carillon-simulate
  Resources resources;
  JobEngine engine = JobEngine::local;
  std::string job_file;    // where it was submitted from first: store::to_text() of an absolute path; "#7" follows for line 7 of a manifest
  std::string input_file;  // the mesh or surface as it was named, to_text() of an absolute path
  std::string user;
  double submitted_unix_s = 0.0;
};

/// state.json: the part of a job's state that is in neither the bank nor the last outcome. Written by jobs/store/registry, which is made again
/// from it.
struct SavedState {
  JobState state = JobState::queued;  // queued, waiting, failed or cancelled
  std::string reason;                 // one sentence for people
  int attempts = 0;                   // so far
  int failures = 0;                   // of them, those that count against the retries
};

/// The last line of progress.jsonl that is whole.
struct Progress {
  std::string phase;
  double percent = 0.0;
  long long modes_done = -1;  // -1: not known
  long long modes_wanted = -1;
  double seconds_left = -1.0;  // -1: not known
  double seconds = 0.0;        // since the start
};

/// Each throws InputError for a damaged file and returns none where there is no file.
std::optional<Request> read_request(const std::filesystem::path& folder);
std::optional<SavedState> read_state(const std::filesystem::path& folder);
/// Reads only the end of the file; a line that is cut or no JSON is passed over. Never throws for content.
std::optional<Progress> read_progress(const std::filesystem::path& folder);

/// `folder`/request.json and so on. SystemError when the disk refuses.
void write_request(const std::filesystem::path& folder, const Request& request);
/// The text of request.json, or of one line of submissions.jsonl; and back.
std::string format_request(const Request& request, bool one_line = false);
Request parse_request(std::string_view text, const std::filesystem::path& name);
std::string format_state(const SavedState& saved);
void write_state(const std::filesystem::path& folder, const SavedState& saved);

/// Bytes of a path as text that JSON and SQLite take: valid UTF-8 stays, any other byte (and a backslash before an x) becomes "\xNN".
std::string to_text(const std::filesystem::path& path);
std::filesystem::path from_text(const std::string& text);

/// JSON whose strings hold characters that move the cursor, colour, or turn the direction of writing only as "\uNNNN".
std::string to_plain_json(const std::string& json);

/// The files that a job is made of, of either kind of request.
std::vector<Input> list_inputs(const Request& request);

/// The file name of a request's mesh or surface as it was named; empty for a shape and for a simulation.
std::string find_input_name(const Request& request);

}  // namespace carillon::store
