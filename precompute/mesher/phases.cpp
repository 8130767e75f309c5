#include "precompute/mesher/phases.hpp"

#include <algorithm>

#include "precompute/mesher/guard.hpp"

namespace carillon::mesher {

void Phases::begin(const std::string& name) const {
  set_guarded_step(file_, name);
  show(name);
}

Phases::Clock::~Clock() {
  const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const auto found = std::find_if(report.seconds.begin(), report.seconds.end(), [&](const auto& entry) { return entry.first == name; });
  if (found == report.seconds.end())
    report.seconds.emplace_back(name, s);
  else
    found->second += s;
}

}  // namespace carillon::mesher
