// Options shared by several commands.
#pragma once

#include <string>

#include "jobs/store/records.hpp"
#include "jobs/store/registry/registry.hpp"

namespace carillon::cli {

/// --ranks, --memory-gb, --time-limit, --on.
struct ResourceOptions {
  int ranks = 0;
  double memory_gb = 0.0;
  std::string time_limit;  // "90", "90s", "15m", "2h"
  std::string engine;

  /// Overrides the values of the job file.
  void apply(store::Request& request) const;
  /// The same for a row; false without options.
  bool apply(registry::Job& job) const;
};

/// Seconds of "90", "90s", "15m", "2h" or "1d". InputError for anything else.
double parse_seconds(const std::string& text);

}  // namespace carillon::cli
