#include "precompute/job/job_spec.hpp"

#include <fmt/core.h>

#include <algorithm>

#include "precompute/job/keys.hpp"
#include "precompute/job/read_body.hpp"
#include "runtime/base/ranges.hpp"
#include "runtime/material/read_material.hpp"

namespace carillon::job {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxFixed = 1000, kMaxRegions = 10000;
constexpr double kMinScale = 1e-9, kMaxScale = 1e6;
constexpr double kMinNormal = 1e-100, kMaxNormal = 1e100;

Fixed read_fixed(base::Object fixed) {
  Fixed result;
  kFixedKeys.read(fixed, result);
  if (auto box = fixed.object_if("box_m")) result.box_m = read_box(*box);
  if (fixed.has("name")) result.name = base::read_name(fixed, "name");
  if (auto fixing = material::read_fixing(fixed)) result.fixing = *fixing;
  fixed.finish();
  if (result.node_set.has_value() == result.box_m.has_value()) {
    fixed.fail("", "\"fixed\" holds one of \"node_set\" (a name of the mesh) and \"box_m\" ({\"min\": [x, y, z], \"max\": [x, y, z]})");
  }
  return result;
}

/// Node set names and objects, one or a list.
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
               fmt::format("must have one material for each region of the mesh, 1 to {}, by tag or name: {{\"1\": {{...}}, \"2\": "
                           "{{...}}}}",
                           kMaxRegions));
    for (const std::string& region : materials->keys()) {
      if (region.empty()) materials->fail("", "a region's name is empty; give its tag or its name");
      spec.materials[region] = read(*materials, region);
    }
  }
  if (job.has_string("material") && job.string("material") == kFileMaterial) {
    if (spec.mesh.empty())
      job.fail("material", "\"file\" is the material of a mesh file (.inp, .bdf), and this job has none; name a material");
    spec.takes_file_material = true;
    spec.material.place = job.find_place("material");
    return;
  }
  spec.has_material = spec.materials.empty() || job.has("material");
  spec.material = spec.has_material ? read(job, "material") : spec.materials.begin()->second;
}

void read_solver(base::Object& job, JobSpec& spec) {
  auto solver = job.object_if("solver");
  if (!solver) return;
  if (spec.accuracy_cents && solver->has("tolerance"))
    solver->fail("tolerance", "\"accuracy_cents\" chooses the tolerance; give one of the two");
  kSolverKeys.read(*solver, spec);
  solver->finish();
}

void read_air(base::Object& job, JobSpec& spec) {
  if (!job.has_object("radiation")) {
    if (job.has("radiation")) spec.air.method = static_cast<AirMethod>(base::read_word(job, "radiation", kAirNames));
    return;
  }
  base::Object air = job.object("radiation");
  spec.air.method = AirMethod::bem;
  kAirKeys.read(air, spec.air);
  if (auto half = air.object_if("half_space")) {
    spec.air.half_space = HalfSpace{half->numbers<3>("point_m"), half->numbers<3>("normal")};
    const double length = calc_length(spec.air.half_space->normal);
    if (!(length > kMinNormal && length < kMaxNormal))
      half->fail("normal", "must be a direction, [0, 0, 1] for a floor below the body, and is 0");
    half->finish();
  }
  air.finish();
}

/// Throws unless the body has the coupling requested by "nonlinear".
void check_stretch(base::Object& job, const JobSpec& spec) {
  const bool is_stretch = spec.nonlinear->is_stretch;
  if (!spec.analytic) {
    if (is_stretch && spec.fixed.empty())
      job.fail("nonlinear", "\"stretch\" needs fixed edges, and this body is free: give \"fixed\", or full coupling, {\"modes\": 30}");
    return;
  }
  const auto is_held = [](const auto& edges) {
    return std::all_of(edges.begin(), edges.end(), [](Edge edge) { return edge == Edge::hinged || edge == Edge::clamped; });
  };
  if (std::holds_alternative<MeasuredBody>(spec.analytic->kind))
    job.fail("nonlinear", "is not available for tables of measured modes; remove it");
  const auto* beam = std::get_if<BeamBody>(&spec.analytic->kind);
  const auto* plate = std::get_if<PlateBody>(&spec.analytic->kind);
  const bool is_circle = plate != nullptr && plate->shape == "circle";
  if ((beam != nullptr && !is_held(beam->ends)) || (is_circle && !is_held(std::array{plate->edges[0]})) ||
      (plate != nullptr && !is_circle && !is_held(plate->edges)))
    job.fail("nonlinear", fmt::format("a {} with free or sliding {} has no mean stretch: make them all \"hinged\" or \"clamped\", or use "
                                      "finite elements (\"shape\") and {{\"modes\": 30}}",
                                      get_key(*spec.analytic), beam != nullptr ? "ends" : "edges"));
  const bool has_formula = plate != nullptr && !is_circle &&
                           std::all_of(plate->edges.begin(), plate->edges.end(), [](Edge edge) { return edge == Edge::hinged; });
  if (!is_stretch && !has_formula)
    job.fail("nonlinear", fmt::format("a {} has a formula for full coupling only if it is a rectangular plate hinged on all sides: use "
                                      "\"stretch\"{}",
                                      get_key(*spec.analytic), plate != nullptr ? ", or finite elements (\"shape\")" : ""));
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
             "must be \"stretch\" or an object with the optional keys {\"modes\": 30, \"below_hz\": 3000, \"energy_error\": 1e-3}");
  base::Object nonlinear = job.object("nonlinear");
  kNonlinearKeys.read(nonlinear, found);
  check_stretch(job, spec);
  if (nonlinear.has("energy_error") && (spec.analytic || found.is_stretch))
    nonlinear.fail("energy_error", found.is_stretch ? "is for full coupling, not for \"stretch\"; remove it"
                                                    : "is for finite elements, and this body has a formula; remove it");
  if (spec.analytic && !found.is_stretch && found.modes > kMaxPlateModes)
    nonlinear.fail("modes", fmt::format("must be from 1 to {} for a plate, and is {}", kMaxPlateModes, found.modes));
  if (spec.max_modes && found.modes > *spec.max_modes) {
    if (nonlinear.has("modes"))
      nonlinear.fail(
          "modes", fmt::format("couples {} modes, and \"max_modes\" keeps {}; ask for fewer, or keep more", found.modes, *spec.max_modes));
    found.modes = *spec.max_modes;
  }
  if (found.below_hz <= spec.band_hz[0] || found.below_hz > kMaxHz)
    nonlinear.fail("below_hz", fmt::format("must be above {:g} Hz, where \"band_hz\" begins, and at most {:g} Hz, and is {:g}",
                                           spec.band_hz[0], kMaxHz, found.below_hz));
  nonlinear.finish();
}

void read_geometry(base::Object& job, JobSpec& spec) {
  if (job.has("shape")) {
    for (const char* key : {"body", "mesh", "mesh_scale"})
      if (job.has(key)) job.fail(key, "\"shape\" already gives the body; give one of them");
    spec.body = read_short_shape(job.object("shape"));
  } else if (job.has("body")) {
    if (job.has("mesh")) job.fail("body", "\"mesh\" already gives the body; give one of \"mesh\" (a file) and \"body\"");
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
        job.fail(key, fmt::format("is for finite elements, and the modes of a \"{}\" are known; remove it", get_key(*spec.analytic)));
    return;
  }
  if (!spec.accuracy_cents) return;
  if (job.has("element")) job.fail("element", "\"accuracy_cents\" chooses the element; give one of the two");
  if (spec.body && (spec.body->nodes || spec.body->edge_m)) {
    base::Object body = job.has("shape") ? job.object("shape").object(spec.body->shape) : job.object("body");
    body.fail(spec.body->nodes ? "nodes" : "edge_m", "\"accuracy_cents\" chooses the mesh; give one of the two");
  }
}

/// Equal paths, or two names of one existing file.
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
  kJobKeys.read(job, spec);
  read_geometry(job, spec);
  if (bank == BankKey::required || job.has("bank")) spec.bank = job.path("bank");
  spec.band_hz = job.numbers_or<2>("band_hz", spec.band_hz);
  if (!(spec.band_hz[0] > 0 && spec.band_hz[1] > spec.band_hz[0])) {
    job.fail("band_hz", fmt::format("must be [low, high] with 0 < low < high in Hz, and is [{}, {}]", spec.band_hz[0], spec.band_hz[1]));
  }
  if (spec.band_hz[1] > kMaxHz) job.fail("band_hz", fmt::format("must end at {:g} Hz at most, and ends at {:g}", kMaxHz, spec.band_hz[1]));
  read_materials(job, spec);
  spec.fixed = read_all_fixed(job);
  read_solver(job, spec);
  read_air(job, spec);
  read_nonlinear(job, spec);
  spec.resources = read_resources(job);
  if (spec.sensitivities > 0 && spec.analytic)
    job.fail("sensitivities", "are for finite elements, and this body has a formula or a table; give its shape or mesh, or remove it");
  if (spec.sensitivities > 0 && !spec.materials.empty())
    job.fail("sensitivities", "are for bodies of one material; remove \"materials\", or the sensitivities");
  job.ignore("run");
  job.finish();
  check_outputs(job, spec);
  return spec;
}

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

std::string to_text(Element element) { return kElementNames[static_cast<std::size_t>(element)]; }
std::string to_text(Mass mass) { return kMassNames[static_cast<std::size_t>(mass)]; }
std::string to_text(Shapes shapes) { return kShapesNames[static_cast<std::size_t>(shapes)]; }

}  // namespace carillon::job
