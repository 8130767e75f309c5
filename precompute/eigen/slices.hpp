// Intervals of lambda with their eigenvalue counts, and the sweep of a band.
#pragma once

#include <cstdint>
#include <functional>
#include <map>

namespace carillon::eigen {

/// An interval of lambda and the number of eigenvalues below each end.
struct Slice {
  double low = 0;
  std::int64_t below_low = 0;
  double high = 0;
  std::int64_t below_high = 0;

  std::int64_t count() const { return below_high - below_low; }
};

/// Number of eigenvalues below lambda. Costs a factorisation.
using CountBelow = std::function<std::int64_t(double lambda)>;

/// Known numbers of eigenvalues below lambda, with interpolation.
class Counts {
 public:
  explicit Counts(const Slice& band);

  void add(double lambda, std::int64_t below);
  /// Lambda with about `below` eigenvalues below it; at least `margin` of the surrounding known interval (in frequency) away from its ends.
  double find_lambda(double below, double margin) const;

 private:
  std::int64_t below_low_;
  std::map<double, std::int64_t> known_;  // relative to below_low_
};

/// Lowers the upper end until the slice holds slightly more than `wanted` eigenvalues; unchanged if it holds no more. expected: guess of
/// the last one wanted, used if it lies in the band.
Slice cut_to_lowest(const Slice& band, std::int64_t wanted, double expected, const CountBelow& count_below);

/// Splits a band into slices of at most about `max` eigenvalues, upwards. A slice costs only the count at its shift, where K - sigma M is
/// factorised anyway; the modes above the shift are verified at the next shift.
class Sweep {
 public:
  Sweep(const Slice& band, std::int64_t max, CountBelow count_below);

  /// Unsolved rest. Its count is right once all modes below it are found.
  const Slice& get_rest() const { return rest_; }
  /// The rest is small enough, or a cluster too narrow to cut: one more slice, with an exact count.
  bool is_last() const;

  struct Part {
    double sigma = 0;
    std::int64_t below_sigma = 0;
    Slice slice;  // below_high is a guess
  };
  /// Next slice and its shift, where the last count was taken. Requires !is_last().
  Part take();
  /// All `below` eigenvalues below lambda are found.
  void advance(double lambda, std::int64_t below);

 private:
  Slice rest_;
  std::int64_t max_;
  CountBelow count_below_;
  Counts counts_;
};

}  // namespace carillon::eigen
