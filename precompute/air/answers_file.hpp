// The wave numbers that a run has solved, on disk.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "precompute/air/solve.hpp"

namespace carillon::air {

/// A file to which answers are appended one by one, each with its own checksum: what is whole is read again, whenever the run ended. What
/// it keeps true: all answers in it are of one radiator in one setting. Rank 0 alone.
class AnswersFile {
 public:
  /// `fingerprint`: of what is solved and how. A file of another one, and what is damaged of it, counts as empty.
  AnswersFile(std::filesystem::path file, const std::array<unsigned char, 32>& fingerprint);

  /// In the order in which they were saved.
  std::vector<WaveAnswer> read() const;
  /// Throws SystemError when the disk refuses.
  void save(const WaveAnswer& answer);
  /// The solve is over.
  void remove();

 private:
  std::filesystem::path file_;
  std::array<unsigned char, 32> fingerprint_{};
  std::size_t whole_bytes_ = 0;  // 0: no file, or none of ours
};

/// Of the radiator and what of the options and of the program decides the answers.
std::array<unsigned char, 32> calc_fingerprint(const Radiator& radiator, const AirSolveOptions& options);

}  // namespace carillon::air
