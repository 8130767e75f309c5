// The content of a job file: a bank to compute, or a simulation.
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

/// Size limit of job files.
inline constexpr std::uint64_t kMaxJobBytes = 64 << 20;

/// An input file named by a job.
struct NamedInput {
  InputKind kind = InputKind::mesh;
  std::filesystem::path file;  // absolute
};

/// A simulation: the job as written, with resolved materials and with the store's names (kOutputs) for its output files. Every key of the
/// job is part of the id, including keys with default values.
struct SimulationOrder {
  std::filesystem::path file;  // source
  std::string text;            // JSON; inputs as absolute paths
  std::vector<NamedInput> inputs;
  Resources resources;
  std::vector<std::string> warnings;
};

/// A bank or a simulation.
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

  /// The job as text for the folder of work `folder`; `inputs`: paths of list_inputs() in the store.
  std::string write(const std::filesystem::path& folder, const std::vector<std::filesystem::path>& inputs) const;
  /// The job as one line, independent of the location of its files; of a simulation, with the file names of `inputs`.
  std::string make_canonical(const std::vector<std::filesystem::path>& inputs) const;

 private:
  job::JobSpec bank_;
  std::optional<SimulationOrder> simulation_;
};

/// Reads and validates a job of either kind. InputError, also for a simulation without an output file.
JobOrder read_order(const std::filesystem::path& file);
/// The same from text; `first_line` is the number of its first line in `file`.
JobOrder parse_order(std::string_view text, const std::filesystem::path& file, int first_line = 1);

/// Output files of a simulation and their keys in the job. The record is always written, and last.
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

/// Output files of a resolved simulation job (JSON).
std::vector<std::string> list_outputs(const std::string& job);

/// The line of JobOrder::make_canonical() for a simulation.
std::string make_canonical_simulation(base::Json root);
/// The simulation job with inputs at these paths.
std::string write_simulation(base::Json root, const std::vector<std::filesystem::path>& inputs);
/// Why a record (JSON) does not belong to the job with this text, in one sentence; none if it does.
std::optional<std::string> find_record_fault(const std::string& record, const std::string& job_text);

}  // namespace carillon::store
