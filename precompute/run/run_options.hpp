// The command line's options of a run.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace carillon::run {

struct RunOptions {
  bool quiet = false;                         // no progress on standard output
  std::vector<std::string> solver_options;    // words for PETSc ("-log_view")
  std::filesystem::path checkpoint;           // resumed from where it fits, and saved to; empty: none
  double checkpoint_every_s = 300;            // seconds between two saves of it
  std::filesystem::path progress;             // progress as JSON lines is appended here; empty: nowhere
  std::vector<std::string> folder;            // work in folder [1] below [0]; no link below [0] is followed; empty: where it was started
  bool profile = false;                       // messages are counted: read by the launcher
  std::filesystem::path bank;                 // overrides the job's "bank"; empty: does not
  std::filesystem::path matrices;             // folder for K and M as files; empty: none
  std::filesystem::path radiate;              // a bank that gets its multipoles, in place of a job; empty: none
  double memory_gb = 0;                       // limit for all ranks of a machine together; 0: its available memory
  bool validate = false;                      // check and predict, do not solve
  double patience_s = 9;                      // of --validate: for the answer; steps that would take longer are left out
  double count_s = 1e6;                       // of --validate: for the count of the modes
  std::optional<std::array<double, 3>> at_m;  // print the modes at this point, where they are known, and write no bank
  bool json = false;                          // what is printed at the end is JSON

  std::int64_t get_memory_limit_bytes() const { return static_cast<std::int64_t>(1e9 * memory_gb); }
};

}  // namespace carillon::run
