// Writes a job with all values used.
#include <json/json.h>

#include <sstream>

#include "precompute/job/keys.hpp"
#include "precompute/job/read_body.hpp"

namespace carillon::job {
namespace {

using material::CaugheyTerm, material::DampingLaw, material::LossRow, material::Orthotropic;

namespace fs = std::filesystem;

Json::Value to_json(const std::array<double, 3>& v) {
  Json::Value list(Json::arrayValue);
  for (const double x : v) list.append(x);
  return list;
}

Json::Value to_json(const base::KeyValue& value) {
  return std::visit(
      [](const auto& held) {
        using Held = std::decay_t<decltype(held)>;
        if constexpr (std::is_same_v<Held, std::monostate>)
          return Json::Value();
        else if constexpr (std::is_same_v<Held, long long>)
          return Json::Value(Json::Int64(held));
        else if constexpr (std::is_same_v<Held, std::array<double, 3>>)
          return to_json(held);
        else
          return Json::Value(held);
      },
      value);
}

template <class T>
void write_keys(const base::Keys<T>& keys, const T& source, Json::Value& root) {
  for (const auto& [name, value] : keys.get(source)) root[name] = to_json(value);
}

/// `path` relative to `folder` when both share a root below "/", else absolute.
std::string relative_to(const fs::path& path, const fs::path& folder) {
  const fs::path relative = path.lexically_relative(folder);
  return relative.empty() ? path.string() : relative.string();
}

Json::Value write_damping(const Material& material) {
  Json::Value damping;
  switch (material.law) {
    case DampingLaw::rayleigh:
      damping["rayleigh"]["alpha1_s"] = material.alpha1_s;
      damping["rayleigh"]["alpha2_per_s"] = material.alpha2_per_s;
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
        Json::Value& pair = damping["loss_table"].append(Json::arrayValue);
        pair.append(row.freq_hz);
        pair.append(row.loss_factor);
      }
      break;
  }
  return damping;
}

Json::Value write_material(const Material& material) {
  Json::Value root;
  if (!material.name.empty()) root["name"] = material.name;
  if (material.orthotropic) {
    const Orthotropic& o = *material.orthotropic;
    root["orthotropic"]["young_modulus_pa"] = to_json(o.young_modulus_pa);
    root["orthotropic"]["shear_modulus_pa"] = to_json(o.shear_modulus_pa);
    root["orthotropic"]["poisson_ratio"] = to_json(o.poisson_ratio);
    root["orthotropic"]["axes"].append(to_json(o.axes[0]));
    root["orthotropic"]["axes"].append(to_json(o.axes[1]));
  } else {
    root["young_modulus_pa"] = material.young_modulus_pa;
    root["poisson_ratio"] = material.poisson_ratio;
  }
  root["density_kg_m3"] = material.density_kg_m3;
  root["damping"] = write_damping(material);
  return root;
}

Json::Value write_body(const Body& body, const fs::path& base) {
  Json::Value root;
  if (!body.shape.empty()) {
    root["shape"] = body.shape;
    for (const auto& [dimension, value] : body.dimensions) root[find_dimension_key(dimension)] = value;
  } else {
    root["surface"] = relative_to(body.surface, base);
    write_keys(kSurfaceKeys, body, root);
    if (!body.facets) root.removeMember("facets");
  }
  if (body.nodes) root["nodes"] = Json::Int64(*body.nodes);
  write_keys(kMeshSizeKeys, body, root);
  return root;
}

/// Adds the members of a JSON object to `entry`.
void add_members(const base::Json& members, Json::Value& entry) {
  Json::Value added;
  std::istringstream stream(members.line());
  std::string errors;
  if (!Json::parseFromStream(Json::CharReaderBuilder(), stream, &added, &errors)) throw SolveError("internal: not JSON: " + errors);
  for (const std::string& key : added.getMemberNames()) entry[key] = added[key];
}

Json::Value write_fixed(const std::vector<Fixed>& list) {
  Json::Value root(Json::arrayValue);
  for (const Fixed& fixed : list) {
    Json::Value& entry = root.append(Json::objectValue);
    write_keys(kFixedKeys, fixed, entry);
    if (fixed.box_m) {
      entry["box_m"]["min"] = to_json((*fixed.box_m)[0]);
      entry["box_m"]["max"] = to_json((*fixed.box_m)[1]);
    }
    if (!fixed.name.empty()) entry["name"] = fixed.name;
    add_members(material::write_fixing(fixed.fixing), entry);
  }
  return root.size() == 1 ? root[0] : root;
}

Json::Value write_air(const Air& air) {
  Json::Value root;
  write_keys(kAirKeys, air, root);
  if (air.half_space) {
    root["half_space"]["point_m"] = to_json(air.half_space->point_m);
    root["half_space"]["normal"] = to_json(air.half_space->normal);
  }
  return root;
}

Json::Value write_nonlinear(const Nonlinear& nonlinear, bool has_energy_error) {
  Json::Value root;
  write_keys(kNonlinearKeys, nonlinear, root);
  if (!nonlinear.is_stretch) root.removeMember("form");
  if (!has_energy_error) root.removeMember("energy_error");
  return root;
}

/// Keys of bodies of finite elements.
void write_solve(const JobSpec& job, Json::Value& root) {
  root["mass"] = to_text(job.mass);
  if (!job.fixed.empty()) root["fixed"] = write_fixed(job.fixed);
  write_keys(kSolverKeys, job, root["solver"]);
  if (job.accuracy_cents) {
    root["accuracy_cents"] = *job.accuracy_cents;
    root["solver"].removeMember("tolerance");
  } else {
    root["element"] = to_text(job.element);
  }
  if (job.air.method != AirMethod::none) root["radiation"] = write_air(job.air);
}

}  // namespace

std::string resolved_json(const JobSpec& job, const fs::path& folder, const std::string& run_json) {
  const fs::path base = fs::absolute(folder).lexically_normal();
  Json::Value root;
  if (job.analytic)
    add_members(write_analytic(*job.analytic, base), root["body"]);
  else if (job.body)
    root["body"] = write_body(*job.body, base);
  else
    root["mesh"] = relative_to(job.mesh, base);
  if (job.mesh_scale != 1.0) root["mesh_scale"] = job.mesh_scale;
  if (!job.bank.empty()) root["bank"] = relative_to(job.bank, base);
  if (job.has_material) root["material"] = write_material(job.material);
  for (const auto& [region, material] : job.materials) root["materials"][region] = write_material(material);
  root["band_hz"].append(job.band_hz[0]);
  root["band_hz"].append(job.band_hz[1]);
  if (job.max_modes) root["max_modes"] = *job.max_modes;
  if (!job.analytic) write_solve(job, root);
  if (job.nonlinear) root["nonlinear"] = write_nonlinear(*job.nonlinear, !job.analytic && !job.nonlinear->is_stretch);
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

}  // namespace carillon::job
