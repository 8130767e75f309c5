// Fingerprints of jobs and systems, independent of the number of ranks.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/eigen/checkpoint.hpp"
#include "precompute/job/setting.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::io {

using job::Setting;

using Fingerprint = base::Sha256::Hash;

/// Of the job without file paths, and of the program. Not collective.
Fingerprint find_job_fingerprint(const job::JobSpec& job, const std::vector<std::string>& solver_options);

/// Of the job, the setting, and every node and element of the mesh, bit by bit. The same on every rank and for every number of ranks.
/// Collective.
Fingerprint find_system_fingerprint(const comm::Communicator& comm, const Fingerprint& job, const Setting& setting,
                                    const mesh::LocalMesh& local);

/// A setting as numbers, and back. Throws InputError for invalid numbers.
void write_setting(eigen::NumberWriter& to, const Setting& setting);
Setting read_setting(eigen::NumberReader& from);

/// "0.1.0 (3403b64...)"
std::string find_program_version();

/// Order-dependent 64-bit hash of a few numbers; for sums that detect changes in a set of records.
class Mixer {
 public:
  explicit Mixer(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ull + 0x2545F4914F6CDD1Dull) {}
  void add(std::uint64_t word) {
    state_ = (state_ ^ word) * 0xD6E8FEB86659FD93ull;  // odd, so injective
    state_ ^= state_ >> 32;
  }
  void add(double value);
  std::uint64_t get() const;

 private:
  std::uint64_t state_;
};

}  // namespace carillon::io
