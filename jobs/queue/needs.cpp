// Method:     The cost model (precompute/job/cost) estimates from the requested nodes or the size of the mesh file. Large jobs and jobs of
//             unknown size are predicted by carillon-precompute --validate, simulations by carillon-simulate --validate.
#include "jobs/queue/needs.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/outcome/policy.hpp"
#include "precompute/job/cost/calibration.hpp"
#include "precompute/job/cost/memory.hpp"
#include "precompute/job/cost/seconds.hpp"
#include "runtime/base/document.hpp"

namespace carillon::queue {
namespace {

namespace fs = std::filesystem;

constexpr double kLargeNodes = 30000.0;
constexpr int kMaxGuessedRanks = 1024;

/// Problem size; unknown: an upper bound for most jobs.
struct Size {
  cost::ProblemSize problem = cost::estimate_meshed_size(cost::kUnknownNodes, true);
  bool is_known = false;
};

Size find_size(const store::Store& store, const store::Request& request) {
  Size size;
  try {
    base::Object job = base::parse_document(request.job, "request.json").root();
    const bool is_quadratic = job.string_or("element", "T10") != "T4";
    if (std::optional<base::Object> body = job.object_if("body")) {
      if (body->has_number("nodes"))
        size = {cost::estimate_meshed_size(std::llround(body->number("nodes")), is_quadratic), true};
      else if (request.input_kind == store::InputKind::surface && !body->has_number("edge_m"))
        size = {cost::estimate_meshed_size(cost::kDefaultNodes, is_quadratic), true};
    }
    std::error_code error;
    if (request.input_kind == store::InputKind::mesh) {
      const auto bytes = static_cast<std::int64_t>(
          fs::file_size(store.input_file(store::require_id(request.input_sha256, "request.json"), request.input_format), error));
      if (!error) size = {cost::estimate_file_size(bytes, is_quadratic), true};
    }
    if (job.has("radiation")) {
      std::optional<base::Object> air = job.has_object("radiation") ? job.object_if("radiation") : std::nullopt;
      size.problem.air_nodes = air && air->has_number("skin_nodes") ? std::llround(air->number("skin_nodes")) : cost::kAirNodes;
      if (job.has_string("radiation") && job.string("radiation") == "none") size.problem.air_nodes = 0;
    }
    if (job.has_number("max_modes"))
      size.problem.modes = std::min<std::int64_t>(cost::kDefaultModes, std::llround(job.number("max_modes")));
    if (job.has_number("accuracy_cents")) size = {cost::refine(size.problem, cost::kRefinementGrowth), false};
  } catch (const InputError&) {
  }
  return size;
}

/// Serial part of a run that takes `one_s` on one rank and `two_s` on two.
double find_serial(double one_s, double two_s) { return std::clamp(2.0 * two_s - one_s, 0.0, one_s); }

/// False if there is no usable prediction.
bool read_prediction(const fs::path& folder, Need& need) {
  std::error_code error;
  if (!fs::exists(folder / attempt::kPredictionFile, error)) return false;
  try {
    base::Object root = base::read_document(folder / attempt::kPredictionFile).root();
    base::Object bytes = root.object("memory_bytes");
    std::vector<double> memory_gb;
    for (int ranks = 1; bytes.has(std::to_string(ranks)); ranks *= 2)
      memory_gb.push_back(cost::kAdmissionMargin * 1e-9 * bytes.number(std::to_string(ranks), base::kPositive));
    if (memory_gb.empty()) return false;
    need.predicted_gb = memory_gb;
    need.seconds = root.number_or("cpu_seconds", 0.0);
    need.serial_seconds = 0.0;
    if (root.has("wall_seconds"))
      need.serial_seconds = find_serial(need.seconds, root.object("wall_seconds").number_or("2", 0.5 * need.seconds));
    return true;
  } catch (const InputError&) {
    return false;
  }
}

/// More than the memory of an attempt that ran out of memory; else 0.
double find_least_gb(const fs::path& folder, const registry::Job& job) {
  const std::optional<outcome::Outcome> before = outcome::read_outcome(folder);
  if (!before || before->cause != outcome::Cause::memory) return 0.0;
  return std::max(job.given.memory_gb, outcome::calc_next_memory(before->memory_need_gb, before->peak_memory_gb));
}

}  // namespace

Need guess_need(const cost::ProblemSize& size) {
  Need need;
  for (int ranks = 1; ranks <= kMaxGuessedRanks; ranks *= 2)
    need.predicted_gb.push_back(1e-9 * cost::kAdmissionMargin * cost::predict_bytes(size, ranks));
  const cost::PhaseSeconds seconds = cost::predict_seconds(size);
  need.seconds = seconds.sum();
  need.serial_seconds = find_serial(need.seconds, cost::calc_wall(seconds, size, 2).sum());
  return need;
}

JobNeeds find_needs(const store::Store& store, const registry::Job& job) {
  JobNeeds needs;
  const fs::path folder = store.work_folder(job.id);
  std::optional<store::Request> request;
  try {
    request = store::read_request(folder);
  } catch (const InputError&) {
  }
  const Size size = request ? find_size(store, *request) : Size{};
  const bool is_simulation = needs.is_simulation = request && request->input_kind == store::InputKind::simulation;
  if (!is_simulation) needs.need = guess_need(size.problem);
  const bool has_prediction = read_prediction(folder, needs.need);
  needs.wants_prediction = !has_prediction && job.resources.memory_gb <= 0.0 &&
                           (!size.is_known || static_cast<double>(cost::complete(size.problem).nodes) > kLargeNodes);
  needs.need.min_gb = find_least_gb(folder, job);
  set_asked(needs, job);
  // A checkpoint can be resumed only on the same number of ranks.
  std::error_code error;
  if (is_simulation && needs.need.ranks == 0 && fs::exists(folder / store::kCheckpointFile, error))
    if (const auto before = outcome::read_attempt(folder)) needs.need.ranks = before->ranks;
  return needs;
}

void set_asked(JobNeeds& needs, const registry::Job& job) {
  needs.need.ranks = job.resources.ranks;
  needs.need.memory_gb = job.resources.memory_gb;
  needs.time_limit_s = job.resources.time_limit_s;
  if (job.resources.memory_gb > 0.0) needs.wants_prediction = false;
}

}  // namespace carillon::queue
