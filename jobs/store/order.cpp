// Method:     A simulation is kept as JSON, not as a struct, so that new keys of its schema become part of the id without code here.
#include "jobs/store/order.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "jobs/store/store.hpp"
#include "precompute/job/simulation.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/sha256.hpp"
#include "runtime/material/read_material.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

constexpr std::array<double, 2> kHearingHz{20.0, 20000.0};

base::Json parse_job_json(const std::string& text) {
  auto root = base::Json::parse(text);
  if (!root) throw InputError("the job is not JSON");
  return std::move(*root);
}

/// Same representation for 1 and 1.0, and for 0 and -0.
void unify_numbers(base::Json& value) {
  constexpr double kMaxWhole = 1e15;
  if (value.is_number()) {
    const double x = value.as_double();
    value = x == std::trunc(x) && std::abs(x) < kMaxWhole ? base::Json(static_cast<std::int64_t>(x)) : base::Json(x);
  }
  if (value.is_array() || value.is_object())
    for (base::Json& member : value) unify_numbers(member);
}

/// Values of a simulation job that name files of bodies, in order.
std::vector<base::Json*> find_input_values(base::Json& root) {
  std::vector<base::Json*> found;
  base::Json& bodies = root["simulate"]["bodies"];
  if (!bodies.is_array()) return found;
  for (base::Json& body : bodies) {
    if (!body.is_object()) continue;
    if (body.has("mesh")) found.push_back(&body["mesh"]);
    if (body.has("body") && body["body"].is_object() && body["body"].has("surface")) found.push_back(&body["body"]["surface"]);
  }
  return found;
}

/// A material with all its constants, as in a resolved job: the table of materials may change.
base::Json write_material(const material::Material& material) {
  job::JobSpec spec;
  spec.mesh = "/mesh";
  spec.material = material;
  return parse_job_json(job::resolved_json(spec, "/", ""))["material"];
}

static_assert(std::size(kOutputs) == std::size(job::kSimulationOutputs), "the store keeps every file that a simulation writes");

SimulationOrder make_simulation(const job::SimulationSpec& spec, const std::string& text) {
  SimulationOrder order;
  order.file = spec.file;
  order.resources = spec.resources;
  order.warnings = spec.warnings;
  base::Json root = parse_job_json(text);
  const base::Document document = base::parse_document(text, spec.file);
  std::vector<base::Object> bodies = document.root().object("simulate").objects("bodies");
  std::vector<std::string> known;
  for (std::size_t i = 0; i < spec.bodies.size(); ++i) {
    const job::SimulatedBody& body = spec.bodies[i];
    base::Json& json = root["simulate"]["bodies"][i];
    json["material"] = write_material(material::read_material(bodies[i], "material", kHearingHz, known));
    if (!body.mesh.empty()) order.inputs.push_back({InputKind::mesh, body.mesh});
    if (body.body && !body.body->surface.empty()) order.inputs.push_back({InputKind::surface, body.body->surface});
  }
  root.erase("resources");
  job::check_has_output(spec, spec.file.string());
  for (const Output& output : kOutputs)
    if (root.has(output.key)) root[output.key] = output.file;
  root["record"] = kRecordFile;
  std::vector<fs::path> files;
  for (const NamedInput& input : order.inputs) files.push_back(input.file);
  order.text = write_simulation(root, files);
  return order;
}

}  // namespace

std::vector<NamedInput> JobOrder::list_inputs() const {
  if (simulation_) return simulation_->inputs;
  const fs::path& input = job::get_input(bank_);
  if (input.empty()) return {};
  return {{bank_.analytic ? InputKind::table : bank_.body ? InputKind::surface : InputKind::mesh, input}};
}

std::string JobOrder::write(const fs::path& folder, const std::vector<fs::path>& inputs) const {
  if (simulation_) return write_simulation(parse_job_json(make_canonical(inputs)), inputs);
  job::JobSpec inner = bank_;
  if (!inputs.empty()) job::set_input(inner, inputs[0]);
  inner.bank = folder / kBankFile;
  return job::resolved_json(inner, folder, "");
}

std::string JobOrder::make_canonical(const std::vector<fs::path>& inputs) const {
  return make_canonical_simulation(parse_job_json(write_simulation(parse_job_json(simulation_->text), inputs)));
}

JobOrder read_order(const fs::path& file) {
  std::string text;
  try {
    text = base::read_file(file, "job file", kMaxJobBytes);
  } catch (const InputError&) {  // read_job() reports it
  }
  if (!job::is_simulation(text)) return {job::read_job(file, job::BankKey::optional)};
  return parse_order(text, fs::absolute(file).lexically_normal());
}

JobOrder parse_order(std::string_view text, const fs::path& file, int first_line) {
  if (!job::is_simulation(text)) return {job::parse_job(text, file, job::BankKey::optional, first_line)};
  // Empty lines keep the line numbers of messages.
  const std::string moved = std::string(first_line - 1, '\n') + std::string(text);
  return JobOrder(make_simulation(job::parse_simulation(moved, file), moved));
}

std::vector<std::string> list_outputs(const std::string& job) {
  const base::Json root = parse_job_json(job);
  std::vector<std::string> files;
  for (const Output& output : kOutputs)
    if (root.has(output.key)) files.emplace_back(output.file);
  return files;
}

std::string make_canonical_simulation(base::Json root) {
  for (base::Json* value : find_input_values(root)) *value = fs::path(value->as_string()).filename().string();
  unify_numbers(root);
  return root.sorted_text({.is_ascii = false});
}

std::string write_simulation(base::Json root, const std::vector<fs::path>& inputs) {
  const std::vector<base::Json*> values = find_input_values(root);
  if (values.size() != inputs.size())
    throw InputError(fmt::format("the job names {} files of bodies instead of {}", values.size(), inputs.size()));
  for (std::size_t i = 0; i < inputs.size(); ++i) *values[i] = inputs[i].string();
  return root.sorted_text({.indentation = "  ", .is_ascii = false}) + "\n";
}

std::optional<std::string> find_record_fault(const std::string& record, const std::string& job_text) {
  const auto root = base::Json::parse(record);
  if (!root || !root->is_object()) return "its record is not JSON";
  if (!(*root)["job_sha256"].is_string()) return "its record does not name its job";
  return (*root)["job_sha256"].as_string() == base::to_hex(base::calc_sha256(job_text))
             ? std::nullopt
             : std::optional("its record belongs to another job");
}

}  // namespace carillon::store
