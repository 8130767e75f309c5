// What a job file asks for: the modes of a body, which become a bank, or a simulation, whose files are kept as one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/store/records.hpp"
#include "precompute/job/job_spec.hpp"
#include "runtime/base/json.hpp"

namespace carillon::store {

/// A job file that is larger is refused.
inline constexpr std::uint64_t kMaxJobBytes = 64 << 20;

/// A file that a job names.
struct NamedInput {
  InputKind kind = InputKind::mesh;
  std::filesystem::path file;  // absolute
};

/// A simulation as the store keeps it: the job as written, with its materials resolved and the files that it makes under the store's names
/// (kOutputs). Every key of the job counts for the identity, defaults that are written out too.
struct SimulationOrder {
  std::filesystem::path file;  // where it was read from
  std::string text;            // JSON; inputs by absolute paths
  std::vector<NamedInput> inputs;
  Resources resources;
  std::vector<std::string> warnings;
};

/// One of the two.
class JobOrder {
 public:
  JobOrder() = default;
  JobOrder(job::JobSpec bank) : bank_(std::move(bank)) {}
  explicit JobOrder(SimulationOrder simulation) : simulation_(std::move(simulation)) {}

  bool is_simulation() const { return simulation_.has_value(); }
  const job::JobSpec& bank() const { return bank_; }
  const std::filesystem::path& file() const { return simulation_ ? simulation_->file : bank_.file; }
  const Resources& resources() const { return simulation_ ? simulation_->resources : bank_.resources; }
  const std::vector<std::string>& warnings() const { return simulation_ ? simulation_->warnings : bank_.warnings; }
  std::vector<NamedInput> list_inputs() const;

  /// The job as text, to be carried out in the folder of work `folder`: inputs at these paths, one for each of list_inputs().
  std::string write(const std::filesystem::path& folder, const std::vector<std::filesystem::path>& inputs) const;
  /// The job in one line, which is the same wherever its files are. A simulation has the names of `inputs` in it.
  std::string make_canonical(const std::vector<std::filesystem::path>& inputs) const;

 private:
  job::JobSpec bank_;
  std::optional<SimulationOrder> simulation_;
};

/// Reads and validates a job of either kind. Throws InputError; a simulation has to name a file that it makes.
JobOrder read_order(const std::filesystem::path& file);
/// The same from text; `first_line` is the number of its first line in `file`.
JobOrder parse_order(std::string_view text, const std::filesystem::path& file, int first_line = 1);

/// The files that a simulation makes, by the key of the job that asks for them. The record is always made, and written last.
struct Output {
  const char* key;
  const char* file;
};
inline constexpr const char* kRecordFile = "record.json";
inline constexpr Output kOutputs[] = {{"sound", "sound.wav"},
                                      {"spectrogram", "spectrogram.png"},
                                      {"surface", "surface.hdf"},
                                      {"motion", "motion.vtkhdf"},
                                      {"record", kRecordFile}};

/// Of a resolved job of a simulation (JSON): the files that it makes.
std::vector<std::string> list_outputs(const std::string& job);

/// Of a job of a simulation as JSON: its line as in make_canonical(), with the file names of its inputs.
std::string make_canonical_simulation(base::Json root);
/// The same job with inputs at these paths, to be carried out.
std::string write_simulation(base::Json root, const std::vector<std::filesystem::path>& inputs);
/// Why a record of a run (JSON) is not that of the job with this text, in one sentence; none when it is.
std::optional<std::string> find_record_fault(const std::string& record, const std::string& job_text);

}  // namespace carillon::store
