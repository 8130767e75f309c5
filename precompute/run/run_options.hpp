// Command-line options of a run.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace carillon::run {

struct RunOptions {
  bool quiet = false;                           // no progress on standard output
  std::vector<std::string> solver_options{};    // words for PETSc ("-log_view")
  std::filesystem::path checkpoint{};           // resumed from if it fits, and saved to; empty: none
  double checkpoint_every_s = 300;              // interval of saves
  std::filesystem::path progress{};             // JSON lines are appended; empty: none
  bool profile = false;                         // count messages; read by the launcher
  std::filesystem::path bank{};                 // overrides the job's "bank"; empty: no
  std::filesystem::path matrices{};             // folder for K and M; empty: none
  std::filesystem::path radiate{};              // bank to add multipoles to, instead of a job; empty: none
  double memory_gb = 0;                         // limit of all ranks of a machine together; 0: its available memory
  bool validate = false;                        // check and predict only
  std::optional<std::array<double, 3>> at_m{};  // print known modes at this point and write no bank
  bool json = false;                            // output as JSON

  std::int64_t get_memory_limit_bytes() const { return static_cast<std::int64_t>(1e9 * memory_gb); }
};

}  // namespace carillon::run
