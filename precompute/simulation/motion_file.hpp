// Motion of the skins as VTKHDF, for ParaView and carillon-draw.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "precompute/job/simulation.hpp"
#include "precompute/simulation/transient/motion.hpp"

namespace carillon::simulation {

/// UnstructuredGrid of moving triangles (VTKHDF 2.0, "Steps") with point data "speed" [m/s] and cell data "body", without strikers. Frames
/// are appended to FILE.frames; finally converted to FILE by way of FILE.part. The caller removes both (run::TemporaryFile). A resumed run
/// continues at its checkpoint. Collective, except for the constructor's checks.
class MotionFile {
 public:
  /// Throws InputError on every rank if is_resumed and there are no frames. Collective.
  MotionFile(const transient::Domain& domain, const job::SimulationSpec& spec, bool is_resumed);

  /// Writes a frame if one is due at the current sample. Throws SystemError for write errors. Collective.
  void add_sample(const transient::Motion& motion);
  /// Writes the file. Collective.
  void finish();

 private:
  struct Point {
    std::int32_t index;
    float x, y, z, speed;
  };
  void write() const;
  void write_cells(std::int64_t root) const;
  void write_steps(std::int64_t root) const;
  void write_frames(std::int64_t root) const;

  const transient::Domain& domain_;
  std::filesystem::path file_, frames_;
  double every_samples_ = 1;
  std::int64_t frame_ = -1;  // the last one
  std::int64_t count_ = 0;   // frames in the file
  double rate_hz_ = 0;
  std::vector<std::array<std::int32_t, 2>> own_;        // index among the points, index on this rank
  std::vector<std::array<std::int32_t, 3>> triangles_;  // into the points
  std::vector<std::int32_t> body_;                      // of each
  std::int32_t points_ = 0;
};

}  // namespace carillon::simulation
