// Writes a job with all values used.

#include <optional>

#include "precompute/job/keys.hpp"
#include "precompute/job/read_body.hpp"
#include "runtime/base/json.hpp"

namespace carillon::job {
namespace {

using material::CaugheyTerm, material::DampingLaw, material::LossRow, material::Orthotropic;

namespace fs = std::filesystem;

/// `path` relative to `folder` if both share a root below "/", else absolute.
std::string relative_to(const fs::path& path, const fs::path& folder) {
  const fs::path relative = path.lexically_relative(folder);
  return relative.empty() ? path.string() : relative.string();
}

base::Json write_damping(const Material& material) {
  base::Json damping;
  switch (material.law) {
    case DampingLaw::rayleigh:
      damping["rayleigh"].set("alpha1_s", material.alpha1_s).set("alpha2_per_s", material.alpha2_per_s);
      break;
    case DampingLaw::internal_friction:
      damping["internal_friction"]["tan_phi"] = material.tan_phi;
      break;
    case DampingLaw::caughey:
      for (const CaugheyTerm& term : material.caughey) {
        damping["caughey"]["powers"].append(term.power);
        damping["caughey"]["coefficients"].append(term.coefficient);
      }
      break;
    case DampingLaw::loss_table:
      for (const LossRow& row : material.loss_table) {
        damping["loss_table"].add(base::Json::array(std::array{row.freq_hz, row.loss_factor}));
      }
      break;
  }
  return damping;
}

base::Json write_material(const Material& material) {
  base::Json root;
  if (!material.name.empty()) root["name"] = material.name;
  if (material.orthotropic) {
    const Orthotropic& o = *material.orthotropic;
    root["orthotropic"]["young_modulus_pa"] = base::Json::array(o.young_modulus_pa);
    root["orthotropic"]["shear_modulus_pa"] = base::Json::array(o.shear_modulus_pa);
    root["orthotropic"]["poisson_ratio"] = base::Json::array(o.poisson_ratio);
    root["orthotropic"]["axes"].append(base::Json::array(o.axes[0]));
    root["orthotropic"]["axes"].append(base::Json::array(o.axes[1]));
  } else {
    root.set("young_modulus_pa", material.young_modulus_pa).set("poisson_ratio", material.poisson_ratio);
  }
  root.set("density_kg_m3", material.density_kg_m3).set("damping", write_damping(material));
  return root;
}

base::Json write_body(const Body& body, const fs::path& base) {
  base::Json root;
  if (!body.shape.empty()) {
    root["shape"] = body.shape;
    for (const auto& [dimension, value] : body.dimensions) root[find_dimension_key(dimension)] = value;
  } else {
    root["surface"] = relative_to(body.surface, base);
    root = kSurfaceKeys.write(body, root);
    if (!body.facets) root.erase("facets");
  }
  if (body.nodes) root["nodes"] = *body.nodes;
  return kMeshSizeKeys.write(body, root);
}

/// Adds the members of a JSON object to `entry`.
void add_members(const base::Json& members, base::Json& entry) {
  const base::Json added = base::Json::parse(members.line()).value();  // numbers as they are read from a file
  for (const std::string& key : added.keys()) entry[key] = added[key];
}

base::Json write_fixed(const std::vector<Fixed>& list) {
  base::Json root = base::Json::array();
  for (const Fixed& fixed : list) {
    base::Json& entry = root.append(kFixedKeys.write(fixed));
    if (fixed.box_m) {
      entry["box_m"].set("min", base::Json::array((*fixed.box_m)[0])).set("max", base::Json::array((*fixed.box_m)[1]));
    }
    if (!fixed.name.empty()) entry["name"] = fixed.name;
    add_members(material::write_fixing(fixed.fixing), entry);
  }
  return root.size() == 1 ? root[0] : root;
}

base::Json write_air(const Air& air) {
  base::Json root = kAirKeys.write(air);
  if (air.half_space) {
    root["half_space"].set("point_m", base::Json::array(air.half_space->point_m)).set("normal", base::Json::array(air.half_space->normal));
  }
  return root;
}

base::Json write_nonlinear(const Nonlinear& nonlinear, bool has_energy_error) {
  base::Json root = kNonlinearKeys.write(nonlinear);
  if (!nonlinear.is_stretch) root.erase("form");
  if (!has_energy_error) root.erase("energy_error");
  return root;
}

/// Keys of bodies of finite elements.
void write_solve(const JobSpec& job, base::Json& root) {
  root["mass"] = to_text(job.mass);
  if (!job.fixed.empty()) root["fixed"] = write_fixed(job.fixed);
  root["solver"] = kSolverKeys.write(job);
  if (job.accuracy_cents) {
    root["accuracy_cents"] = *job.accuracy_cents;
    root["solver"].erase("tolerance");
  } else {
    root["element"] = to_text(job.element);
  }
  if (job.air.method != AirMethod::none) root["radiation"] = write_air(job.air);
}

}  // namespace

std::string resolved_json(const JobSpec& job, const fs::path& folder, const std::string& run_json) {
  const fs::path base = fs::absolute(folder).lexically_normal();
  base::Json root;
  if (job.analytic)
    add_members(write_analytic(*job.analytic, base), root["body"]);
  else if (job.body)
    root["body"] = write_body(*job.body, base);
  else
    root["mesh"] = relative_to(job.mesh, base);
  if (job.mesh_scale != 1.0) root["mesh_scale"] = job.mesh_scale;
  if (!job.bank.empty()) root["bank"] = relative_to(job.bank, base);
  root["shapes"] = to_text(job.shapes);
  if (job.sensitivities > 0) root["sensitivities"] = job.sensitivities;
  if (job.has_material) root["material"] = job.takes_file_material ? base::Json(kFileMaterial) : write_material(job.material);
  for (const auto& [region, material] : job.materials) root["materials"][region] = write_material(material);
  root["band_hz"] = base::Json::array(job.band_hz);
  if (job.max_modes) root["max_modes"] = *job.max_modes;
  if (!job.analytic) write_solve(job, root);
  if (job.nonlinear) root["nonlinear"] = write_nonlinear(*job.nonlinear, !job.analytic && !job.nonlinear->is_stretch);
  if (!run_json.empty()) {
    std::optional<base::Json> record = base::Json::parse(run_json);
    if (!record) throw SolveError("internal: the record of the run is not JSON");
    root["run"] = std::move(*record);
  }
  return root.sorted_text({.indentation = "  ", .breaks_arrays = true}) + "\n";
}

}  // namespace carillon::job
