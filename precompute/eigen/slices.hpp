// Intervals of lambda with the number of eigenvalues in them, and how a band is gone through.
#pragma once

#include <cstdint>
#include <functional>
#include <map>

namespace carillon::eigen {

/// An interval of lambda and how many eigenvalues lie below its ends.
struct Slice {
  double low = 0;
  std::int64_t below_low = 0;
  double high = 0;
  std::int64_t below_high = 0;

  std::int64_t count() const { return below_high - below_low; }
};

/// Number of eigenvalues below lambda. Costs a factorisation.
using CountBelow = std::function<std::int64_t(double lambda)>;

/// What is known of the number of eigenvalues below lambda, and what it says in between.
class Counts {
 public:
  explicit Counts(const Slice& band);

  void add(double lambda, std::int64_t below);
  /// Where about `below` eigenvalues lie below; within the interval of known counts around it, `margin` of it (in frequency) from its ends.
  double find_lambda(double below, double margin) const;

 private:
  std::int64_t below_low_;
  std::map<double, std::int64_t> known_;  // relative to below_low_
};

/// Lowers the upper end until the slice holds `wanted` eigenvalues and few more; the slice itself when it holds no more than that.
Slice cut_to_lowest(const Slice& band, std::int64_t wanted, const CountBelow& count_below);

/// Goes up a band in slices of at most about `max` eigenvalues. The only count that a slice costs is the one at the shift inside it, where
/// K - sigma M is factorised anyway; what lies above the shift shows at the next one.
class Sweep {
 public:
  Sweep(const Slice& band, std::int64_t max, CountBelow count_below);

  /// What is left to be solved. Its count is right when all below it is found.
  const Slice& get_rest() const { return rest_; }
  /// The rest is few enough, or a cluster too narrow to cut: one more slice, with an exact count.
  bool is_last() const;

  struct Part {
    double sigma = 0;
    std::int64_t below_sigma = 0;
    Slice slice;  // below_high is a guess
  };
  /// The next slice about its shift; the last count was taken there. Only while it is not the last.
  Part take();
  /// All below lambda is solved: `below` eigenvalues.
  void advance(double lambda, std::int64_t below);

 private:
  Slice rest_;
  std::int64_t max_;
  CountBelow count_below_;
  Counts counts_;
};

}  // namespace carillon::eigen
