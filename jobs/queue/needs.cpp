// Method:     A text mesh takes about 250 bytes a node of four-node tetrahedra; ten-node ones have 7.5 times as many nodes. Nested
//             dissection of a compact body fills with n^(4/3) (George 1973). The constants are upper bounds for bars of 1,000 to 70,000
//             nodes; whatever is not small is predicted by carillon-precompute --validate instead.
// Source:     own measurements. Deviations: none.
#include "jobs/queue/needs.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "jobs/attempt/attempt.hpp"
#include "runtime/base/document.hpp"

namespace carillon::queue {
namespace {

namespace fs = std::filesystem;

constexpr double kBytesPerNode = 250.0, kMidNodes = 7.5, kLargeNodes = 30000.0, kUnknownNodes = 60000.0;
constexpr double kAccuracyGrowth = 4.0;  // accuracy_cents may refine the mesh
constexpr double kBaseGb = 0.15, kFillGb = 1.2e-6, kSecondsPerNode = 7e-4;
constexpr int kMostGuessedRanks = 1024;
constexpr double kPredictionMargin = 1.1;

/// Nodes as solved, and whether that is no more than a guess in the dark.
struct Size {
  double nodes = kUnknownNodes;
  bool is_known = false;
};

Size find_size(const store::Store& store, const store::Request& request) {
  Size size;
  try {
    base::Object job = base::parse_document(request.job, "request.json").root();
    if (std::optional<base::Object> body = job.object_if("body"); body && body->has_number("nodes")) size = {body->number("nodes"), true};
    std::error_code error;
    if (request.input_kind == "mesh") {
      const double bytes = static_cast<double>(
          fs::file_size(store.input_file(store::require_id(request.input_sha256, "request.json"), request.input_format), error));
      const bool is_linear = job.string_or("element", "T10") == "T4";
      if (!error) size = {bytes / kBytesPerNode * (is_linear ? 1.0 : kMidNodes), true};
    }
    if (job.has_number("accuracy_cents")) size = {kAccuracyGrowth * size.nodes, false};
  } catch (const InputError&) {
  }
  return size;
}

/// False when there is none that can be used.
bool read_prediction(const fs::path& folder, Need& need) {
  std::error_code error;
  if (!fs::exists(folder / attempt::kPredictionFile, error)) return false;
  try {
    base::Object root = base::read_document(folder / attempt::kPredictionFile).root();
    base::Object bytes = root.object("memory_bytes");
    std::vector<double> memory_gb;
    for (int ranks = 1; bytes.has(std::to_string(ranks)); ranks *= 2)
      memory_gb.push_back(kPredictionMargin * 1e-9 * bytes.number(std::to_string(ranks), base::kPositive));
    if (memory_gb.empty()) return false;
    need.predicted_gb = memory_gb;
    need.seconds = root.number_or("cpu_seconds", 0.0);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace

Need guess_need(double nodes) {
  Need need;
  for (int ranks = 1; ranks <= kMostGuessedRanks; ranks *= 2)
    need.predicted_gb.push_back(kBaseGb * ranks + kFillGb * std::pow(nodes, 4.0 / 3.0));
  need.seconds = kSecondsPerNode * nodes;
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
  needs.need = guess_need(size.nodes);
  const bool has_prediction = read_prediction(folder, needs.need);
  needs.wants_prediction = !has_prediction && job.resources.memory_gb <= 0.0 && (!size.is_known || size.nodes > kLargeNodes);
  set_asked(needs, job);
  return needs;
}

void set_asked(JobNeeds& needs, const registry::Job& job) {
  needs.need.ranks = job.resources.ranks;
  needs.need.memory_gb = job.resources.memory_gb;
  needs.time_limit_s = job.resources.time_limit_s;
  if (job.resources.memory_gb > 0.0) needs.wants_prediction = false;
}

}  // namespace carillon::queue
