// Method: memory is measured up to the analysis of the factorisation; the rest follows from the solver's own formulas
//   (eigen/predict_cost, precompute/job/cost). Modes are counted by two factorisations if these are small, otherwise estimated by Weyl's
//   law. Seconds: the cost model on its reference machine.
#include "precompute/run/validate.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/predict_cost.hpp"
#include "precompute/job/cost/calibration.hpp"
#include "precompute/job/cost/memory.hpp"
#include "precompute/job/cost/modes.hpp"
#include "precompute/job/cost/seconds.hpp"
#include "precompute/run/accuracy.hpp"
#include "precompute/run/known_body.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/base/host.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {
namespace {

constexpr double kRoomUsed = 0.8;        // maximum part of the available memory
constexpr double kMaxCountFlops = 5e11;  // of one factorisation of the count: about 10 s
constexpr std::array<int, 3> kRanks{1, 2, 4};

struct Prediction {
  Body body;
  BodyProperties properties;
  eigen::SolveCost solve;
  bool is_analysed = false;
  cost::ProblemSize size;
  cost::ModeEstimate weyl;
  cost::MemoryParts memory;  // of one rank
  cost::PhaseSeconds cpu_s;
  std::array<std::int64_t, kRanks.size()> bytes{};
  std::int64_t available_bytes = 0;  // to this process
  std::vector<std::string> notes;

  std::int64_t get_max_modes() const { return solve.modes.value_or(std::llround(std::ceil(weyl.high))); }
};

double calc_area(const Surface& surface) {
  double area = 0;
  for (const Triangle& t : surface.triangles) {
    const Vec3 &a = surface.vertices_m[t[0]], &b = surface.vertices_m[t[1]], &c = surface.vertices_m[t[2]];
    area += 0.5 * calc_length(cross(b - a, c - a));
  }
  return area;
}

/// Assembles K and M and analyses their factorisation; counts the modes if that is cheap and fits into memory.
void analyse(Run& run, const Setting& setting, Prediction& found) {
  AssembledSystem system = assemble_system(run, setting, found.body);
  found.memory.assembled = static_cast<double>(base::find_memory().resident);
  found.memory.read_peak = static_cast<double>(base::find_memory().peak);
  const auto may_count = [&](const eigen::SolveCost& estimate) {
    const bool fits = static_cast<double>(estimate.factor_bytes) < kRoomUsed * static_cast<double>(eigen::find_memory_left());
    if (!fits) found.notes.push_back("the modes were not counted: a factorisation does not fit into the available memory");
    if (fits && estimate.flops > kMaxCountFlops)
      found.notes.push_back(fmt::format("the modes were not counted: a factorisation has {:.2g} operations", estimate.flops));
    return fits && estimate.flops <= kMaxCountFlops;
  };
  // The modes of the bank; the few around them, which are solved too, count for nothing.
  const eigen::Options options = make_options(run.job, setting, {run.job.band_hz[0], run.job.band_hz[1], find_computed_count(run.job)});
  found.solve = name_errors(found.body.source, run, [&] {
    return eigen::predict_cost({system.matrices.stiffness, system.matrices.mass, make_layout(found.body)}, options, may_count);
  });
  found.is_analysed = true;
  found.properties = std::move(system.properties);
  found.memory.copies_peak = static_cast<double>(found.solve.copies_bytes);
  found.memory.copies = static_cast<double>(found.solve.copies_kept_bytes);
  found.memory.factor_peak = static_cast<double>(found.solve.factor_bytes);
  found.memory.factor = static_cast<double>(found.solve.factor_kept_bytes);
}

/// For bodies too large to be assembled here: powers of the unknowns.
void extrapolate(Run& run, Prediction& found) {
  found.properties.materials =
      fem::find_materials(run.comm, found.body.pieces.local, run.job, found.body.region_names, found.body.file_materials);
  found.properties.volume_m3 = fem::calc_volumes(run.comm, found.body.pieces.local, found.properties.materials);
  const cost::ProblemSize whole = cost::complete(found.size);
  found.solve.entries = whole.factor_entries;
  found.solve.flops = whole.factor_flops;
  const double program = found.memory.program;
  found.memory = cost::predict_parts(found.size);
  found.memory.program = program;
  found.memory.assembled = static_cast<double>(base::find_memory().resident) + cost::calc_matrix_bytes(found.size);
  found.memory.read_peak = found.memory.assembled;
  found.notes.push_back(
      "K and M do not fit into the available memory: memory is extrapolated by powers of the unknowns, to a factor of two for thin walls "
      "and of ten for thick bodies of a million unknowns");
}

/// Number of modes in the bank, of `modes` computed ones.
std::int64_t get_listed(const Run& run, std::int64_t modes) {
  return run.job.max_modes ? std::min<std::int64_t>(modes, *run.job.max_modes) : modes;
}

void estimate_modes(const Run& run, Prediction& found) {
  found.weyl = cost::estimate_modes(found.properties.materials.list, found.properties.volume_m3, calc_area(found.body.surface),
                                    run.job.band_hz[0], run.job.band_hz[1]);
  if (const std::optional<std::int64_t> computed = find_computed_count(run.job))
    for (double* count : {&found.weyl.count, &found.weyl.low, &found.weyl.high}) *count = std::min(*count, static_cast<double>(*computed));
  found.size.is_thin = found.weyl.slenderness > cost::kVerySlender;
  found.size.modes = found.solve.modes.value_or(std::llround(found.weyl.count));
  if (!found.solve.modes)
    found.notes.push_back(fmt::format("the modes are estimated from volume and surface (Weyl's law), between {} and {}{}",
                                      get_listed(run, std::llround(found.weyl.low)), get_listed(run, std::llround(found.weyl.high)),
                                      found.weyl.is_thin ? ": rough, since walls are thinner than half a shear wavelength" : ""));
}

Prediction predict(Run& run) {
  Prediction found;
  const std::int64_t program_bytes = base::find_memory().resident;
  Setting setting = job::get_setting(run.job);
  if (run.job.accuracy_cents) {
    setting = find_first_setting(run);
    found.notes.emplace_back("\"accuracy_cents\" chooses the mesh by trials: this is the first and coarsest one; later ones need more");
  }
  found.body = run.job.accuracy_cents ? make_trial_body(run, setting) : make_body(run, setting);
  found.size = find_problem_size(run, setting, found.body);
  const std::int64_t left_bytes = eigen::find_memory_left();
  found.available_bytes = left_bytes + base::find_memory().resident - program_bytes;
  found.memory.program = static_cast<double>(program_bytes);
  // K, M, and room to sort their entries.
  if (2 * cost::calc_matrix_bytes(found.size) > kRoomUsed * static_cast<double>(left_bytes))
    extrapolate(run, found);
  else
    analyse(run, setting, found);
  found.size.factor_flops = found.solve.flops;
  found.size.factor_entries = found.solve.entries;
  estimate_modes(run, found);
  found.cpu_s = cost::predict_seconds(found.size);
  cost::ProblemSize largest = found.size;
  largest.modes = found.get_max_modes();
  largest.rigid_modes = found.solve.rigid_count;
  largest.is_dense = found.solve.is_dense;
  for (std::size_t i = 0; i < kRanks.size(); ++i) found.bytes[i] = std::llround(cost::calc_peak_bytes(found.memory, largest, kRanks[i]));
  return found;
}

/// On one rank, in the memory available now.
bool fits_here(const Prediction& found) { return found.bytes[0] - std::llround(found.memory.program) <= found.available_bytes; }

base::Json describe(const Run& run, const Prediction& found) {
  base::Json root;
  root["ok"] = true;
  base::Json& mesh = root["mesh"];
  mesh.set("source", found.body.source).set("nodes", found.size.nodes).set("tets", found.size.tets);
  mesh.set("components", found.body.pieces.components).set("fixed_nodes", found.body.fixed_nodes);
  mesh.set("min_dihedral_deg", found.body.check.min_dihedral_deg).set("mean_ratio_min", found.body.check.mean_ratio_min);
  root["unknowns"] = found.size.unknowns;
  base::Json& modes = root["modes"];
  modes.set("count", get_listed(run, *found.size.modes)).set("how", found.solve.modes ? "counted" : "estimated");
  modes.set("estimate", get_listed(run, std::llround(found.weyl.count)));
  modes.set("low", get_listed(run, found.solve.modes ? *found.size.modes : std::llround(std::floor(found.weyl.low))));
  modes.set("high", get_listed(run, found.get_max_modes()));
  root["factor"].set("entries", found.solve.entries).set("flops", found.solve.flops);
  root["factor"].set("how", found.is_analysed ? "analysed" : "extrapolated");
  for (std::size_t i = 0; i < kRanks.size(); ++i) {
    root["memory_bytes"][std::to_string(kRanks[i])] = found.bytes[i];
    root["wall_seconds"][std::to_string(kRanks[i])] = cost::calc_wall(found.cpu_s, found.size, kRanks[i]).sum();
  }
  root.set("cpu_seconds", found.cpu_s.sum()).set("fits_here", fits_here(found));
  for (const std::string& note : found.notes) root["notes"].add(note);
  for (const std::string& warning : run.log.get_warnings()) root["warnings"].add(warning);
  return root;
}

std::string describe_for_people(const Run& run, const Prediction& found) {
  const std::int64_t listed = get_listed(run, *found.size.modes);
  std::string text = fmt::format("{}: ok\n{} nodes, {} tetrahedra, {} unknowns\n{}{} modes in {:g} .. {:g} Hz{}\n", run.job.file.string(),
                                 found.size.nodes, found.size.tets, found.size.unknowns, found.solve.modes ? "" : "about ", listed,
                                 run.job.band_hz[0], run.job.band_hz[1], found.solve.modes ? ", counted by inertia" : "");
  if (listed < *found.size.modes)
    text += fmt::format("{} modes are computed, so that the lowest {} corrected ones are reliable\n", *found.size.modes, listed);
  for (std::size_t i = 0; i < kRanks.size(); ++i)
    text += fmt::format("{} rank{}: at most {:.2f} GB\n", kRanks[i], kRanks[i] == 1 ? "" : "s", 1e-9 * static_cast<double>(found.bytes[i]));
  text += fmt::format("about {:.1f} CPU s on the reference machine", found.cpu_s.sum());
  if (!fits_here(found))
    text += fmt::format("\none rank does not fit into the {:.2f} GB available here", 1e-9 * static_cast<double>(found.available_bytes));
  for (const std::string& note : found.notes) text += "\n" + note;
  return text;
}

}  // namespace

std::string validate_job(const comm::Communicator& comm, const std::filesystem::path& job_file, const RunOptions& options) {
  RunOptions silent = options;
  silent.quiet = true;
  Run run(comm, silent);
  open_job(run, job_file, job::BankKey::optional);
  if (run.job.analytic) return validate_known_body(run);
  if (comm.size() > 1) throw InputError("--validate works on one rank: start carillon-precompute without mpirun");
  const Prediction found = predict(run);
  return options.json ? describe(run, found).sorted_text() : describe_for_people(run, found);
}

std::string describe_failure(const std::string& message, int code) {
  base::Json root;
  root.set("ok", false).set("error", message).set("code", code);
  return root.sorted_text();
}

}  // namespace carillon::run
