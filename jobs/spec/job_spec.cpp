#include "jobs/spec/job_spec.hpp"

#include <fmt/core.h>
#include <json/json.h>

#include <sstream>

namespace carillon::spec {
namespace {

namespace fs = std::filesystem;

// Far beyond every solid: what lies outside is a slip of the unit, and would only end in overflow later.
constexpr double kMostStiffnessPa = 1e16;
constexpr double kMostDensityKgM3 = 1e8;
constexpr double kLeast = 1e-6;
constexpr double kMostDampingS = 1e6, kMostDampingPerS = 1e12;
constexpr double kMostHz = 1e12;

double read_positive(config::Object& object, std::string_view key, double most) {
  const double value = object.number(key, config::kPositive);
  if (value < kLeast || value > most)
    object.fail(key, fmt::format("must be from {:g} to {:g} as no solid is outside, and is {:g}; check the unit", kLeast, most, value));
  return value;
}

/// The stiffness matrix loses as many digits as lambda / mu (or K / mu near nu = -1) has; seven are what a solve can spare.
void check_definite(config::Object& material, std::string_view key, double poisson_ratio) {
  constexpr double kMargin = 1e-7;
  if (poisson_ratio > 0.5 - kMargin || poisson_ratio < -1.0 + kMargin)
    material.fail(key,
                  fmt::format("makes a Poisson's ratio of {:.12g}, too near the limits -1 and 0.5 to be solved in double precision; keep "
                              "{:g} away from them",
                              poisson_ratio, kMargin));
}

/// E and nu, or lambda and mu: exactly one pair.  E = mu (3 lambda + 2 mu) / (lambda + mu), nu = lambda / (2 (lambda + mu)).
void read_elasticity(config::Object& material, Material& result) {
  const bool engineering = material.has("young_modulus_pa") || material.has("poisson_ratio");
  const bool lame = material.has("lame_lambda_pa") || material.has("lame_mu_pa");
  if (engineering && lame) {
    material.fail(material.has("lame_lambda_pa") ? "lame_lambda_pa" : "lame_mu_pa",
                  "give young_modulus_pa and poisson_ratio, or lame_lambda_pa and lame_mu_pa, not both pairs");
  }
  if (!lame) {
    result.young_modulus_pa = read_positive(material, "young_modulus_pa", kMostStiffnessPa);
    result.poisson_ratio = material.number("poisson_ratio", {-1.0, 0.5});
    check_definite(material, "poisson_ratio", result.poisson_ratio);
    return;
  }
  const double mu = read_positive(material, "lame_mu_pa", kMostStiffnessPa);
  const double lambda = material.number("lame_lambda_pa", {-kMostStiffnessPa, kMostStiffnessPa});
  // Positive definite: mu > 0 and 3 lambda + 2 mu > 0.
  if (!(3 * lambda + 2 * mu > 0))
    material.fail("lame_lambda_pa", fmt::format("must be greater than -2/3 of lame_mu_pa ({}), and is {}", -2 * mu / 3, lambda));
  result.young_modulus_pa = mu * (3 * lambda + 2 * mu) / (lambda + mu);
  result.poisson_ratio = lambda / (2 * (lambda + mu));
  check_definite(material, "lame_lambda_pa", result.poisson_ratio);
}

double read_not_negative(config::Object& object, std::string_view key, double most) {
  const double value = object.number_or(key, 0.0);
  if (value > most) object.fail(key, fmt::format("must be at most {:g}, and is {:g}; check the unit", most, value));
  if (value < 0) object.fail(key, fmt::format("must not be negative, and is {}", value));
  return value;
}

Material read_material(config::Object material) {
  Material result;
  read_elasticity(material, result);
  result.density_kg_m3 = read_positive(material, "density_kg_m3", kMostDensityKgM3);
  config::Object damping = material.object("damping");
  config::Object rayleigh = damping.object("rayleigh");
  result.alpha1_s = read_not_negative(rayleigh, "alpha1_s", kMostDampingS);
  result.alpha2_per_s = read_not_negative(rayleigh, "alpha2_per_s", kMostDampingPerS);
  rayleigh.finish();
  damping.finish();
  material.ignore("name");
  material.finish();
  return result;
}

Fixed read_fixed(config::Object fixed) {
  Fixed result;
  if (fixed.has("node_set")) result.node_set = fixed.string("node_set");
  if (auto box = fixed.object_if("box_m")) {
    result.box_m = {box->numbers<3>("min"), box->numbers<3>("max")};
    for (int axis = 0; axis < 3; ++axis) {
      if ((*result.box_m)[0][axis] > (*result.box_m)[1][axis])
        box->fail("max", "every coordinate of \"max\" must be at least that of \"min\"");
    }
    box->finish();
  }
  fixed.finish();
  if (result.node_set.has_value() == result.box_m.has_value()) {
    fixed.fail("", "\"fixed\" holds one of \"node_set\" (a name of the mesh) and \"box_m\" ({\"min\": [x, y, z], \"max\": [x, y, z]})");
  }
  return result;
}

/// The same name, or two names of one file that exists.
bool is_same_file(const fs::path& a, const fs::path& b) {
  std::error_code none;
  return fs::absolute(a).lexically_normal() == fs::absolute(b).lexically_normal() || fs::equivalent(a, b, none);
}

JobSpec read_root(config::Object job, const fs::path& file) {
  JobSpec spec;
  spec.file = file;
  spec.mesh = job.path("mesh");
  spec.bank = job.path("bank");
  spec.material = read_material(job.object("material"));
  spec.element = job.choice_or("element", {"T4", "T10"}, "T10") == "T4" ? Element::T4 : Element::T10;
  spec.mass = job.choice_or("mass", {"consistent", "lumped"}, "consistent") == "lumped" ? Mass::lumped : Mass::consistent;
  spec.band_hz = job.numbers_or<2>("band_hz", spec.band_hz);
  if (!(spec.band_hz[0] > 0 && spec.band_hz[1] > spec.band_hz[0])) {
    job.fail("band_hz", fmt::format("must be [low, high] with 0 < low < high in Hz, and is [{}, {}]", spec.band_hz[0], spec.band_hz[1]));
  }
  if (spec.band_hz[1] > kMostHz)
    job.fail("band_hz", fmt::format("must end at {:g} Hz at most, and ends at {:g}", kMostHz, spec.band_hz[1]));
  if (auto count = job.integer_if("max_modes", 1, 40000)) spec.max_modes = static_cast<int>(*count);
  if (job.has_string("fixed")) {
    spec.fixed = Fixed{job.string("fixed"), {}};  // short for {"node_set": name}
  } else if (auto fixed = job.object_if("fixed")) {
    spec.fixed = read_fixed(*fixed);
  }
  if (auto solver = job.object_if("solver")) {
    spec.tolerance = solver->number_or("tolerance", spec.tolerance, {1e-14, 1e-4});
    const std::string choice = solver->choice_or("factorisation", {"automatic", "mumps", "cholmod"}, "automatic");
    spec.factorisation = choice == "mumps" ? Factorisation::mumps : choice == "cholmod" ? Factorisation::cholmod : Factorisation::automatic;
    solver->finish();
  }
  job.ignore("run");
  job.finish();
  const fs::path resolved = find_resolved_path(spec.bank);
  if (is_same_file(spec.bank, spec.mesh) || is_same_file(resolved, spec.mesh)) {
    job.fail("bank", "the bank or its record would overwrite the mesh; choose another file");
  }
  if (is_same_file(spec.bank, file)) job.fail("bank", "the bank would overwrite this job file; choose another file");
  return spec;
}

Json::Value to_json(const std::array<double, 3>& v) {
  Json::Value list(Json::arrayValue);
  for (const double x : v) list.append(x);
  return list;
}

/// `path` relative to `folder` when both share a root below "/", else absolute.
std::string relative_to(const fs::path& path, const fs::path& folder) {
  const fs::path relative = path.lexically_relative(folder);
  return relative.empty() ? path.string() : relative.string();
}

}  // namespace

fs::path find_resolved_path(const fs::path& bank) { return fs::path(bank) += ".resolved.json"; }

JobSpec parse_job(std::string_view text, const fs::path& file) { return read_root(config::parse_document(text, file).root(), file); }

JobSpec read_job(const fs::path& file) { return read_root(config::read_document(file).root(), file); }

std::string resolved_json(const JobSpec& job, const fs::path& folder, const std::string& run_json) {
  const fs::path base = fs::absolute(folder).lexically_normal();
  Json::Value root;
  root["mesh"] = relative_to(job.mesh, base);
  root["bank"] = relative_to(job.bank, base);
  Json::Value& material = root["material"];
  material["young_modulus_pa"] = job.material.young_modulus_pa;
  material["poisson_ratio"] = job.material.poisson_ratio;
  material["density_kg_m3"] = job.material.density_kg_m3;
  material["damping"]["rayleigh"]["alpha1_s"] = job.material.alpha1_s;
  material["damping"]["rayleigh"]["alpha2_per_s"] = job.material.alpha2_per_s;
  root["element"] = job.element == Element::T4 ? "T4" : "T10";
  root["mass"] = job.mass == Mass::lumped ? "lumped" : "consistent";
  root["band_hz"].append(job.band_hz[0]);
  root["band_hz"].append(job.band_hz[1]);
  if (job.max_modes) root["max_modes"] = *job.max_modes;
  if (job.fixed && job.fixed->node_set) root["fixed"]["node_set"] = *job.fixed->node_set;
  if (job.fixed && job.fixed->box_m) {
    root["fixed"]["box_m"]["min"] = to_json((*job.fixed->box_m)[0]);
    root["fixed"]["box_m"]["max"] = to_json((*job.fixed->box_m)[1]);
  }
  root["solver"]["tolerance"] = job.tolerance;
  root["solver"]["factorisation"] = job.factorisation == Factorisation::mumps     ? "mumps"
                                    : job.factorisation == Factorisation::cholmod ? "cholmod"
                                                                                  : "automatic";
  if (!run_json.empty()) {
    std::istringstream stream(run_json);
    Json::CharReaderBuilder reader;
    std::string errors;
    if (!Json::parseFromStream(reader, stream, &root["run"], &errors))
      throw SolveError("internal: the record of the run is not JSON: " + errors);
  }
  Json::StreamWriterBuilder writer;
  writer["indentation"] = "  ";
  writer["precision"] = 17;
  return Json::writeString(writer, root) + "\n";
}

}  // namespace carillon::spec
