#include "precompute/run/describe_run.hpp"

#include <algorithm>

namespace carillon::run {
namespace {

base::Json describe_mesh(const Body& body, const Setting& setting) {
  const mesh::DistributedMesh& pieces = body.pieces;
  const mesh::CheckReport& check = body.check;
  base::Json mesh;
  mesh["source"] = body.source;
  mesh["nodes"] = pieces.nodes;
  mesh["tets"] = pieces.tets;
  mesh["components"] = pieces.components;
  mesh["fixed_nodes"] = body.fixed_nodes;
  mesh["free_nodes"] = pieces.free_nodes;
  mesh["file_nodes"] = check.nodes;
  mesh["file_order"] = check.order;
  mesh["refinements"] = setting.refinements;
  mesh["reoriented"] = check.reoriented;
  mesh["unreferenced"] = check.unreferenced;
  mesh["welded"] = check.welded;
  mesh["curved"] = check.curved;
  mesh["straightened"] = check.straightened;
  mesh["min_dihedral_deg"] = check.min_dihedral_deg;
  mesh["mean_ratio_min"] = check.mean_ratio_min;
  mesh["warnings"] = base::Json::array(check.warnings);
  for (const std::string& warning : body.mesher_warnings) mesh["warnings"].append(warning);
  return mesh;
}

base::Json describe_partition(const mesh::PartitionReport& report) {
  base::Json partition;
  partition["edge_cut"] = report.edge_cut;
  partition["element_balance"] = report.element_balance;
  partition["node_balance"] = report.node_balance;
  partition["contiguous"] = report.contiguous;
  for (const auto& rank : report.ranks) {
    base::Json& entry = partition["ranks"].append();
    entry["elements"] = rank.elements;
    entry["owned_nodes"] = rank.owned_nodes;
    entry["halo_nodes"] = rank.halo_nodes;
  }
  return partition;
}

base::Json describe_solver(const eigen::Modes& modes) {
  base::Json solver;
  solver["factorisation"] = modes.factor.solver;
  solver["ordering"] = modes.factor.ordering;
  solver["factor_entries"] = modes.factor.entries;
  solver["factor_flops"] = modes.factor.flops;
  solver["factorisations"] = modes.factor.factorisations;
  solver["solves"] = modes.factor.solves;
  solver["modes"] = modes.lambda.size();
  solver["modes_in_band"] = modes.band_count;
  solver["rigid_modes"] = modes.rigid_count;
  solver["mechanisms"] = modes.mechanism_count;
  solver["orthonormality_error"] = modes.orthonormality_error;
  solver["above_tolerance"] = modes.above_tolerance_count;  // limited by rounding, see eigen::Modes::residual
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
base::Json describe_phases(const Run& run, const eigen::Modes& modes) {
  base::Json sums = base::Json::object();
  const auto add = [&](const std::string& name, double seconds) { sums[name] = sums[name].as_double() + seconds; };
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
base::Json describe_work(const petsc::WorkTable& table) {
  base::Json phases = base::Json::object();
  for (std::size_t i = 0; i < table.size(); ++i) {
    const petsc::Work& work = table[i].work;
    base::Json& entry = phases[petsc::kWorkPhaseNames[i]];
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
base::Json describe_effort(const petsc::WorkTable& table) {
  base::Json phases = base::Json::object();
  for (std::size_t i = 0; i < table.size(); ++i) {
    const petsc::Effort& effort = table[i].effort;
    base::Json& entry = phases[petsc::kWorkPhaseNames[i]];
    entry["cpu_seconds"] = effort.cpu_seconds;
    entry["wall_seconds"] = effort.wall_seconds;
    if (petsc::is_profiled()) entry["mpi_seconds"] = effort.mpi_seconds;
  }
  return phases;
}

base::Json describe_damping(const material::Material& material) {
  base::Json damping;
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
        base::Json& entry = damping["caughey"].append();
        entry["power"] = term.power;
        entry["coefficient"] = term.coefficient;
      }
      break;
    case material::DampingLaw::loss_table:
      for (const material::LossRow& row : material.loss_table) {
        base::Json& entry = damping["loss_table"].append();
        entry["freq_hz"] = row.freq_hz;
        entry["loss_factor"] = row.loss_factor;
      }
      break;
  }
  return damping;
}

base::Json describe_warnings(const Run& run) { return base::Json::array(run.log.get_warnings()); }

}  // namespace

base::Json describe_materials(const fem::Materials& materials, const std::vector<double>& volume_m3) {
  base::Json list = base::Json::array();
  for (std::size_t i = 0; i < materials.list.size(); ++i) {
    const material::Material& material = materials.list[i];
    base::Json& entry = list.append();
    entry["region"] = i < materials.region.size() ? materials.region[i] : "";
    if (!material.name.empty()) entry["name"] = material.name;
    entry["volume_m3"] = volume_m3[i];
    entry["density_kg_m3"] = material.density_kg_m3;
    entry["young_modulus_pa"] = material.young_modulus_pa;
    entry["poisson_ratio"] = material.poisson_ratio;
    if (material.orthotropic) {
      const material::Orthotropic& own = *material.orthotropic;
      base::Json& orthotropic = entry["orthotropic"];
      orthotropic["young_modulus_pa"] = base::Json::array(own.young_modulus_pa);
      orthotropic["shear_modulus_pa"] = base::Json::array(own.shear_modulus_pa);
      orthotropic["poisson_ratio"] = base::Json::array(own.poisson_ratio);
      for (const auto& axis : own.axes) orthotropic["axes"].append(base::Json::array(axis));
    }
    entry["damping"] = describe_damping(material);
  }
  return list;
}

base::Json describe_program(const Run& run) {
  base::Json root;
  root["program"] = "carillon-precompute";
  root["git"] = git_id();
  root["finished_utc"] = find_time_utc();
  root["ranks"] = run.comm.size();
  for (const auto& [name, version] : find_versions()) root["versions"][name] = version;
  for (const RunPhase& phase : run.log.get_phases()) {
    base::Json& entry = root["stations"].append();
    entry["name"] = phase.name;
    entry["seconds"] = phase.seconds;
    entry["cpu_seconds"] = phase.cpu_seconds;
    entry["peak_bytes_largest_rank"] = phase.peak_bytes;
    entry["peak_bytes_all_ranks"] = phase.peak_sum_bytes;
  }
  return root;
}

base::Json describe_run(const Run& run, const Solution& found, const Measured& measured) {
  const SolvedBody& solved = found.solved;
  base::Json root = describe_program(run);
  root["phase_seconds"] = describe_phases(run, solved.modes);
  root["work"] = describe_work(measured.work);
  root["effort"] = describe_effort(measured.work);
  for (const std::int64_t bytes : measured.peak_bytes) root["peak_bytes_by_rank"].append(bytes);
  root["solver_options"] = base::Json::array(run.options.solver_options);
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
