#include "jobs/cli/options.hpp"

#include <fmt/core.h>

#include <charconv>
#include <system_error>

#include "jobs/cli/shared.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

constexpr double kMaxSeconds = 1e9;

double find_unit(const std::string& unit) {
  if (unit.empty() || unit == "s") return 1;
  if (unit == "m" || unit == "min") return 60;
  if (unit == "h") return 3600;
  return unit == "d" ? 86400 : 0;
}

}  // namespace

double parse_seconds(const std::string& text) {
  double value = 0.0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
  const double unit = end.ec == std::errc() ? find_unit(std::string(end.ptr, text.data() + text.size())) : 0;
  if (!(unit > 0 && value > 0 && value * unit <= kMaxSeconds))
    throw InputError(fmt::format("--time-limit {}: give seconds, or a number with s, m, h or d: 90, 15m, 2h", show(text)));
  return value * unit;
}

void ResourceOptions::apply(store::Request& request) const {
  if (ranks > 0) request.resources.ranks = ranks;
  if (memory_gb > 0) request.resources.memory_gb = memory_gb;
  if (!time_limit.empty()) request.resources.time_limit_s = parse_seconds(time_limit);
}

bool ResourceOptions::apply(registry::Job& job) const {
  store::Request request;
  request.resources = job.resources;
  apply(request);
  job.resources = request.resources;
  if (!engine.empty() && job.slurm_job.empty())
    job.engine = store::find_engine(engine).value_or(job.engine);  // jobs in Slurm keep their engine until cancelled
  return ranks > 0 || memory_gb > 0 || !time_limit.empty() || !engine.empty();
}

}  // namespace carillon::cli
