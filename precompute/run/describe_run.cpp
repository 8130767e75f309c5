#include <algorithm>

#include "precompute/run/stages.hpp"

namespace carillon::run {
namespace {

base::Json describe_mesh(const Body& body, const Setting& setting) {
  const mesh::DistributedMesh& pieces = body.pieces;
  const mesh::CheckReport& check = body.check;
  base::Json mesh;
  mesh.set("source", body.source).set("nodes", pieces.nodes).set("tets", pieces.tets).set("components", pieces.components);
  mesh.set("fixed_nodes", body.fixed_nodes).set("free_nodes", pieces.free_nodes).set("file_nodes", check.nodes);
  mesh.set("file_order", check.order).set("refinements", setting.refinements).set("reoriented", check.reoriented);
  mesh.set("unreferenced", check.unreferenced).set("welded", check.welded).set("curved", check.curved);
  mesh.set("straightened", check.straightened).set("min_dihedral_deg", check.min_dihedral_deg).set("mean_ratio_min", check.mean_ratio_min);
  mesh.set("warnings", base::Json::array(check.warnings));
  for (const std::string& warning : body.mesher_warnings) mesh["warnings"].append(warning);
  return mesh;
}

base::Json describe_partition(const mesh::PartitionReport& report) {
  base::Json partition;
  partition.set("edge_cut", report.edge_cut).set("element_balance", report.element_balance).set("node_balance", report.node_balance);
  partition.set("contiguous", report.contiguous);
  for (const auto& rank : report.ranks) {
    base::Json& entry = partition["ranks"].append();
    entry.set("elements", rank.elements).set("owned_nodes", rank.owned_nodes).set("halo_nodes", rank.halo_nodes);
  }
  return partition;
}

base::Json describe_solver(const eigen::Modes& modes) {
  base::Json solver;
  solver.set("factorisation", modes.factor.solver).set("ordering", modes.factor.ordering).set("factor_entries", modes.factor.entries);
  solver.set("factor_flops", modes.factor.flops).set("factorisations", modes.factor.factorisations).set("solves", modes.factor.solves);
  solver.set("modes", modes.lambda.size()).set("modes_in_band", modes.band_count).set("rigid_modes", modes.rigid_count);
  solver.set("mechanisms", modes.mechanism_count).set("orthonormality_error", modes.orthonormality_error);
  solver["above_tolerance"] = modes.above_tolerance_count;  // limited by rounding, see eigen::Modes::residual
  solver["proof"] = modes.proof.method;
  solver["seconds"].set("rigid", modes.seconds.rigid).set("analyse", modes.seconds.analyse).set("factor", modes.seconds.factor);
  solver["seconds"].set("iterate", modes.seconds.iterate).set("solve", modes.seconds.solve).set("check", modes.seconds.check);
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
    entry.set("messages", work.messages).set("bytes", work.bytes).set("collectives", work.collectives);
    entry.set("collective_bytes", work.collective_bytes);
  }
  return phases;
}

/// Seconds of all ranks together.
base::Json describe_effort(const petsc::WorkTable& table) {
  base::Json phases = base::Json::object();
  for (std::size_t i = 0; i < table.size(); ++i) {
    const petsc::Effort& effort = table[i].effort;
    base::Json& entry = phases[petsc::kWorkPhaseNames[i]];
    entry.set("cpu_seconds", effort.cpu_seconds).set("wall_seconds", effort.wall_seconds);
    if (petsc::is_profiled()) entry["mpi_seconds"] = effort.mpi_seconds;
  }
  return phases;
}

base::Json describe_damping(const material::Material& material) {
  base::Json damping;
  switch (material.law) {
    case material::DampingLaw::rayleigh:
      damping["rayleigh"].set("alpha1_s", material.alpha1_s).set("alpha2_per_s", material.alpha2_per_s);
      break;
    case material::DampingLaw::internal_friction:
      damping["internal_friction"]["tan_phi"] = material.tan_phi;
      break;
    case material::DampingLaw::caughey:
      for (const material::CaugheyTerm& term : material.caughey) {
        base::Json& entry = damping["caughey"].append();
        entry.set("power", term.power).set("coefficient", term.coefficient);
      }
      break;
    case material::DampingLaw::loss_table:
      for (const material::LossRow& row : material.loss_table) {
        base::Json& entry = damping["loss_table"].append();
        entry.set("freq_hz", row.freq_hz).set("loss_factor", row.loss_factor);
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
    entry.set("volume_m3", volume_m3[i]).set("density_kg_m3", material.density_kg_m3).set("young_modulus_pa", material.young_modulus_pa);
    entry.set("poisson_ratio", material.poisson_ratio);
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
  root.set("program", "carillon-precompute").set("git", git_id()).set("finished_utc", find_time_utc()).set("ranks", run.comm.size());
  for (const auto& [name, version] : find_versions()) root["versions"][name] = version;
  for (const RunPhase& phase : run.log.get_phases()) {
    base::Json& entry = root["stations"].append();
    entry.set("name", phase.name).set("seconds", phase.seconds).set("cpu_seconds", phase.cpu_seconds);
    entry.set("peak_bytes_largest_rank", phase.peak_bytes).set("peak_bytes_all_ranks", phase.peak_sum_bytes);
  }
  return root;
}

base::Json describe_run(const Run& run, const Solution& found, const Measured& measured) {
  const SolvedBody& solved = found.solved;
  base::Json root = describe_program(run);
  root.set("phase_seconds", describe_phases(run, solved.modes)).set("work", describe_work(measured.work));
  root.set("effort", describe_effort(measured.work));
  for (const std::int64_t bytes : measured.peak_bytes) root["peak_bytes_by_rank"].append(bytes);
  root["solver_options"] = base::Json::array(run.options.solver_options);
  root["chosen"].set("element", job::to_text(found.setting.element)).set("tolerance", found.setting.tolerance);
  root.set("mesh", describe_mesh(found.body, found.setting));
  root.set("materials", describe_materials(solved.properties.materials, solved.properties.volume_m3));
  root.set("partition", describe_partition(found.body.pieces.report)).set("solver", describe_solver(solved.modes));
  root.set("warnings", describe_warnings(run));
  return root;
}

}  // namespace carillon::run
