#include "precompute/job/job_spec.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "precompute/job/read_body.hpp"
#include "runtime/material/read_material.hpp"

namespace carillon::job {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxHz = 1e12;
constexpr std::size_t kMaxFixed = 1000, kMaxRegions = 10000;
constexpr std::size_t kLongestName = 200;  // bytes
constexpr double kMinScale = 1e-9, kMaxScale = 1e6;
constexpr long long kMinSkin = 100, kMaxSkin = 200'000;
constexpr double kMinAirDb = -80.0, kMaxAirDb = -20.0;
constexpr double kMinNormal = 1e-100, kMaxNormal = 1e100;
constexpr double kMinEnergyError = 1e-6, kMaxEnergyError = 0.1;
constexpr double kMinCents = 1e-3, kMaxCents = 1200;

/// The words of a schema and their meaning; a job may write `words` only.
template <class Choice>
struct Words {
  std::vector<std::pair<std::string, Choice>> list;

  std::vector<std::string> words() const {
    std::vector<std::string> names;
    for (const auto& [word, choice] : list) names.push_back(word);
    return names;
  }
  std::string find(Choice wanted) const {
    return std::find_if(list.begin(), list.end(), [&](const auto& entry) { return entry.second == wanted; })->first;
  }
  Choice read(base::Object& object, std::string_view key, Choice fallback) const {
    const std::string word = object.choice_or(key, words(), find(fallback));
    return std::find_if(list.begin(), list.end(), [&](const auto& entry) { return entry.first == word; })->second;
  }
};

const Words<Element> kElements{{{"T4", Element::T4}, {"T10", Element::T10}}};
const Words<Mass> kMasses{{{"consistent", Mass::consistent}, {"lumped", Mass::lumped}}};
const Words<Method> kMethods{{{"automatic", Method::automatic},
                              {"block-lanczos", Method::block_lanczos},
                              {"krylov-schur", Method::krylov_schur},
                              {"dense", Method::dense}}};
const Words<Factorisation> kFactorisations{
    {{"automatic", Factorisation::automatic}, {"ldlt", Factorisation::ldlt}, {"mumps", Factorisation::mumps}}};
const Words<AirMethod> kAirMethods{{{"none", AirMethod::none}, {"auto", AirMethod::automatic}, {"bem", AirMethod::bem}}};

Fixed read_fixed(base::Object fixed) {
  Fixed result;
  if (fixed.has("node_set")) result.node_set = fixed.string("node_set");
  if (auto box = fixed.object_if("box_m")) result.box_m = read_box(*box);
  if (fixed.has("name")) {
    result.name = fixed.string("name");
    if (result.name.size() > kLongestName ||
        std::any_of(result.name.begin(), result.name.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }))
      fixed.fail("name", fmt::format("is no name: at most {} bytes, and none of them a control character", kLongestName));
  }
  if (auto fixing = material::read_fixing(fixed)) result.fixing = *fixing;
  fixed.finish();
  if (result.node_set.has_value() == result.box_m.has_value()) {
    fixed.fail("", "\"fixed\" holds one of \"node_set\" (a name of the mesh) and \"box_m\" ({\"min\": [x, y, z], \"max\": [x, y, z]})");
  }
  return result;
}

/// A node set's name, an object, or a list of both.
std::vector<Fixed> read_all_fixed(base::Object& job) {
  std::vector<Fixed> list;
  for (base::Entry& entry : job.entries("fixed", kMaxFixed)) {
    Fixed& fixed = list.emplace_back(entry.object ? read_fixed(*entry.object) : Fixed{entry.text, {}, {}, {}, {}});
    fixed.place = entry.place;
  }
  return list;
}

void read_materials(base::Object& job, JobSpec& spec) {
  const std::string fallback = spec.analytic ? get_default_material(*spec.analytic) : "";
  const auto read = [&](base::Object& parent, const std::string& key) {
    return material::read_material(parent, key, spec.band_hz, spec.warnings, fallback);
  };
  if (auto materials = job.object_if("materials")) {
    if (materials->keys().empty() || materials->keys().size() > kMaxRegions)
      job.fail("materials",
               fmt::format("holds one material for each region of the mesh, by its tag or name: {{\"1\": {{...}}, \"2\": {{...}}}}; "
                           "give 1 to {}",
                           kMaxRegions));
    for (const std::string& region : materials->keys()) {
      if (region.empty()) materials->fail("", "a region's name is empty; give its tag or its name");
      spec.materials[region] = read(*materials, region);
    }
  }
  spec.has_material = spec.materials.empty() || job.has("material");
  spec.material = spec.has_material ? read(job, "material") : spec.materials.begin()->second;
}

void read_solver(base::Object& job, JobSpec& spec) {
  auto solver = job.object_if("solver");
  if (!solver) return;
  if (spec.accuracy_cents && solver->has("tolerance"))
    solver->fail("tolerance", "\"accuracy_cents\" chooses the tolerance; give one of the two");
  spec.tolerance = solver->number_or("tolerance", spec.tolerance, {1e-14, 1e-4});
  spec.method = kMethods.read(*solver, "method", spec.method);
  spec.factorisation = kFactorisations.read(*solver, "factorisation", spec.factorisation);
  solver->finish();
}

void read_air(base::Object& job, JobSpec& spec) {
  if (!job.has_object("radiation")) {
    spec.air.method = kAirMethods.read(job, "radiation", spec.air.method);
    return;
  }
  base::Object air = job.object("radiation");
  spec.air.method = kAirMethods.read(air, "method", AirMethod::bem);
  if (auto nodes = air.integer_if("skin_nodes", kMinSkin, kMaxSkin)) spec.air.skin_nodes = static_cast<int>(*nodes);
  spec.air.error_db = air.number_or("error_db", spec.air.error_db, {kMinAirDb, kMaxAirDb});
  if (auto half = air.object_if("half_space")) {
    spec.air.half_space = HalfSpace{half->numbers<3>("point_m"), half->numbers<3>("normal")};
    const auto& n = spec.air.half_space->normal;
    const double length = std::hypot(n[0], n[1], n[2]);
    if (!(length > kMinNormal && length < kMaxNormal))
      half->fail("normal", "must be a direction, [0, 0, 1] for a floor below the body, and is 0");
    half->finish();
  }
  air.finish();
}

/// Which bodies have what "nonlinear" asks for.
void check_stretch(base::Object& job, const JobSpec& spec) {
  const bool is_stretch = spec.nonlinear->is_stretch;
  if (!spec.analytic) {
    if (is_stretch && spec.fixed.empty())
      job.fail("nonlinear",
               "the stretch is that of a body whose edges are held, and this one is held nowhere: give \"fixed\", or couple its modes "
               "in full, {\"modes\": 30}");
    return;
  }
  const auto is_held = [](const auto& edges) {
    return std::all_of(edges.begin(), edges.end(), [](Edge edge) { return edge == Edge::hinged || edge == Edge::clamped; });
  };
  if (std::holds_alternative<MeasuredBody>(spec.analytic->kind))
    job.fail("nonlinear", "needs the equations of a body, and this one is a table of measured modes; remove it");
  const auto* beam = std::get_if<BeamBody>(&spec.analytic->kind);
  const auto* plate = std::get_if<PlateBody>(&spec.analytic->kind);
  const bool is_circle = plate != nullptr && plate->shape == "circle";
  if ((beam != nullptr && !is_held(beam->ends)) || (is_circle && !is_held(std::array{plate->edges[0]})) ||
      (plate != nullptr && !is_circle && !is_held(plate->edges)))
    job.fail("nonlinear", fmt::format("a {} with {} that are free or slide has no mean stretch: hold them all (\"hinged\" or \"clamped\"), "
                                      "or take finite elements (\"shape\") and {{\"modes\": 30}}",
                                      get_key(*spec.analytic), beam != nullptr ? "ends" : "edges"));
  const bool has_formula = plate != nullptr && !is_circle &&
                           std::all_of(plate->edges.begin(), plate->edges.end(), [](Edge edge) { return edge == Edge::hinged; });
  if (!is_stretch && !has_formula)
    job.fail("nonlinear", fmt::format("all coupling of a {} is no formula here, but for a rectangular plate hinged on all sides: ask for "
                                      "\"stretch\"{}",
                                      get_key(*spec.analytic), plate != nullptr ? ", or take finite elements (\"shape\")" : ""));
}

void read_nonlinear(base::Object& job, JobSpec& spec) {
  if (!job.has("nonlinear")) return;
  Nonlinear& found = spec.nonlinear.emplace();
  if (job.has_string("nonlinear")) {
    found.is_stretch = true;
    (void)job.choice("nonlinear", {"stretch"});
    check_stretch(job, spec);
    if (spec.max_modes) found.modes = std::min(found.modes, *spec.max_modes);
    return;
  }
  if (!job.has_object("nonlinear"))
    job.fail("nonlinear",
             "is \"stretch\", or an object: {\"modes\": 30, \"below_hz\": 3000, \"energy_error\": 1e-3}, each of which may be left out");
  base::Object nonlinear = job.object("nonlinear");
  found.is_stretch = nonlinear.choice_or("form", {"full", "stretch"}, "full") == "stretch";
  check_stretch(job, spec);
  if (nonlinear.has("energy_error") && (spec.analytic || found.is_stretch))
    nonlinear.fail("energy_error", found.is_stretch ? "is of all stress fields, and the stretch is a few of them; remove it"
                                                    : "is of energies by elements, and this one is a formula; remove it");
  const bool is_formula = spec.analytic && !found.is_stretch;
  if (auto modes = nonlinear.integer_if("modes", 1, is_formula ? kMaxPlateModes : kMaxCoupledModes)) found.modes = static_cast<int>(*modes);
  if (spec.max_modes && found.modes > *spec.max_modes) {
    if (nonlinear.has("modes"))
      nonlinear.fail(
          "modes", fmt::format("couples {} modes, and \"max_modes\" keeps {}; ask for fewer, or keep more", found.modes, *spec.max_modes));
    found.modes = *spec.max_modes;
  }
  found.below_hz = nonlinear.number_or("below_hz", found.below_hz, base::kPositive);
  if (found.below_hz <= spec.band_hz[0] || found.below_hz > kMaxHz)
    nonlinear.fail("below_hz",
                   fmt::format("is the highest frequency of a coupled mode, in Hz, above {:g} where \"band_hz\" begins, and is {:g}",
                               spec.band_hz[0], found.below_hz));
  found.energy_error = nonlinear.number_or("energy_error", found.energy_error, {kMinEnergyError, kMaxEnergyError});
  nonlinear.finish();
}

void read_geometry(base::Object& job, JobSpec& spec) {
  if (job.has("shape")) {
    for (const char* key : {"body", "mesh", "mesh_scale"})
      if (job.has(key)) job.fail(key, "\"shape\" is the body already; give one of them");
    spec.body = read_short_shape(job.object("shape"));
  } else if (job.has("body")) {
    if (job.has("mesh")) job.fail("body", "\"mesh\" names the body already; give one of \"mesh\" (a file) and \"body\"");
    if (job.has("mesh_scale"))
      job.fail("mesh_scale", "is for a \"mesh\" file; a surface has \"scale\" inside \"body\", and shapes are in metres");
    base::Object body = job.object("body");
    if (is_analytic(body))
      spec.analytic = read_analytic(body);
    else
      spec.body = read_body(body);
  } else {
    spec.mesh = job.path("mesh");
    spec.mesh_scale = job.number_or("mesh_scale", spec.mesh_scale, base::kPositive);
    if (spec.mesh_scale < kMinScale || spec.mesh_scale > kMaxScale)
      job.fail("mesh_scale", fmt::format("metres per unit of the mesh file, from {:g} to {:g} (0.001 for millimetres), and is {:g}",
                                         kMinScale, kMaxScale, spec.mesh_scale));
  }
  if (spec.analytic) {
    for (const char* key : {"accuracy_cents", "element", "mass", "solver", "fixed", "materials", "radiation"})
      if (job.has(key))
        job.fail(key, fmt::format("is for bodies of elements, but the modes of a \"{}\" are known; remove it", get_key(*spec.analytic)));
    return;
  }
  if (!spec.accuracy_cents) return;
  if (job.has("element")) job.fail("element", "\"accuracy_cents\" chooses the element; give one of the two");
  if (spec.body && (spec.body->nodes || spec.body->edge_m)) {
    base::Object body = job.has("shape") ? job.object("shape").object(spec.body->shape) : job.object("body");
    body.fail(spec.body->nodes ? "nodes" : "edge_m", "\"accuracy_cents\" chooses the mesh; give one of the two");
  }
}

/// The same name, or two names of one file that exists.
bool is_same_file(const fs::path& a, const fs::path& b) {
  std::error_code none;
  return fs::absolute(a).lexically_normal() == fs::absolute(b).lexically_normal() || fs::equivalent(a, b, none);
}

void check_outputs(base::Object& job, const JobSpec& spec) {
  if (spec.bank.empty()) return;
  const fs::path& input = get_input(spec);
  const fs::path resolved = find_resolved_path(spec.bank);
  if (!input.empty() && (is_same_file(spec.bank, input) || is_same_file(resolved, input))) {
    job.fail("bank", fmt::format("the bank or its record would overwrite the {}; choose another file", spec.analytic ? "table"
                                                                                                       : spec.body   ? "surface"
                                                                                                                     : "mesh"));
  }
  if (is_same_file(spec.bank, spec.file)) job.fail("bank", "the bank would overwrite this job file; choose another file");
}

JobSpec read_root(base::Object job, const fs::path& file, BankKey bank) {
  JobSpec spec;
  spec.file = file;
  if (job.has("accuracy_cents")) {
    spec.accuracy_cents = job.number("accuracy_cents", base::kPositive);
    if (*spec.accuracy_cents < kMinCents || *spec.accuracy_cents > kMaxCents)
      job.fail("accuracy_cents", fmt::format("must be from {:g} to {:g} cents, and is {:g}", kMinCents, kMaxCents, *spec.accuracy_cents));
  }
  read_geometry(job, spec);
  if (bank == BankKey::required || job.has("bank")) spec.bank = job.path("bank");
  spec.band_hz = job.numbers_or<2>("band_hz", spec.band_hz);
  if (!(spec.band_hz[0] > 0 && spec.band_hz[1] > spec.band_hz[0])) {
    job.fail("band_hz", fmt::format("must be [low, high] with 0 < low < high in Hz, and is [{}, {}]", spec.band_hz[0], spec.band_hz[1]));
  }
  if (spec.band_hz[1] > kMaxHz) job.fail("band_hz", fmt::format("must end at {:g} Hz at most, and ends at {:g}", kMaxHz, spec.band_hz[1]));
  read_materials(job, spec);
  spec.element = kElements.read(job, "element", spec.element);
  spec.mass = kMasses.read(job, "mass", spec.mass);
  if (auto count = job.integer_if("max_modes", 1, 40000)) spec.max_modes = static_cast<int>(*count);
  spec.fixed = read_all_fixed(job);
  read_solver(job, spec);
  read_air(job, spec);
  read_nonlinear(job, spec);
  spec.resources = read_resources(job);
  job.ignore("run");
  job.finish();
  check_outputs(job, spec);
  return spec;
}

}  // namespace

namespace {

template <class Job>
auto& find_input(Job& job) {
  if (job.body) return job.body->surface;
  auto* measured = job.analytic ? std::get_if<MeasuredBody>(&job.analytic->kind) : nullptr;
  return measured != nullptr ? measured->csv : job.mesh;
}

}  // namespace

const fs::path& get_input(const JobSpec& job) { return find_input(job); }

void set_input(JobSpec& job, const fs::path& file) { find_input(job) = file; }

fs::path find_opened(const fs::path& output, const fs::path& file, const fs::path& given) {
  return !given.has_parent_path() && output.parent_path() == file.parent_path() ? output.filename() : output;
}

fs::path find_resolved_path(const fs::path& bank) { return fs::path(bank) += ".resolved.json"; }

JobSpec parse_job(std::string_view text, const fs::path& file, BankKey bank, int first_line) {
  return read_root(base::parse_document(text, file, first_line).root(), file, bank);
}

JobSpec read_job(const fs::path& file, BankKey bank) { return read_root(base::read_document(file).root(), file, bank); }

std::string to_text(Element element) { return kElements.find(element); }
std::string to_text(Mass mass) { return kMasses.find(mass); }
std::string to_text(Method method) { return kMethods.find(method); }
std::string to_text(Factorisation factorisation) { return kFactorisations.find(factorisation); }
std::string to_text(AirMethod method) { return kAirMethods.find(method); }

}  // namespace carillon::job
