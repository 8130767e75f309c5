// Checkpoint file of a solve.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/eigen/checkpoint.hpp"
#include "precompute/run/io/fingerprint.hpp"
#include "precompute/run/io/node_order.hpp"

namespace carillon::io {

class SharedFile;

/// Callbacks to the run. None may be empty.
struct CheckpointHost {
  std::function<void(const std::string&)> log, warn;  // one line; called on every rank, printed on rank 0
  std::function<bool()> is_stop_requested;            // by a signal to this process; local
  std::function<void(bool)> set_unsaved;              // presence of unsaved work; local
};

/// One file per run: a header, the settings tried, the numbers of the solve, and its columns in the order of the mesh's nodes, written and
/// read by all ranks at once (pwrite, pread). Layout: docs/decisions/checkpoint.md. Replaced atomically: the old file stays until the new
/// one is on the disk. A file that is damaged or of another job, mesh or version gives a one-line warning and is renamed to <file>.aside.
/// Collective unless stated otherwise.
class CheckpointFile {
 public:
  /// job: fingerprint of the job and the program. Reads the file if it exists.
  CheckpointFile(const comm::Communicator& comm, std::filesystem::path file, double every_s, const Fingerprint& job, CheckpointHost host);
  ~CheckpointFile();
  CheckpointFile(const CheckpointFile&) = delete;
  CheckpointFile& operator=(const CheckpointFile&) = delete;

  /// Setting that the saved run tried after `trials` others; null: unknown.
  const Setting* find_setting(std::size_t trials) const;
  /// Begins a solve of this setting and system, with the nodes of this rank. get() is valid until end().
  void begin(const Setting& setting, const Fingerprint& system, const mesh::LocalMesh& local);
  eigen::Checkpoint& get() { return checkpoint_; }
  /// Ends the solve.
  void end();
  /// Combined requests of all ranks.
  eigen::CheckpointRequest vote() const;
  /// Ignores stop requests from now on: the run is about to end.
  void finish();
  /// Removes the file: the bank is complete.
  void remove();
  /// True if this run has saved.
  bool was_saved() const { return was_saved_; }

 private:
  struct Content {
    std::int64_t rows = 0;  // nodes
    std::int64_t columns = 0;
    std::int64_t data_at = 0;
    std::uint64_t sum = 0;
    Fingerprint system{};
    std::string settings;
    std::string numbers;
  };

  void look();
  std::string read_content(Content& content) const;
  std::string verify();
  void set_aside(const std::string& why);
  bool save(const std::string& numbers, const std::vector<eigen::Columns>& columns);
  void write(const std::string& numbers, const std::vector<eigen::Columns>& columns);
  std::uint64_t write_columns(SharedFile& file, std::int64_t data_at, std::int64_t count, const std::vector<eigen::Columns>& columns) const;
  void read_columns(std::int64_t first, const eigen::Columns& into) const;
  std::int64_t find_place(std::int64_t data_at, std::int64_t group, int width) const;
  std::string cut_version() const;
  bool is_ahead() const { return is_there_ && settings_.size() < kept_settings_.size(); }

  comm::Communicator comm_;
  std::filesystem::path file_;
  std::filesystem::path temporary_;
  double every_s_;
  Fingerprint job_;
  CheckpointHost host_;
  bool is_there_ = false;               // the file is valid for this job,
  Content content_;                     // its content,
  std::vector<Setting> kept_settings_;  // and the settings that it tried, the last one included
  std::vector<Setting> settings_;       // of this run
  Fingerprint system_{};
  std::unique_ptr<NodeOrder> order_;
  eigen::Checkpoint checkpoint_;
  std::chrono::steady_clock::time_point last_save_;
  double save_seconds_ = 0;  // duration of the last save
  bool was_saved_ = false;
  std::string last_trouble_;
};

}  // namespace carillon::io
