// Nonlinear energy of coupled modes and its gradient at a sample. Internal to carillon::nonlinear.
#pragma once

#include <utility>
#include <vector>

#include "runtime/bank/quartic_energy.hpp"
#include "runtime/synth/nonlinear/kernels.hpp"

namespace carillon::nonlinear {

/// Matrices of an energy in kernel layout, zero-padded and scaled so that motion of about one thickness has size 1: single precision does
/// not overflow for physical motion. Diagonal matrices (strings, mean stresses) are kept as diagonals, in double precision; sparse ones
/// (plates in closed form have four entries per pair of modes) as entries. Allocates in the constructor only.
class Evaluator {
 public:
  /// Pre: the sizes of the energy agree, and its numbers are finite.
  Evaluator(const bank::QuarticEnergy& energy, const CoupledKernels& kernels);

  /// Factor from q to scaled q.
  double get_scale() const noexcept { return scale_; }
  /// Couples only the first `modes` from now on; q of the others is 0. [audio-thread]
  void set_count(int modes) noexcept;
  /// V [J] at q, given twice: scaled, in single precision, zero-padded; and as im and to_q, whose products are q [m kg^1/2], for diagonals
  /// in double precision. Fills `gradient` with respect to unscaled q [N kg^-1/2]; 0 for uncoupled modes. [audio-thread]
  double evaluate(const float* q, const double* im, const double* to_q, double* gradient) noexcept;
  std::size_t calc_bytes() const noexcept;

 private:
  double evaluate_diagonals(const double* im, const double* to_q, double* gradient) noexcept;
  void add_rows(const bank::QuarticEnergy& energy);
  void add_entries(const bank::QuarticEnergy& energy);
  void add_diagonals(const bank::QuarticEnergy& energy);
  void add_points(const bank::QuarticEnergy& energy);

  enum class Form { kDiagonals, kEntries, kRows, kPoints };
  /// Entries of a sparse matrix, by rows in groups of kUnit: see CoupledKernels::sum_up.
  struct Entries {
    std::vector<std::int32_t> begin, index;
    std::vector<float> values;
    void append(const std::vector<std::pair<std::int32_t, float>>* rows, int count);
  };
  const CoupledKernels* kernels_;
  Form form_ = Form::kRows;
  double scale_ = 1.0;
  int modes_ = 0, count_ = 0, padded_ = 0, rows_ = 0, parts_ = 0, strains_ = 0, points_ = 0;
  bool is_curved_ = false;
  std::ptrdiff_t stride_ = 0;
  std::vector<double> diagonals_, exact_linear_;    // (R, N)
  std::vector<std::size_t> places_;                 // entries: row of the energy for each row
  std::vector<float> matrices_, columns_, linear_;  // (R, stride), (N, parts, P), (R, padded N)
  Entries of_rows_, of_pairs_;                      // A_r by rows, and by pairs of modes
  std::vector<float> eta_, weight_, of_linear_, pairs_, sum_, gradient_, back_, forces_, more_;
};

}  // namespace carillon::nonlinear
