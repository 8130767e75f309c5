#include "precompute/io/run_job.hpp"

#include <fmt/core.h>
#include <json/json.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>

#include "jobs/spec/job_spec.hpp"
#include "precompute/eigen/solve_modes.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/fem/distribute.hpp"
#include "precompute/io/gather.hpp"
#include "precompute/io/radiation.hpp"
#include "precompute/io/run_record.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/config/file.hpp"

namespace carillon::io {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxJobBytes = 16 << 20;

/// Everything that rank 0 knows of the mesh after it was sent away.
struct MeshFacts {
  mesh::CheckReport check;
  std::int64_t held_nodes = 0;
  std::vector<Vec3> vertices_m;     // of the surface, in the order of the mesh
  std::vector<Triangle> triangles;  // of vertices
  std::vector<std::int32_t> row;    // of each vertex, -1: held
};

/// One run as it grows.
struct Run {
  MPI_Comm comm = MPI_COMM_NULL;
  int rank = 0;
  int ranks = 1;
  bool quiet = false;
  spec::JobSpec job;
  Stations stations;
};

void warn(int rank, const std::string& text) {
  if (rank != 0) return;
  std::fflush(stdout);
  fmt::print(stderr, "carillon-precompute: warning: {}\n", text);
}

/// Rank 0 reads the text; all ranks parse it, so that all fail alike.
spec::JobSpec read_shared_job(MPI_Comm comm, int rank, const fs::path& file) {
  std::string text;
  petsc::run_agreed(comm, [&] {
    if (rank == 0) text = config::read_file(file, "job file", kMaxJobBytes);
  });
  auto size = static_cast<std::int64_t>(text.size());
  MPI_Bcast(&size, 1, MPI_INT64_T, 0, comm);
  text.resize(size);
  MPI_Bcast(text.data(), static_cast<int>(size), MPI_CHAR, 0, comm);
  spec::JobSpec job;
  petsc::run_agreed(comm, [&] { job = spec::parse_job(text, fs::absolute(file)); });
  return job;
}

void check_outputs(const Run& run) {
  petsc::run_agreed(run.comm, [&] {
    if (run.rank != 0) return;
    config::check_writable(run.job.bank, "bank");
    config::check_writable(spec::find_resolved_path(run.job.bank), "resolved job");
  });
}

/// The union of what the job holds, ascending.
std::vector<std::int32_t> find_held_nodes(const mesh::TetMesh& mesh, const spec::JobSpec& job) {
  std::vector<std::int32_t> held;
  for (const spec::Fixed& fixed : job.fixed) {
    try {
      const auto nodes = fixed.node_set ? mesh::find_fixed_nodes(mesh, *fixed.node_set)
                                        : mesh::find_fixed_nodes(mesh, (*fixed.box_m)[0], (*fixed.box_m)[1]);
      held.insert(held.end(), nodes.begin(), nodes.end());
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: \"fixed\": {}", fixed.place, error.what()));
    }
  }
  std::sort(held.begin(), held.end());
  held.erase(std::unique(held.begin(), held.end()), held.end());
  return held;
}

/// Runs a collective step whose errors cannot know the mesh, and names it in them. All ranks throw alike, so no agreement is needed.
template <class Step>
auto name_mesh(const Run& run, Step&& step) {
  try {
    return step();
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", run.job.mesh.string(), error.what()));
  } catch (const SolveError& error) {
    throw SolveError(fmt::format("{} (job {}): {}", run.job.mesh.string(), run.job.file.string(), error.what()));
  }
}

/// Reads, checks and raises or lowers the mesh to the element's order. Rank 0 only.
mesh::TetMesh read_checked_mesh(const Run& run, MeshFacts& facts) {
  mesh::TetMesh mesh = mesh::read_mesh(run.job.mesh);
  facts.check = mesh::check_mesh(mesh, run.job.mesh.string());
  for (const std::string& line : facts.check.warnings) warn(run.rank, line);
  const bool quadratic = run.job.element == spec::Element::T10;
  if (quadratic && mesh.order == 1) mesh = mesh::to_quadratic(mesh);
  if (!quadratic && mesh.order == 2) mesh = mesh::to_linear(mesh);
  mesh::Surface surface = mesh::extract_boundary(mesh);
  facts.vertices_m.reserve(surface.nodes.size());
  for (const std::int32_t node : surface.nodes) facts.vertices_m.push_back(mesh.nodes[node]);
  facts.triangles = std::move(surface.triangles);
  facts.row = std::move(surface.nodes);  // nodes here; distribute_mesh() turns them into rows
  return mesh;
}

fem::Distribution distribute_mesh(Run& run, MeshFacts& facts) {
  mesh::TetMesh mesh;
  std::vector<std::int32_t> held;
  run.stations.begin("mesh", run.job.mesh.string());
  petsc::run_agreed(run.comm, [&] {
    if (run.rank != 0) return;
    mesh = read_checked_mesh(run, facts);
    held = find_held_nodes(mesh, run.job);
    facts.held_nodes = static_cast<std::int64_t>(held.size());
    run.stations.say(fmt::format("{} nodes, {} tetrahedra, {} component{}, {} nodes held", mesh.nodes.size(), mesh.tet_count(),
                                 facts.check.components, facts.check.components == 1 ? "" : "s", held.size()));
  });
  run.stations.end();

  run.stations.begin("partition", "METIS k-way on the dual graph");
  fem::Distribution pieces = name_mesh(run, [&] { return fem::distribute(run.comm, mesh, held, {.elimination_order = true}); });
  for (std::int32_t& row : facts.row) row = pieces.row_of_node[row];
  pieces.row_of_node = {};
  std::string report = fem::describe(pieces.report);
  while (!report.empty()) {
    const auto end = report.find('\n');
    run.stations.say(report.substr(0, end));
    report.erase(0, end == std::string::npos ? end : end + 1);
  }
  run.stations.end();
  return pieces;
}

eigen::NodeLayout make_layout(fem::Distribution& pieces) {
  eigen::NodeLayout layout;
  const auto free_nodes = pieces.local.free_nodes;
  layout.position.assign(pieces.local.nodes_m.begin(), pieces.local.nodes_m.begin() + free_nodes);
  layout.component.assign(pieces.local.component.begin(), pieces.local.component.begin() + free_nodes);
  layout.component_count = pieces.components;
  layout.held = pieces.held_m;
  layout.elimination_position = std::move(pieces.elimination_position);
  return layout;
}

/// A line whenever the phase changes or another tenth of the modes is done.
class ProgressLines {
 public:
  explicit ProgressLines(const Stations& stations) : stations_(stations) {}
  void operator()(const eigen::Progress& progress) {
    const std::int64_t tenth = progress.modes_wanted > 0 ? 10 * progress.modes_done / progress.modes_wanted : 0;
    if (progress.phase == phase_ && tenth == tenth_) return;
    phase_ = progress.phase;
    tenth_ = tenth;
    switch (progress.phase) {
      case eigen::Phase::kRigid:
        return stations_.say("rigid motions in closed form");
      case eigen::Phase::kAnalyse:
        return stations_.say("elimination order");
      case eigen::Phase::kCount:
        return stations_.say("counting the modes of the band");
      case eigen::Phase::kFactor:
        return stations_.say("factorising K - sigma M");
      case eigen::Phase::kIterate:
        return stations_.say(fmt::format("{} of {} modes", std::min(progress.modes_done, progress.modes_wanted), progress.modes_wanted));
      case eigen::Phase::kCheck:
        return stations_.say("residuals and orthogonality");
    }
  }

 private:
  const Stations& stations_;
  std::optional<eigen::Phase> phase_;
  std::int64_t tenth_ = 0;
};

eigen::Modes solve(Run& run, const fem::System& system, eigen::NodeLayout layout) {
  eigen::Options options;
  options.low_hz = run.job.band_hz[0];
  options.high_hz = run.job.band_hz[1];
  if (run.job.max_modes) options.max_modes = *run.job.max_modes;
  options.tolerance = run.job.tolerance;
  options.factorisation = run.job.factorisation == spec::Factorisation::mumps     ? eigen::Factorisation::kMumps
                          : run.job.factorisation == spec::Factorisation::cholmod ? eigen::Factorisation::kCholmod
                                                                                  : eigen::Factorisation::kAutomatic;
  ProgressLines lines(run.stations);
  options.progress = [&lines](const eigen::Progress& progress) { lines(progress); };
  run.stations.begin("modes", fmt::format("{:g} Hz to {:g} Hz", options.low_hz, options.high_hz));
  eigen::Modes modes = eigen::solve_modes({system.stiffness, system.mass, std::move(layout)}, options);
  const double worst = modes.residual.empty() ? 0.0 : *std::max_element(modes.residual.begin(), modes.residual.end());
  run.stations.say(fmt::format("{} modes, {} rigid ones deflated, worst residual {:.1e}, {}", modes.lambda.size(), modes.rigid_count, worst,
                               modes.factor.solver));
  run.stations.end();
  if (modes.mechanism_count > 0)
    warn(run.rank, fmt::format("the body has {} motions without stiffness besides the rigid ones (parts that hang on a point or an edge)",
                               modes.mechanism_count));
  if (modes.lambda.empty()) warn(run.rank, "no mode lies in the band: the bank will be silent");
  return modes;
}

Json::Value describe_run(const Run& run, const MeshFacts& facts, const fem::Distribution& pieces, const eigen::Modes& modes) {
  Json::Value root;
  root["program"] = "carillon-precompute";
  root["git"] = git_id();
  root["finished_utc"] = find_time_utc();
  root["ranks"] = run.ranks;
  for (const auto& [name, version] : find_versions()) root["versions"][name] = version;
  for (const Station& station : run.stations.get_all()) {
    Json::Value& entry = root["stations"].append(Json::Value());
    entry["name"] = station.name;
    entry["seconds"] = station.seconds;
    entry["peak_bytes_largest_rank"] = Json::Int64(station.peak_bytes);
    entry["peak_bytes_all_ranks"] = Json::Int64(station.peak_sum_bytes);
  }
  Json::Value& mesh = root["mesh"];
  mesh["nodes"] = Json::Int64(pieces.nodes);
  mesh["tets"] = Json::Int64(pieces.tets);
  mesh["components"] = pieces.components;
  mesh["held_nodes"] = Json::Int64(facts.held_nodes);
  mesh["free_nodes"] = Json::Int64(pieces.free_nodes);
  mesh["file_nodes"] = Json::Int64(facts.check.nodes);
  mesh["file_order"] = facts.check.order;
  mesh["reoriented"] = Json::Int64(facts.check.reoriented);
  mesh["unreferenced"] = Json::Int64(facts.check.unreferenced);
  mesh["welded"] = Json::Int64(facts.check.welded);
  mesh["straightened"] = Json::Int64(facts.check.straightened);
  mesh["min_dihedral_deg"] = facts.check.min_dihedral_deg;
  mesh["mean_ratio_min"] = facts.check.mean_ratio_min;
  mesh["warnings"] = Json::arrayValue;
  for (const std::string& line : facts.check.warnings) mesh["warnings"].append(line);
  Json::Value& partition = root["partition"];
  partition["edge_cut"] = Json::Int64(pieces.report.edge_cut);
  partition["element_balance"] = pieces.report.element_balance;
  partition["node_balance"] = pieces.report.node_balance;
  partition["contiguous"] = pieces.report.contiguous;
  for (const auto& rank : pieces.report.ranks) {
    Json::Value& entry = partition["ranks"].append(Json::Value());
    entry["elements"] = Json::Int64(rank.elements);
    entry["owned_nodes"] = Json::Int64(rank.owned_nodes);
    entry["halo_nodes"] = Json::Int64(rank.halo_nodes);
  }
  Json::Value& solver = root["solver"];
  solver["factorisation"] = modes.factor.solver;
  solver["ordering"] = modes.factor.ordering;
  solver["factor_entries"] = Json::Int64(modes.factor.entries);
  solver["factorisations"] = Json::Int64(modes.factor.factorisations);
  solver["solves"] = Json::Int64(modes.factor.solves);
  solver["modes"] = Json::UInt64(modes.lambda.size());
  solver["modes_in_band"] = Json::Int64(modes.band_count);
  solver["rigid_modes"] = Json::Int64(modes.rigid_count);
  solver["mechanisms"] = Json::Int64(modes.mechanism_count);
  solver["orthonormality_error"] = modes.orthonormality_error;
  solver["above_tolerance"] = Json::Int64(modes.above_tolerance_count);  // rounding allows no better, see eigen::Modes::residual
  solver["seconds"]["rigid"] = modes.seconds.rigid;
  solver["seconds"]["analyse"] = modes.seconds.analyse;
  solver["seconds"]["factor"] = modes.seconds.factor;
  solver["seconds"]["iterate"] = modes.seconds.iterate;
  solver["seconds"]["solve"] = modes.seconds.solve;
  solver["seconds"]["check"] = modes.seconds.check;
  return root;
}

/// The bank without its provenance. Rank 0 only.
bank::Bank make_bank(const Run& run, MeshFacts& facts, const fem::Distribution& pieces, const fem::RigidBody& body,
                     const eigen::Modes& modes, const std::vector<double>& shapes) {
  bank::Bank bank;
  std::vector<double> omega;
  for (const double lambda : modes.lambda) omega.push_back(std::sqrt(lambda));
  bank.radiation_gain = calc_radiation_gain(facts.vertices_m, facts.triangles, omega, shapes);
  bank.vertices_m = std::move(facts.vertices_m);
  bank.triangles = std::move(facts.triangles);
  bank.eigenvalue_rad2_s2 = modes.lambda;
  bank.residual = modes.residual;
  const spec::Material& material = run.job.material;
  for (const double lambda : modes.lambda) bank.decay_per_s.push_back(material.calc_decay_per_s(lambda));
  bank.rigid = {body.mass_kg, body.centre_m, body.inertia_kg_m2, body.volume_m3};
  bank.material = {material.young_modulus_pa, material.poisson_ratio, material.density_kg_m3, material.alpha1_s, material.alpha2_per_s};
  bank.counts = {pieces.nodes, pieces.tets, pieces.components, modes.rigid_count};
  bank.band_hz = run.job.band_hz;
  bank.complete = modes.band_count == static_cast<std::int64_t>(modes.lambda.size());
  bank.element = run.job.element == spec::Element::T4 ? "T4" : "T10";
  bank.mass = run.job.mass == spec::Mass::lumped ? "lumped" : "consistent";
  bank::quantise_shapes(bank, shapes);
  return bank;
}

std::string write_json(const Json::Value& value) {
  Json::StreamWriterBuilder writer;
  writer["indentation"] = "";
  writer["precision"] = 17;
  return Json::writeString(writer, value);
}

RunSummary write_outputs(Run& run, bank::Bank bank, const Json::Value& record) {
  RunSummary summary;
  summary.bank = run.job.bank;
  summary.resolved = spec::find_resolved_path(run.job.bank);
  run.stations.begin("write", summary.bank.string());
  petsc::run_agreed(run.comm, [&] {
    if (run.rank != 0) return;
    bank.provenance = spec::resolved_json(run.job, fs::absolute(summary.bank).parent_path(), write_json(record));
    bank::write_bank(bank, summary.bank);
    config::write_file(summary.resolved, bank.provenance);
    run.stations.say(fmt::format("{} bytes", fs::file_size(summary.bank)));
  });
  run.stations.end();
  summary.counts = bank.counts;
  summary.modes = bank.mode_count();
  summary.complete = bank.complete;
  if (summary.modes > 0) {
    summary.first_hz = bank.freq_hz(0);
    summary.last_hz = bank.freq_hz(summary.modes - 1);
  }
  return summary;
}

}  // namespace

RunSummary run_job(MPI_Comm comm, const fs::path& job_file, bool quiet) {
  Run run{comm, 0, 1, quiet, {}, Stations(comm, quiet)};
  MPI_Comm_rank(comm, &run.rank);
  MPI_Comm_size(comm, &run.ranks);
  run.job = read_shared_job(comm, run.rank, job_file);
  if (run.ranks > 1 && run.job.factorisation == spec::Factorisation::cholmod) {
    throw InputError(
        fmt::format("{}: \"solver.factorisation\": cholmod works on one rank, and there are {}; take \"mumps\" or \"automatic\"",
                    job_file.string(), run.ranks));
  }
  check_outputs(run);
  if (run.job.element == spec::Element::T4 && run.job.material.poisson_ratio > 0.45)
    warn(run.rank,
         fmt::format("T4 locks at a Poisson's ratio of {:g}: its frequencies will be several per cent sharp; use \"element\": \"T10\"",
                     run.job.material.poisson_ratio));

  MeshFacts facts;
  fem::Distribution pieces = distribute_mesh(run, facts);
  run.stations.begin("assembly",
                     fmt::format("{} unknowns, {}, {} mass", 3 * pieces.free_nodes, run.job.element == spec::Element::T4 ? "T4" : "T10",
                                 run.job.mass == spec::Mass::lumped ? "lumped" : "consistent"));
  const fem::System system = name_mesh(run, [&] { return fem::assemble(comm, pieces.local, run.job.material, run.job.mass); });
  const fem::RigidBody body = fem::calc_rigid_body(comm, pieces.local, run.job.material.density_kg_m3);
  run.stations.end();
  const eigen::Modes modes = name_mesh(run, [&] { return solve(run, system, make_layout(pieces)); });

  run.stations.begin("bank", "shapes on the surface, radiation gains");
  const std::vector<double> shapes = gather_shapes(comm, modes.shapes, facts.row);
  bank::Bank bank;
  petsc::run_agreed(comm, [&] {
    if (run.rank == 0) bank = make_bank(run, facts, pieces, body, modes, shapes);
  });
  run.stations.end();
  const Json::Value record = describe_run(run, facts, pieces, modes);
  return write_outputs(run, std::move(bank), record);
}

}  // namespace carillon::io
