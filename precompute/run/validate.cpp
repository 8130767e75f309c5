// Method:     The first half of a run, then the analysis of its factorisation. Memory and time of what is done here as measured, of the
//             rest by precompute/job/cost: factorisations at the pace of those that were timed, all else by this machine's update rate.
//             The answer comes within --patience: a step is begun only if its cost by precompute/job/cost, on a processor that gives this
//             process as little of its time as it did so far, fits what is left of it; else what the step would find is estimated.
// Source:     none. Deviations: none.
#include "precompute/run/validate.hpp"

#include <fmt/core.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/predict_cost.hpp"
#include "precompute/job/cost/calibration.hpp"
#include "precompute/job/cost/memory.hpp"
#include "precompute/job/cost/modes.hpp"
#include "precompute/job/cost/seconds.hpp"
#include "precompute/ldlt/update_rate.hpp"
#include "precompute/mesh/parallel/read_parallel.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/run/accuracy.hpp"
#include "precompute/run/describe_run.hpp"
#include "precompute/run/heartbeat.hpp"
#include "precompute/run/known_body.hpp"
#include "precompute/run/modes.hpp"
#include "precompute/run/open_job.hpp"
#include "precompute/run/system.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/host.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {
namespace {

static_assert(cost::kSliceModes == eigen::kSliceModes && cost::kDenseRows == eigen::kDenseRows, "The model predicts what the solver does.");

constexpr double kMeshShare = 0.7;   // of the patience: for the mesh of a surface
constexpr double kMargin = 1.3;      // of a step's predicted time
constexpr double kTrustSeconds = 1;  // of the start, in which files are waited for
constexpr double kRoomUsed = 0.8;    // of the memory that is left, at most
constexpr std::array<int, 3> kRanks{1, 2, 4};
constexpr const char* kGuessed =
    "memory and time are guessed by powers of the unknowns, to a factor of two for thin walls and of ten for thick bodies of a million";

/// Of this process and the programs that it started and that ended.
double find_all_cpu_seconds() { return base::get_process_cpu_s() + base::get_children_cpu_s(); }

template <class Triangles>
double calc_area(const std::vector<Vec3>& points_m, const Triangles& triangles) {
  double area = 0;
  for (const auto& t : triangles) {
    const Vec3 &a = points_m[t[0]], &b = points_m[t[1]], &c = points_m[t[2]];
    area += 0.5 * calc_length(cross(b - a, c - a));
  }
  return area;
}

class Validation {
 public:
  Validation(const comm::Communicator& comm, const RunOptions& options, bool shows_progress)
      : run_(comm, options),
        heartbeat_(shows_progress && run_.comm.is_root()),
        base_bytes_(static_cast<double>(base::find_memory().resident)) {}

  /// The job, read and checked.
  const Run& open(const std::filesystem::path& job_file) {
    open_job(run_, job_file, job::BankKey::optional);
    return run_;
  }
  void run();
  base::Json describe() const;
  std::string describe_for_people() const;

 private:
  void analyse_mesh(const Setting& setting);
  void estimate_from_volume(const Setting& setting);
  double find_seconds_left() const;
  double calc_clock(double cpu_s) const;
  bool has_time_to_read(const Setting& setting);
  std::string suggest_patience(double seconds) const;
  void guess();
  bool may_count(const eigen::SolveCost& estimate);
  void predict_modes();
  void predict_memory();
  void predict_time();
  double get_factor_pace() const;
  bool fits_here() const;
  bool has_volume() const { return !body_.estimate || body_.estimate->volume_m3 > 0; }
  std::int64_t get_max_modes() const {
    return solve_cost_.modes.value_or(has_volume() ? std::llround(std::ceil(estimate_.high)) : *size_.modes);
  }
  /// Of those that are computed, the ones that the bank will hold.
  std::int64_t get_listed(std::int64_t modes) const {
    return run_.job.max_modes ? std::min<std::int64_t>(modes, *run_.job.max_modes) : modes;
  }

  Run run_;
  Heartbeat heartbeat_;
  double base_bytes_;  // of a rank without a mesh
  Body body_;
  BodyProperties properties_;
  eigen::SolveCost solve_cost_;
  cost::MemoryParts memory_;  // of one rank
  double assembled_s_ = 0;    // CPU seconds until then
  double speed_ = 1;          // of this processor over that of the cost model
  bool is_analysed_ = false;
  double needed_s_ = 0;          // of the clock, predicted for the step that was not begun
  std::int64_t left_bytes_ = 0;  // for this rank and all it holds
  cost::ModeEstimate estimate_;
  cost::ProblemSize size_;
  cost::PhaseSeconds costs_;
  std::array<std::int64_t, kRanks.size()> bytes_{};
  std::array<double, kRanks.size()> wall_s_{};
  std::vector<std::string> notes_;
};

void Validation::run() {
  if (run_.comm.size() > 1) throw InputError("--validate works on one rank: start carillon-precompute without mpirun");
  Setting setting = job::get_setting(run_.job);
  if (run_.job.accuracy_cents) {
    setting = find_first_setting(run_);
    notes_.push_back("\"accuracy_cents\" chooses the mesh by trial: this is the first and coarsest trial, and those that follow need more");
  }
  speed_ = std::clamp(ldlt::measure_update_rate() / cost::kUpdateRate, 0.05, 20.0);
  heartbeat_.begin(
      fmt::format("reading {}", run_.job.body ? run::describe(*run_.job.body, {setting.nodes, setting.edge_m}) : run_.job.mesh.string()));
  if (has_time_to_read(setting)) {
    Patience patience{.seconds = std::max(kMeshShare * run_.options.patience_s - find_process_seconds(), 0.0)};
    body_ = run_.job.accuracy_cents ? make_trial_body(run_, setting, &patience) : make_body(run_, setting, &patience);
  }
  if (body_.estimate)
    estimate_from_volume(setting);
  else
    analyse_mesh(setting);
  predict_modes();
  predict_memory();
  predict_time();
}

/// Seconds of a factorisation on this machine over those of the cost model.
double Validation::get_factor_pace() const {
  if (solve_cost_.factor_seconds <= 0) return 1 / speed_;
  const double predicted = cost::predict_factorisation_seconds(size_);
  // Small factorisations are no measure of the pace.
  constexpr double kTrustSeconds = 0.1;
  return (solve_cost_.factor_seconds + kTrustSeconds / speed_) / (predicted + kTrustSeconds);
}

double Validation::find_seconds_left() const { return run_.options.patience_s - find_process_seconds(); }

/// By the clock, of a step that takes so many CPU seconds on the machine of the cost model.
double Validation::calc_clock(double cpu_s) const {
  const double share = (find_process_seconds() + kTrustSeconds) / (find_all_cpu_seconds() + kTrustSeconds);
  return kMargin * std::max(share, 1.0) * cpu_s / speed_;
}

/// "--patience 40 or more": what is left would take so many seconds.
std::string Validation::suggest_patience(double seconds) const {
  return fmt::format("--patience {:.0f} or more", 10 * std::ceil((find_process_seconds() + seconds) / 10));
}

/// Whether a mesh file can be read, or the mesh of a shape made; else body_ has what is known of it. Surfaces have a patience of their own.
bool Validation::has_time_to_read(const Setting& setting) {
  if (run_.job.body && !run_.job.body->shape.empty()) {
    // A coarse mesh of the same shape says what a fine one will have.
    constexpr std::int64_t kCoarseNodes = 1000;
    constexpr double kNodesPerCorner = 7.5;
    mesh::TetMesh coarse;
    try {
      MesherWords none;  // a shape has no messages
      coarse = make_body_mesh(*run_.job.body, 2, {.nodes = kCoarseNodes, .edge_m = {}}, none);
    } catch (const InputError&) {
      return true;  // it is said of the mesh itself
    }
    const mesh::CheckReport check = mesh::check_mesh(coarse, run_.job.body->shape);
    const mesh::Surface skin = mesh::extract_boundary(coarse);
    std::vector<Vec3> skin_m;
    for (const std::int32_t node : skin.nodes) skin_m.push_back(coarse.nodes_m[node]);
    double edges_m = 0;
    for (std::int64_t t = 0; t < coarse.tet_count(); ++t) {
      const Vec3 &p = coarse.nodes_m[coarse.tets[10 * t]], &q = coarse.nodes_m[coarse.tets[10 * t + 1]];
      edges_m += calc_length(p - q) / static_cast<double>(coarse.tet_count());
    }
    BodyEstimate known;
    known.volume_m3 = check.volume_m3;
    known.area_m2 = calc_area(skin_m, skin.triangles);
    known.thickness_m = 2 * known.volume_m3 / known.area_m2;
    const double corners = setting.element == job::Element::T10 ? 1 : 1 / kNodesPerCorner;
    const double finer = setting.edge_m ? std::pow(edges_m / *setting.edge_m, 3) : 1;
    known.nodes = setting.nodes.value_or(
        setting.edge_m ? std::llround(std::min(static_cast<double>(coarse.nodes_m.size()) * corners * finer, 1e15)) : cost::kDefaultNodes);
    body_.source = run::describe(*run_.job.body, {setting.nodes, setting.edge_m});
    body_.estimate = known;
  } else if (!run_.job.body) {
    const cost::ProblemSize size = cost::complete(estimate_size(run_.job, setting));
    body_.source = run_.job.mesh.string();
    if (size.tets > 0) body_.estimate = BodyEstimate{.nodes = size.nodes};
  }
  if (!body_.estimate) return true;
  const cost::PhaseSeconds costs =
      cost::predict_seconds(cost::estimate_meshed_size(body_.estimate->nodes, setting.element == job::Element::T10));
  needed_s_ = calc_clock(costs.read + costs.partition);
  if (needed_s_ >= find_seconds_left()) return false;
  needed_s_ = 0;
  body_ = {};
  return true;
}

/// A surface that takes long to mesh: all from its volume, area and thickness.
void Validation::estimate_from_volume(const Setting& setting) {
  const BodyEstimate& known = *body_.estimate;
  size_ = {};
  size_.is_quadratic = setting.element == job::Element::T10;
  size_.nodes = known.nodes;
  // One layer of elements has two tetrahedra of ten nodes for every four nodes, a solid two for three.
  size_.tets = size_.is_quadratic ? known.nodes * 3 / 5 : known.nodes * 4;
  size_.unknowns = 3 * known.nodes;
  size_.surface_nodes = known.nodes / 2;
  left_bytes_ = eigen::find_memory_left() + base::find_memory().resident - std::llround(base_bytes_);
  properties_.materials.list = {run_.job.material};
  properties_.volume_m3 = {known.volume_m3};
  guess();
  const double patience = run_.options.patience_s;
  if (run_.job.body && run_.job.body->shape.empty()) {
    const double meshing = calc_clock(cost::kSurfaceMeshSecondsPerNode * static_cast<double>(known.nodes)) / kMeshShare;
    notes_.push_back(fmt::format(
        "the surface was {}, since that takes longer than {:g} s ({:.0f} % of --patience): its nodes are estimated from volume ({:.4g} "
        "m^3), area ({:.4g} m^2) and thickness ({:.4g} m){}, to a factor of two, and {}; fixed nodes are not counted; {} meshes it",
        known.is_rough ? "not repaired and meshed" : "not meshed", kMeshShare * patience, 100 * kMeshShare, known.volume_m3, known.area_m2,
        known.thickness_m, known.is_rough ? " of the surface as it is in the file" : "", kGuessed, suggest_patience(meshing)));
  } else {
    notes_.push_back(fmt::format(
        "the mesh was not {}, since that would take longer than the {:g} s of --patience: its nodes are estimated from {}, to a factor of "
        "two, and {}; fixed nodes are not counted; {} {} it",
        run_.job.body ? "made" : "read", patience, run_.job.body ? "a coarse mesh of the same shape" : "the size of the file", kGuessed,
        suggest_patience(needed_s_), run_.job.body ? "makes" : "reads"));
  }
}

/// The factor by powers of the unknowns; what else is unknown stays so.
cost::ProblemSize complete_factor(cost::ProblemSize size) {
  const cost::ProblemSize whole = cost::complete(size);
  size.factor_entries = whole.factor_entries;
  size.factor_flops = whole.factor_flops;
  return size;
}

/// A body that is too large to be assembled here: all by powers of its unknowns.
void Validation::guess() {
  if (!body_.estimate) {
    properties_.materials = fem::find_materials(run_.comm, body_.pieces.local, run_.job, body_.region_names);
    properties_.volume_m3 = fem::calc_volumes(run_.comm, body_.pieces.local, properties_.materials);
  }
  size_ = complete_factor(size_);
  solve_cost_.entries = size_.factor_entries;
  solve_cost_.flops = size_.factor_flops;
  memory_ = cost::predict_parts(size_);
  memory_.program = base_bytes_;
  memory_.assembled = static_cast<double>(base::find_memory().resident) + cost::calc_matrix_bytes(size_);
  memory_.read_peak = memory_.assembled;
  if (body_.estimate) return;
  notes_.push_back(
      needed_s_ > 0
          ? fmt::format("K and M were not assembled and their factorisation not analysed, since that would take about {:.0f} s "
                        "and {:.1f} of the {:g} s of --patience were left: {}; {} analyses it",
                        needed_s_, std::max(find_seconds_left(), 0.0), run_.options.patience_s, kGuessed, suggest_patience(needed_s_))
          : fmt::format("too large to be assembled in the memory that is left here: {}", kGuessed));
}

bool Validation::may_count(const eigen::SolveCost& estimate) {
  cost::ProblemSize size = size_;
  size.factor_flops = estimate.flops;
  size.factor_entries = estimate.entries;
  const double counts_s = calc_clock(2 * cost::predict_factorisation_seconds(size));
  if (static_cast<double>(estimate.factor_bytes) >= kRoomUsed * static_cast<double>(eigen::find_memory_left())) {
    notes_.push_back("the modes were not counted, since a factorisation does not fit the memory that is left here");
    return false;
  }
  const double left = std::min(find_seconds_left(), run_.options.count_s);
  if (counts_s >= left) {
    notes_.push_back(fmt::format(
        "the modes were not counted, since two factorisations would take about {:.0f} s and {:.1f} s were left for them; {}{} counts them",
        counts_s, std::max(left, 0.0), suggest_patience(counts_s),
        counts_s >= run_.options.count_s ? fmt::format(" with --count {:.0f}", 10 * std::ceil(counts_s / 10)) : ""));
    return false;
  }
  heartbeat_.begin("counting the modes by two factorisations");
  return true;
}

void Validation::analyse_mesh(const Setting& setting) {
  size_ = find_problem_size(run_, setting, body_);
  const cost::PhaseSeconds costs = cost::predict_seconds(size_);
  const double needed = calc_clock(costs.assemble + costs.analyse);
  if (needed >= find_seconds_left()) needed_s_ = needed;
  const std::int64_t left = eigen::find_memory_left();
  left_bytes_ = left + base::find_memory().resident - std::llround(base_bytes_);
  // K, M, and room to sort their entries.
  if (needed_s_ > 0 || 2 * cost::calc_matrix_bytes(size_) > kRoomUsed * static_cast<double>(left)) {
    guess();
  } else {
    is_analysed_ = true;
    heartbeat_.begin(fmt::format("assembling {} unknowns", size_.unknowns));
    AssembledSystem system = assemble_system(run_, setting, body_);
    memory_.program = base_bytes_;
    memory_.assembled = static_cast<double>(base::find_memory().resident);
    memory_.read_peak = static_cast<double>(base::find_memory().peak);
    assembled_s_ = base::get_process_cpu_s();
    heartbeat_.begin("analysing the factorisation");
    solve_cost_ = name_errors(body_.source, run_, [&] {
      return eigen::predict_cost({system.matrices.stiffness, system.matrices.mass, make_layout(body_)}, make_options(run_.job, setting),
                                 [&](const eigen::SolveCost& estimate) { return may_count(estimate); });
    });
    properties_ = std::move(system.properties);
    memory_.copies_peak = static_cast<double>(solve_cost_.copies_bytes);
    memory_.copies = static_cast<double>(solve_cost_.copies_kept_bytes);
    memory_.factor_peak = static_cast<double>(solve_cost_.factor_bytes);
    memory_.factor = static_cast<double>(solve_cost_.factor_kept_bytes);
  }
  size_.factor_flops = solve_cost_.flops;
  size_.factor_entries = solve_cost_.entries;
}

void Validation::predict_modes() {
  if (!has_volume()) {
    size_.modes = cost::complete(size_).modes;
    notes_.push_back(fmt::format("the modes are not known, as nothing but the size of the mesh is: the figures are for {}", *size_.modes));
    return;
  }
  estimate_ = cost::estimate_modes(properties_.materials.list, properties_.volume_m3,
                                   body_.estimate ? body_.estimate->area_m2 : calc_area(body_.surface.vertices_m, body_.surface.triangles),
                                   run_.job.band_hz[0], run_.job.band_hz[1]);
  if (const std::optional<std::int64_t> computed = find_computed_count(run_.job)) {
    const auto most = static_cast<double>(*computed);
    for (double* count : {&estimate_.count, &estimate_.low, &estimate_.high}) *count = std::min(*count, most);
  }
  size_.is_thin = estimate_.slenderness > cost::kVerySlender;
  size_.modes = solve_cost_.modes.value_or(std::llround(estimate_.count));
  if (solve_cost_.modes) return;
  notes_.push_back(fmt::format("the modes are estimated from volume and surface (Weyl's law), between {} and {}{}",
                               get_listed(std::llround(estimate_.low)), get_listed(std::llround(estimate_.high)),
                               estimate_.is_thin ? ": its walls are thinner than half a shear wave, where that is rough" : ""));
}

void Validation::predict_memory() {
  cost::ProblemSize size = size_;
  size.modes = get_max_modes();
  size.rigid_modes = solve_cost_.rigid_count;
  size.is_dense = solve_cost_.is_dense;
  for (std::size_t i = 0; i < kRanks.size(); ++i) bytes_[i] = std::llround(cost::calc_peak_bytes(memory_, size, kRanks[i]));
}

void Validation::predict_time() {
  costs_ = cost::predict_seconds(size_);
  const double predicted_here = costs_.read + costs_.partition + costs_.assemble;
  using Phases = cost::PhaseSeconds;
  costs_.factor *= get_factor_pace();
  for (double Phases::*phase : {&Phases::analyse, &Phases::solve, &Phases::orthogonalise, &Phases::check, &Phases::errors,
                                &Phases::coupling, &Phases::collect, &Phases::air, &Phases::write})
    costs_.*phase /= speed_;
  const double here = assembled_s_ > 0 ? assembled_s_ / std::max(predicted_here, 1e-9) : 1 / speed_;
  for (double Phases::*phase : {&Phases::read, &Phases::partition, &Phases::assemble}) costs_.*phase *= here;
  for (std::size_t i = 0; i < kRanks.size(); ++i) wall_s_[i] = cost::calc_wall(costs_, size_, kRanks[i]).sum();
}

/// On one rank, in the memory that is left now.
bool Validation::fits_here() const { return bytes_[0] - std::llround(base_bytes_) <= left_bytes_; }

base::Json Validation::describe() const {
  base::Json root;
  root["ok"] = true;
  base::Json& mesh = root["mesh"];
  mesh["source"] = body_.source;
  mesh["how"] = body_.estimate ? "estimated" : "made";
  mesh["nodes"] = size_.nodes;
  mesh["tets"] = size_.tets;
  mesh["components"] = body_.pieces.components;
  mesh["fixed_nodes"] = body_.fixed_nodes;
  mesh["min_dihedral_deg"] = body_.check.min_dihedral_deg;
  mesh["mean_ratio_min"] = body_.check.mean_ratio_min;
  root["unknowns"] = size_.unknowns;
  base::Json& modes = root["modes"];
  modes["count"] = get_listed(*size_.modes);
  modes["how"] = solve_cost_.modes ? "counted" : has_volume() ? "estimated" : "unknown";
  modes["estimate"] = get_listed(std::llround(estimate_.count));
  modes["low"] = get_listed(solve_cost_.modes ? *size_.modes : std::llround(std::floor(estimate_.low)));
  modes["high"] = get_listed(get_max_modes());
  root["factor"]["entries"] = solve_cost_.entries;
  root["factor"]["flops"] = solve_cost_.flops;
  root["factor"]["how"] = is_analysed_ ? "analysed" : "guessed";
  for (std::size_t i = 0; i < kRanks.size(); ++i) {
    root["memory_bytes"][std::to_string(kRanks[i])] = bytes_[i];
    root["wall_seconds"][std::to_string(kRanks[i])] = wall_s_[i];
  }
  root["cpu_seconds"] = costs_.sum();
  root["seconds_taken"] = find_process_seconds();
  root["fits_here"] = fits_here();
  for (const std::string& note : notes_) root["notes"].append(note);
  for (const std::string& warning : run_.log.get_warnings()) root["warnings"].append(warning);
  return root;
}

std::string Validation::describe_for_people() const {
  std::string text = fmt::format("{}: well\n{}{} nodes, {} tetrahedra, {} unknowns\n", run_.job.file.string(),
                                 body_.estimate ? "about " : "", size_.nodes, size_.tets, size_.unknowns);
  const std::int64_t listed = get_listed(*size_.modes);
  text += solve_cost_.modes
              ? fmt::format("{} modes in {:g} .. {:g} Hz, counted by inertia\n", listed, run_.job.band_hz[0], run_.job.band_hz[1])
              : fmt::format("{} {} modes in {:g} .. {:g} Hz\n", has_volume() ? "about" : "as for", listed, run_.job.band_hz[0],
                            run_.job.band_hz[1]);
  if (listed < *size_.modes)
    text += fmt::format("{} modes are computed, so that the lowest {} are sure in the order of their corrected frequencies\n", *size_.modes,
                        listed);
  for (std::size_t i = 0; i < kRanks.size(); ++i)
    text += fmt::format("{} rank{}: at most {:.2f} GB, about {:.1f} s\n", kRanks[i], kRanks[i] == 1 ? "" : "s",
                        1e-9 * static_cast<double>(bytes_[i]), wall_s_[i]);
  text += fmt::format("{:.1f} CPU s on this machine", costs_.sum());
  if (!fits_here())
    text += fmt::format("\none rank does not fit the {:.2f} GB of memory that are left here", 1e-9 * static_cast<double>(left_bytes_));
  for (const std::string& note : notes_) text += "\n" + note;
  return text;
}

}  // namespace

std::string validate_job(const comm::Communicator& comm, const std::filesystem::path& job_file, const RunOptions& options) {
  RunOptions silent = options;
  silent.quiet = true;
  Validation validation(comm, silent, !options.quiet);
  const Run& opened = validation.open(job_file);
  if (opened.job.analytic) return validate_known_body(opened);
  validation.run();
  return options.json ? validation.describe().sorted_text() : validation.describe_for_people();
}

std::string describe_failure(const std::string& message, int code) {
  base::Json root;
  root["ok"] = false;
  root["error"] = message;
  root["code"] = code;
  return root.sorted_text();
}

}  // namespace carillon::run
