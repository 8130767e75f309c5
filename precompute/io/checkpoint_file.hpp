// The file that a solve is saved to on its way, and resumed from.
#pragma once

#include <mpi.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "precompute/eigen/checkpoint.hpp"
#include "precompute/io/body.hpp"
#include "precompute/io/fingerprint.hpp"
#include "precompute/io/node_order.hpp"
#include "precompute/io/run_record.hpp"

namespace carillon::io {

class SharedFile;

/// One file for one run: a header, what the run has decided, the numbers of the solve, and its columns in the order of the mesh's nodes,
/// written and read by all ranks at once through MPI. docs/decisions/checkpoint.md has the layout. It appears whole or not at all: the old
/// one stays until the new one is on the disk. What is damaged, of another job, mesh or version is said in one line and left alone until
/// there is something to save. Everything is collective unless it says otherwise.
class CheckpointFile {
 public:
  /// job: fingerprint of what is asked for and of who solves. Looks at the file, if there is one. Warnings go to stations.
  CheckpointFile(MPI_Comm comm, std::filesystem::path file, double every_s, const Fingerprint& job, Stations& stations);
  ~CheckpointFile();
  CheckpointFile(const CheckpointFile&) = delete;
  CheckpointFile& operator=(const CheckpointFile&) = delete;

  /// The setting that the run that left the file tried after `trials` others; null where it says nothing.
  const Setting* find_setting(std::size_t trials) const;
  /// A solve begins: of this setting and system, the nodes as they lie on the ranks. Until it ends, get() may be used.
  void begin(const Setting& setting, const Fingerprint& system, const fem::LocalMesh& local);
  eigen::Checkpoint& get() { return checkpoint_; }
  /// The solve is over; what comes next belongs to another.
  void end();
  /// What any rank wishes.
  eigen::Wish vote() const;
  /// From now on the run goes to its end, which is near.
  void finish();
  /// The bank is whole: nothing is to be resumed.
  void remove();
  /// Whether this run has saved something.
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

  MPI_Comm comm_;
  int rank_ = 0;
  std::filesystem::path file_;
  std::filesystem::path temporary_;
  double every_s_;
  Fingerprint job_;
  Stations& stations_;
  bool is_there_ = false;               // the file holds what this job may go on from,
  Content content_;                     // which is this,
  std::vector<Setting> kept_settings_;  // and what was tried before it, itself the last
  std::vector<Setting> settings_;       // the same of this run
  Fingerprint system_{};
  std::unique_ptr<NodeOrder> order_;
  eigen::Checkpoint checkpoint_;
  std::chrono::steady_clock::time_point last_save_;
  double save_seconds_ = 0;  // what the last save took
  bool was_saved_ = false;
  std::string last_trouble_;
};

}  // namespace carillon::io
