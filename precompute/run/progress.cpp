#include "precompute/run/progress.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <utility>

#include "precompute/job/cost/problem_size.hpp"

namespace carillon::run {
namespace {

/// Share of the run before each phase.
constexpr std::array<std::pair<std::string_view, double>, 9> kShares{{{"read", 0.0},
                                                                      {"partition", 0.02},
                                                                      {"assemble", 0.04},
                                                                      {"modes", 0.06},
                                                                      {"errors", 0.85},
                                                                      {"coupling", 0.9},
                                                                      {"collect", 0.92},
                                                                      {"air", 0.93},
                                                                      {"write", 0.98}}};

double find_share(std::string_view phase) {
  const auto found = std::find_if(kShares.begin(), kShares.end(), [&](const auto& entry) { return entry.first == phase; });
  return found == kShares.end() ? 0.0 : found->second;
}

struct PhaseName {
  const char* key;   // in the progress file
  const char* text;  // in the log
};

PhaseName find_name(eigen::Phase phase) {
  switch (phase) {
    case eigen::Phase::kRigid:
      return {"rigid", "rigid modes in closed form"};
    case eigen::Phase::kAnalyse:
      return {"analyse", "elimination order"};
    case eigen::Phase::kCount:
      return {"count", "counting the modes of the band"};
    case eigen::Phase::kFactor:
      return {"factor", "factorising K - sigma M"};
    case eigen::Phase::kIterate:
      return {"iterate", ""};
    case eigen::Phase::kCheck:
      return {"check", "residuals and orthogonality"};
  }
  return {"", ""};
}

}  // namespace

std::string describe(const eigen::Progress& progress) {
  if (progress.phase != eigen::Phase::kIterate) return find_name(progress.phase).text;
  return fmt::format("{} of {} modes", std::min(progress.modes_done, progress.modes_wanted), progress.modes_wanted);
}

ProgressReporter::ProgressReporter(const std::filesystem::path& file) : file_(file) {}

void ProgressReporter::begin(const std::string& phase) {
  if (phase == "read") begin_percent_ = line_.percent;
  if (phase != "modes") write_line(phase, find_share(phase));  // "modes" begins with a phase of the eigensolver
}

void ProgressReporter::advance(const eigen::Progress& progress) {
  const double wanted = static_cast<double>(cost::predict_solves(std::max<std::int64_t>(progress.modes_wanted, 1)));
  const double share = progress.phase == eigen::Phase::kCheck ? 1.0 : std::min(static_cast<double>(progress.solves) / wanted, 1.0);
  line_.modes_done = std::min(progress.modes_done, progress.modes_wanted);
  if (progress.modes_wanted > 0) line_.modes_wanted = progress.modes_wanted;
  write_line(find_name(progress.phase).key, find_share("modes") + share * (find_share("errors") - find_share("modes")));
}

void ProgressReporter::finish() { write_line("done", 1.0); }

/// A full disk must not end the run.
void ProgressReporter::write_line(const std::string& phase, double share) {
  line_.phase = phase;
  const double percent = begin_percent_ + share * (100.0 - begin_percent_);
  line_.percent = phase == "done" ? 100.0 : std::clamp(percent, line_.percent, 99.9);
  line_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  if (!file_.append(line_))
    fmt::print(stderr, "carillon-precompute: warning: cannot write to the progress file any more: {}\n", std::strerror(errno));
}

}  // namespace carillon::run
