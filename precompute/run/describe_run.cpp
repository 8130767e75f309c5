#include "precompute/run/describe_run.hpp"

#include <json/json.h>

#include <algorithm>
#include <numeric>

namespace carillon::run {
namespace {

template <class Values>
Json::Value make_list(const Values& values) {
  Json::Value list(Json::arrayValue);
  for (const auto& value : values) list.append(Json::Value(value));
  return list;
}

Json::Value describe_mesh(const Body& body, const Setting& setting) {
  const mesh::DistributedMesh& pieces = body.pieces;
  const mesh::CheckReport& check = body.check;
  Json::Value mesh;
  mesh["source"] = body.source;
  mesh["nodes"] = Json::Int64(pieces.nodes);
  mesh["tets"] = Json::Int64(pieces.tets);
  mesh["components"] = pieces.components;
  mesh["fixed_nodes"] = Json::Int64(body.fixed_nodes);
  mesh["free_nodes"] = Json::Int64(pieces.free_nodes);
  mesh["file_nodes"] = Json::Int64(check.nodes);
  mesh["file_order"] = check.order;
  mesh["refinements"] = setting.refinements;
  mesh["reoriented"] = Json::Int64(check.reoriented);
  mesh["unreferenced"] = Json::Int64(check.unreferenced);
  mesh["welded"] = Json::Int64(check.welded);
  mesh["curved"] = Json::Int64(check.curved);
  mesh["straightened"] = Json::Int64(check.straightened);
  mesh["min_dihedral_deg"] = check.min_dihedral_deg;
  mesh["mean_ratio_min"] = check.mean_ratio_min;
  mesh["warnings"] = make_list(check.warnings);
  for (const std::string& warning : body.mesher_warnings) mesh["warnings"].append(warning);
  return mesh;
}

Json::Value describe_partition(const mesh::PartitionReport& report) {
  Json::Value partition;
  partition["edge_cut"] = Json::Int64(report.edge_cut);
  partition["element_balance"] = report.element_balance;
  partition["node_balance"] = report.node_balance;
  partition["contiguous"] = report.contiguous;
  for (const auto& rank : report.ranks) {
    Json::Value& entry = partition["ranks"].append(Json::Value());
    entry["elements"] = Json::Int64(rank.elements);
    entry["owned_nodes"] = Json::Int64(rank.owned_nodes);
    entry["halo_nodes"] = Json::Int64(rank.halo_nodes);
  }
  return partition;
}

Json::Value describe_solver(const eigen::Modes& modes) {
  Json::Value solver;
  solver["factorisation"] = modes.factor.solver;
  solver["ordering"] = modes.factor.ordering;
  solver["factor_entries"] = Json::Int64(modes.factor.entries);
  solver["factor_flops"] = modes.factor.flops;
  solver["factorisations"] = Json::Int64(modes.factor.factorisations);
  solver["solves"] = Json::Int64(modes.factor.solves);
  solver["modes"] = Json::UInt64(modes.lambda.size());
  solver["modes_in_band"] = Json::Int64(modes.band_count);
  solver["rigid_modes"] = Json::Int64(modes.rigid_count);
  solver["mechanisms"] = Json::Int64(modes.mechanism_count);
  solver["orthonormality_error"] = modes.orthonormality_error;
  solver["above_tolerance"] = Json::Int64(modes.above_tolerance_count);  // limited by rounding, see eigen::Modes::residual
  solver["proof"] = modes.proof.method;
  solver["seconds"]["rigid"] = modes.seconds.rigid;
  solver["seconds"]["analyse"] = modes.seconds.analyse;
  solver["seconds"]["factor"] = modes.seconds.factor;
  solver["seconds"]["iterate"] = modes.seconds.iterate;
  solver["seconds"]["solve"] = modes.seconds.solve;
  solver["seconds"]["check"] = modes.seconds.check;
  return solver;
}

/// Wall clock of the slowest rank by phase: read, partition, assemble, factor, solve, orthogonalise, errors, write; "trials": everything
/// before the last body was read.
Json::Value describe_phases(const Run& run, const eigen::Modes& modes) {
  Json::Value sums(Json::objectValue);
  const auto add = [&](const std::string& name, double seconds) { sums[name] = sums.get(name, 0.0).asDouble() + seconds; };
  const std::vector<RunPhase>& phases = run.log.get_phases();
  const auto is_read = [](const RunPhase& phase) { return phase.name == "read"; };
  const auto last_read = std::find_if(phases.rbegin(), phases.rend(), is_read);
  const auto begin = last_read == phases.rend() ? phases.begin() : last_read.base() - 1;
  for (auto phase = phases.begin(); phase != begin; ++phase) add("trials", phase->seconds);
  const eigen::Seconds& s = modes.seconds;
  for (auto phase = begin; phase != phases.end(); ++phase) {
    if (phase->name == "modes") {
      add("factor", s.analyse + s.factor);
      add("solve", s.solve);
      add("orthogonalise", std::max(0.0, phase->seconds - s.analyse - s.factor - s.solve));
    } else {
      add(phase->name == "collect" ? "write" : phase->name, phase->seconds);
    }
  }
  return sums;
}

/// Operation counts of all ranks, independent of the machine's load; messages in profiled runs only. Phases as in describe_phases(),
/// including trials; "other": between phases.
Json::Value describe_work(const petsc::WorkTable& table) {
  Json::Value phases(Json::objectValue);
  for (std::size_t i = 0; i < table.size(); ++i) {
    const petsc::Work& work = table[i].work;
    Json::Value& entry = phases[petsc::kWorkPhaseNames[i]];
    entry["flops"] = work.flops;
    if (!petsc::is_profiled()) continue;
    entry["messages"] = work.messages;
    entry["bytes"] = work.bytes;
    entry["collectives"] = work.collectives;
    entry["collective_bytes"] = work.collective_bytes;
  }
  return phases;
}

/// Seconds of all ranks together.
Json::Value describe_effort(const petsc::WorkTable& table) {
  Json::Value phases(Json::objectValue);
  for (std::size_t i = 0; i < table.size(); ++i) {
    const petsc::Effort& effort = table[i].effort;
    Json::Value& entry = phases[petsc::kWorkPhaseNames[i]];
    entry["cpu_seconds"] = effort.cpu_seconds;
    entry["wall_seconds"] = effort.wall_seconds;
    if (petsc::is_profiled()) entry["mpi_seconds"] = effort.mpi_seconds;
  }
  return phases;
}

Json::Value describe_damping(const material::Material& material) {
  Json::Value damping;
  switch (material.law) {
    case material::DampingLaw::rayleigh:
      damping["rayleigh"]["alpha1_s"] = material.alpha1_s;
      damping["rayleigh"]["alpha2_per_s"] = material.alpha2_per_s;
      break;
    case material::DampingLaw::internal_friction:
      damping["internal_friction"]["tan_phi"] = material.tan_phi;
      break;
    case material::DampingLaw::caughey:
      for (const material::CaugheyTerm& term : material.caughey) {
        Json::Value& entry = damping["caughey"].append(Json::Value());
        entry["power"] = term.power;
        entry["coefficient"] = term.coefficient;
      }
      break;
    case material::DampingLaw::loss_table:
      for (const material::LossRow& row : material.loss_table) {
        Json::Value& entry = damping["loss_table"].append(Json::Value());
        entry["freq_hz"] = row.freq_hz;
        entry["loss_factor"] = row.loss_factor;
      }
      break;
  }
  return damping;
}

Json::Value describe_warnings(const Run& run) { return make_list(run.log.get_warnings()); }

}  // namespace

Json::Value describe_materials(const fem::Materials& materials, const std::vector<double>& volume_m3) {
  Json::Value list(Json::arrayValue);
  for (std::size_t i = 0; i < materials.list.size(); ++i) {
    const material::Material& material = materials.list[i];
    Json::Value& entry = list.append(Json::Value());
    entry["region"] = i < materials.region.size() ? materials.region[i] : "";
    if (!material.name.empty()) entry["name"] = material.name;
    entry["volume_m3"] = volume_m3[i];
    entry["density_kg_m3"] = material.density_kg_m3;
    entry["young_modulus_pa"] = material.young_modulus_pa;
    entry["poisson_ratio"] = material.poisson_ratio;
    if (material.orthotropic) {
      const material::Orthotropic& own = *material.orthotropic;
      Json::Value& orthotropic = entry["orthotropic"];
      orthotropic["young_modulus_pa"] = make_list(own.young_modulus_pa);
      orthotropic["shear_modulus_pa"] = make_list(own.shear_modulus_pa);
      orthotropic["poisson_ratio"] = make_list(own.poisson_ratio);
      for (const auto& axis : own.axes) orthotropic["axes"].append(make_list(axis));
    }
    entry["damping"] = describe_damping(material);
  }
  return list;
}

std::string write_json(const Json::Value& value) {
  Json::StreamWriterBuilder writer;
  writer["indentation"] = "";
  writer["precision"] = 17;
  return Json::writeString(writer, value);
}

Json::Value describe_program(const Run& run) {
  Json::Value root;
  root["program"] = "carillon-precompute";
  root["git"] = git_id();
  root["finished_utc"] = find_time_utc();
  root["ranks"] = run.comm.size();
  for (const auto& [name, version] : find_versions()) root["versions"][name] = version;
  for (const RunPhase& phase : run.log.get_phases()) {
    Json::Value& entry = root["stations"].append(Json::Value());
    entry["name"] = phase.name;
    entry["seconds"] = phase.seconds;
    entry["cpu_seconds"] = phase.cpu_seconds;
    entry["peak_bytes_largest_rank"] = Json::Int64(phase.peak_bytes);
    entry["peak_bytes_all_ranks"] = Json::Int64(phase.peak_sum_bytes);
  }
  return root;
}

Json::Value describe_run(const Run& run, const Solution& found, const Measured& measured) {
  const SolvedBody& solved = found.solved;
  Json::Value root = describe_program(run);
  root["phase_seconds"] = describe_phases(run, solved.modes);
  root["work"] = describe_work(measured.work);
  root["effort"] = describe_effort(measured.work);
  for (const std::int64_t bytes : measured.peak_bytes) root["peak_bytes_by_rank"].append(Json::Int64(bytes));
  root["solver_options"] = make_list(run.options.solver_options);
  root["chosen"]["element"] = job::to_text(found.setting.element);
  root["chosen"]["tolerance"] = found.setting.tolerance;
  root["mesh"] = describe_mesh(found.body, found.setting);
  root["materials"] = describe_materials(solved.properties.materials, solved.properties.volume_m3);
  root["partition"] = describe_partition(found.body.pieces.report);
  root["solver"] = describe_solver(solved.modes);
  root["warnings"] = describe_warnings(run);
  return root;
}

}  // namespace carillon::run
