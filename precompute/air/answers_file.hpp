// Solved wave numbers on disk.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "precompute/air/solve.hpp"

namespace carillon::air {

/// Append-only file of answers, each with its own checksum; complete answers are read again after a crash. Invariant: all answers have the
/// same radiator and settings. Rank 0 only.
class AnswersFile {
 public:
  /// `fingerprint`: hash of radiator and settings. A mismatched or corrupt file is treated as empty.
  AnswersFile(std::filesystem::path file, const std::array<unsigned char, 32>& fingerprint);

  /// In the order of save().
  std::vector<WaveAnswer> read() const;
  /// Throws SystemError when the write fails.
  void save(const WaveAnswer& answer);
  /// Removes the file.
  void remove();

 private:
  std::filesystem::path file_;
  std::array<unsigned char, 32> fingerprint_{};
  std::size_t whole_bytes_ = 0;  // 0: missing or mismatched file
};

/// Hash of the radiator, the options and the program version that determine the answers.
std::array<unsigned char, 32> calc_fingerprint(const Radiator& radiator, const AirSolveOptions& options);

}  // namespace carillon::air
