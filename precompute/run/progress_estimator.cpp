// Method:     Every part of the run has a predicted cost in seconds of wall clock. What is done, at these prices, against the seconds it
//             really took gives the pace; the pace times the prices of what is left gives the seconds left, and
//             percent = 100 gone / (gone + left). Within a factorisation the clock says how far it is; within the iteration the number of
//             right-hand sides does.
#include "precompute/run/progress_estimator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string_view>

namespace carillon::run {
namespace {

constexpr std::array<std::string_view, 9> kPhases{"read",     "partition", "assemble", "modes", "errors",
                                                  "coupling", "collect",   "air",      "write"};
constexpr int kModes = 3, kAfterTrials = 5;
constexpr double kTrustSeconds = 0.5;  // weight of the predictions against what is measured
constexpr double kNearEnd = 0.95;      // of a part whose time is up and which continues
constexpr double kMax = 99.9;          // per cent, before the end
constexpr double kTrialShare = 0.5;    // of the rest: for a trial after which others may follow

std::array<double, 9> list(const cost::PhaseSeconds& costs) {
  return {costs.read,     costs.partition, costs.assemble, costs.sum_modes(), costs.errors,
          costs.coupling, costs.collect,   costs.air,      costs.write};
}

double calc_factorisations(const eigen::Progress& progress, const cost::ProblemSize& size) {
  const auto made = progress.factorisations;
  return static_cast<double>(std::max(cost::predict_factorisations(progress.modes_wanted, size.counts_low_end), made));
}

}  // namespace

void ProgressEstimator::begin(const std::string& phase, double seconds) {
  const auto found = std::find(kPhases.begin(), kPhases.end(), phase);
  if (found == kPhases.end()) return;
  phase_ = static_cast<int>(found - kPhases.begin());
  if (phase_ == 0) {
    start_percent_ = percent_;
    start_s_ = seconds;
    progress_ = {};
  }
  if (phase_ >= kAfterTrials && is_trial_) {  // It was the last trial.
    is_trial_ = false;
    start_percent_ = percent_;
  }
  begun_s_ = seconds;
}

void ProgressEstimator::set_size(const cost::ProblemSize& size) {
  size_ = size;
  costs_ = cost::calc_wall(cost::predict_seconds(size), size, ranks_);
  knows_size_ = size.tets > 0;
}

void ProgressEstimator::advance(const eigen::Progress& progress, double seconds) {
  const bool is_news = progress.factor_flops != progress_.factor_flops || progress.modes_wanted != progress_.modes_wanted;
  progress_ = progress;
  begun_s_ = seconds;
  if (!is_news) return;
  if (progress.factor_flops > 0) size_.factor_flops = progress.factor_flops;
  if (progress.factor_entries > 0) size_.factor_entries = progress.factor_entries;
  if (progress.modes_wanted > 0) size_.modes = progress.modes_wanted;
  set_size(size_);
}

/// At its price, without the step that is under way.
double ProgressEstimator::calc_modes_done() const {
  if (progress_.phase == eigen::Phase::kRigid || progress_.phase == eigen::Phase::kAnalyse) return 0;
  if (progress_.phase == eigen::Phase::kCheck) return costs_.sum_modes() - costs_.check;
  const double factors = static_cast<double>(progress_.factorisations) / calc_factorisations(progress_, size_);
  const auto wanted =
      static_cast<double>(std::max<std::int64_t>(cost::predict_solves(std::max<std::int64_t>(size_.modes.value_or(1), 1)), 1));
  const double solved = std::min(static_cast<double>(progress_.solves) / wanted, kNearEnd);
  return costs_.analyse + costs_.factor * factors + costs_.solve * solved + costs_.orthogonalise * solved * solved;
}

/// The price of the step under way.
double ProgressEstimator::calc_step() const {
  if (phase_ != kModes) return list(costs_)[phase_];
  switch (progress_.phase) {
    case eigen::Phase::kRigid:
    case eigen::Phase::kAnalyse:
      return costs_.analyse;
    case eigen::Phase::kCount:
    case eigen::Phase::kFactor:
      return costs_.factor / calc_factorisations(progress_, size_);
    case eigen::Phase::kCheck:
      return costs_.check;
    default:
      return 0;
  }
}

ProgressEstimator::Share ProgressEstimator::calc_share(double seconds) const {
  const std::array<double, 9> prices = list(costs_);
  double done = 0;
  double all = 0;
  for (int i = 0; i < static_cast<int>(prices.size()); ++i) {
    all += prices[i];
    if (i < phase_) done += prices[i];
  }
  if (phase_ == kModes) done += calc_modes_done();
  const double step = phase_ < 0 ? 0 : calc_step();
  done += std::min(seconds - begun_s_, kNearEnd * step);
  const double gone = seconds - start_s_;
  const double pace = (gone + kTrustSeconds) / (done + kTrustSeconds);
  return {gone, std::max(all - done, 0.0) * pace};
}

double ProgressEstimator::calc_percent(double seconds) {
  if (is_done_) return percent_ = 100;
  const Share share = calc_share(seconds);
  const double part = share.done / std::max(share.done + share.left, 1e-9);
  const double end = is_trial_ ? start_percent_ + kTrialShare * (kMax - start_percent_) : 100;
  percent_ = std::clamp(start_percent_ + part * (end - start_percent_), percent_, kMax);
  return percent_;
}

std::optional<double> ProgressEstimator::calc_seconds_left(double seconds) const {
  if (is_done_) return 0.0;
  if (!knows_size_ || is_trial_) return std::nullopt;
  return calc_share(seconds).left;
}

}  // namespace carillon::run
