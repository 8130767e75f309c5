// Recorded surface of a run (docs/surface-format.md). Internal to carillon::emission.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "precompute/simulation/emission/emission.hpp"
#include "precompute/simulation/emission/sources.hpp"
#include "precompute/simulation/emission/surface_file.hpp"
#include "precompute/simulation/emission/surfaces.hpp"

namespace carillon::emission {

/// Writes triangle accelerations in blocks of samples and vertex positions at keys, of all ranks, to the file of rank 0. All calls are
/// collective and throw SystemError on all ranks for write errors.
class Recorder {
 public:
  /// options: as for Emission, with a file. Throws InputError as SurfaceFile does.
  Recorder(const Surfaces& surfaces, const Options& options);

  /// Sample k; x: rows. False for a number that is not finite or too large, recorded as 0.
  bool record(std::int64_t k, const double* x, Sources& sources);
  bool is_whole() const { return keys_written_ >= static_cast<std::int64_t>(header_.count_keys()); }
  /// On rank 0.
  void commit() {
    if (file_) file_->commit();
  }

  template <typename Visit>
  void visit_state(Visit&& visit) {
    visit(keys_written_, block_);
  }

 private:
  void write_block(std::uint64_t number, bool& is_fine);
  void write_key(std::uint64_t key, const double* x, bool& is_fine);

  const Surfaces& surfaces_;
  recording::Header header_;
  std::unique_ptr<SurfaceFile> file_;  // rank 0
  std::int64_t keys_written_ = 0;
  std::vector<float> block_;  // (own triangles, kBlockFrames): accelerations of the open block
};

}  // namespace carillon::emission
