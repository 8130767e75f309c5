// Meshing phases: progress, timing and guard.
#pragma once

#include <chrono>
#include <string>
#include <utility>

#include "precompute/mesher/surface.hpp"

namespace carillon::mesher {

/// Phases of one mesh. Repeated phases are summed in the report. Refers to the report and the progress.
class Phases {
 public:
  Phases(SurfaceReport& report, const Progress& progress, std::string file)
      : report_(report), progress_(progress), file_(std::move(file)) {}

  template <class Work>
  auto run(const std::string& name, Work&& work) {
    begin(name);
    const Clock clock{report_, name};
    return work();
  }
  /// A message that is not a phase.
  void show(const std::string& text) const {
    if (progress_) progress_(text);
  }

 private:
  struct Clock {
    SurfaceReport& report;
    const std::string& name;
    std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
    ~Clock();
  };
  void begin(const std::string& name) const;

  SurfaceReport& report_;
  const Progress& progress_;
  std::string file_;
};

}  // namespace carillon::mesher
