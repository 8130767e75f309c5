// Method:     The first half of a run, then the analysis of its factorisation. Memory of one rank: what is allocated after the assembly, as
//             measured here, and what the solver's own checks would ask for; of several ranks by factors measured on the bodies of
//             tests/bench/predict. Time: the parts done here as measured, the others by costs.cpp at the pace of what was measured.
//             The answer comes within --patience: a step is begun only if its cost by costs.cpp, on a processor that gives this process
//             as little of its time as it did so far, fits what is left of it; else what the step would find is estimated.
// Source:     none. Deviations: none.
#include "precompute/io/validate.hpp"

#include <fmt/core.h>
#include <json/json.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/needs.hpp"
#include "precompute/io/accuracy.hpp"
#include "precompute/io/describe_run.hpp"
#include "precompute/io/open_job.hpp"
#include "precompute/io/pulse.hpp"
#include "precompute/io/solve_body.hpp"
#include "precompute/io/weyl.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/slabs/read_parallel.hpp"
#include "runtime/base/cpu_clock.hpp"
#include "runtime/base/host.hpp"

namespace carillon::io {
namespace {

constexpr double kMeshShare = 0.7;   // of the patience: for the mesh of a surface
constexpr double kMargin = 1.3;      // of a step's predicted time
constexpr double kTrustSeconds = 1;  // of the start, in which files are waited for
constexpr double kVeryThin = 100;    // slenderness of bodies whose lowest modes need a correction
constexpr double kRoomUsed = 0.8;    // of the memory that is left, at most
constexpr std::array<int, 3> kRanks{1, 2, 4};
// All ranks together, over one: halos, the interface between the ranks, which is eliminated last, and what MPI holds for each.
constexpr std::array<double, 3> kMore{1.3, 1.42, 1.55};
constexpr double kRankBytes = 10e6;
constexpr const char* kGuessed =
    "memory and time are guessed by powers of the unknowns, to a factor of two for thin walls and of ten for thick bodies of a million";

/// Of this process and the programs that it started and that ended.
double find_all_cpu_seconds() { return base::get_process_cpu_s() + base::get_children_cpu_s(); }

template <class Triangles>
double calc_area(const std::vector<Vec3>& points_m, const Triangles& triangles) {
  double area = 0;
  for (const auto& t : triangles) {
    const Vec3 &a = points_m[t[0]], &b = points_m[t[1]], &c = points_m[t[2]];
    const Vec3 u{b[0] - a[0], b[1] - a[1], b[2] - a[2]}, v{c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    area += 0.5 * std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
  }
  return area;
}

class Validation {
 public:
  Validation(MPI_Comm comm, const RunOptions& options, bool tells)
      : run_(comm, options), pulse_(tells && run_.rank == 0), base_bytes_(base::find_memory().resident) {}

  void look(const std::filesystem::path& job_file);
  Json::Value describe() const;
  std::string describe_for_people() const;

 private:
  void look_ahead(const Setting& setting);
  void look_from_afar(const Setting& setting);
  double find_seconds_left() const;
  double calc_clock(double cpu_s) const;
  bool has_time_to_read(const Setting& setting);
  std::string suggest_patience(double seconds) const;
  double calc_matrix_bytes() const;
  void guess();
  bool may_count(const eigen::Outlook& outlook);
  void predict_modes();
  void predict_memory();
  void predict_time();
  double get_pace() const;
  bool fits_here() const;
  bool knows_volume() const { return !body_.estimate || body_.estimate->volume_m3 > 0; }
  std::int64_t get_most_modes() const {
    return outlook_.modes.value_or(knows_volume() ? std::llround(std::ceil(estimate_.high)) : extent_.modes);
  }

  Run run_;
  Pulse pulse_;
  std::int64_t base_bytes_;  // of a rank that has nothing yet
  Body body_;
  SolvedBody solved_;
  eigen::Outlook outlook_;
  std::int64_t held_bytes_ = 0;  // after the assembly
  std::int64_t read_bytes_ = 0;  // at the worst moment until then
  double assembled_s_ = 0;       // CPU seconds until then
  double speed_ = 1;
  bool is_analysed_ = false;
  double needed_s_ = 0;          // of the clock, predicted for the step that was not begun
  std::int64_t left_bytes_ = 0;  // for this rank and all it holds
  ModeEstimate estimate_;
  Extent extent_;
  Costs costs_;
  std::array<std::int64_t, kRanks.size()> bytes_{};
  std::array<double, kRanks.size()> wall_s_{};
  std::vector<std::string> notes_;
};

void Validation::look(const std::filesystem::path& job_file) {
  if (run_.ranks > 1) throw InputError("--validate works on one rank: start carillon-precompute without mpirun");
  open_job(run_, job_file, job::BankKey::optional);
  Setting setting = get_setting(run_.job);
  if (run_.job.accuracy_cents) {
    setting = find_first_setting(run_);
    notes_.push_back("\"accuracy_cents\" chooses the mesh by trial: this is the first and coarsest trial, and those that follow need more");
  }
  speed_ = measure_speed();
  pulse_.begin(
      fmt::format("reading {}", run_.job.body ? io::describe(*run_.job.body, {setting.nodes, setting.edge_m}) : run_.job.mesh.string()));
  if (has_time_to_read(setting)) {
    Patience patience{.seconds = std::max(kMeshShare * run_.options.patience_s - find_process_seconds(), 0.0)};
    body_ = run_.job.accuracy_cents ? make_trial_body(run_, setting, &patience) : make_body(run_, setting, &patience);
  }
  if (body_.estimate)
    look_from_afar(setting);
  else
    look_ahead(setting);
  predict_modes();
  predict_memory();
  predict_time();
}

/// How fast this machine is beside that of costs.cpp.
double Validation::get_pace() const {
  if (outlook_.factor_seconds <= 0) return 1 / speed_;
  Extent one = extent_;
  one.modes = 1;
  const double predicted = predict_costs(one).factor / static_cast<double>(predict_factorisations(1));
  // Small factorisations say little.
  constexpr double kTrustSeconds = 0.1;
  return (outlook_.factor_seconds + kTrustSeconds / speed_) / (predicted + kTrustSeconds);
}

double Validation::find_seconds_left() const { return run_.options.patience_s - find_process_seconds(); }

/// By the clock, of a step that takes so many CPU seconds on the machine of costs.cpp.
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
    constexpr std::int64_t kCoarseNodes = 1000, kDefaultNodes = 10000;
    constexpr double kNodesPerCorner = 7.5;
    mesh::TetMesh coarse;
    try {
      coarse = make_body_mesh(*run_.job.body, 2, {.nodes = kCoarseNodes, .edge_m = {}});
    } catch (const InputError&) {
      return true;  // it is said of the mesh itself
    }
    const mesh::CheckReport check = mesh::check_mesh(coarse, run_.job.body->shape);
    const mesh::Surface skin = mesh::extract_boundary(coarse);
    std::vector<Vec3> skin_m;
    for (const std::int32_t node : skin.nodes) skin_m.push_back(coarse.nodes[node]);
    double edges_m = 0;
    for (std::int64_t t = 0; t < coarse.tet_count(); ++t) {
      const Vec3 &p = coarse.nodes[coarse.tets[10 * t]], &q = coarse.nodes[coarse.tets[10 * t + 1]];
      edges_m += std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]) / static_cast<double>(coarse.tet_count());
    }
    BodyEstimate known;
    known.volume_m3 = check.volume_m3;
    known.area_m2 = calc_area(skin_m, skin.triangles);
    known.thickness_m = 2 * known.volume_m3 / known.area_m2;
    const double corners = setting.element == job::Element::T10 ? 1 : 1 / kNodesPerCorner;
    const double finer = setting.edge_m ? std::pow(edges_m / *setting.edge_m, 3) : 1;
    known.nodes = setting.nodes.value_or(
        setting.edge_m ? std::llround(std::min(static_cast<double>(coarse.nodes.size()) * corners * finer, 1e15)) : kDefaultNodes);
    body_.source = io::describe(*run_.job.body, {setting.nodes, setting.edge_m});
    body_.estimate = known;
  } else if (!run_.job.body) {
    const Extent extent = complete(find_extent(run_, setting, {}));
    body_.source = run_.job.mesh.string();
    if (extent.tets > 0) body_.estimate = BodyEstimate{.nodes = extent.nodes};
  }
  if (!body_.estimate) return true;
  Extent extent;
  extent.is_quadratic = setting.element == job::Element::T10;
  extent.nodes = body_.estimate->nodes;
  extent.tets = extent.is_quadratic ? extent.nodes * 2 / 3 : extent.nodes * 4;
  const Costs costs = predict_costs(extent);
  needed_s_ = calc_clock(costs.read + costs.partition);
  if (needed_s_ >= find_seconds_left()) return false;
  needed_s_ = 0;
  body_ = {};
  return true;
}

/// A surface that takes long to mesh: all from its volume, area and thickness.
void Validation::look_from_afar(const Setting& setting) {
  const BodyEstimate& known = *body_.estimate;
  extent_ = {};
  extent_.is_quadratic = setting.element == job::Element::T10;
  extent_.is_lumped = run_.job.mass == job::Mass::lumped;
  extent_.nodes = known.nodes;
  // One layer of elements has two tetrahedra of ten nodes for every four nodes, a solid two for three.
  extent_.tets = extent_.is_quadratic ? known.nodes * 3 / 5 : known.nodes * 4;
  extent_.unknowns = 3 * known.nodes;
  extent_.surface_nodes = known.nodes / 2;
  left_bytes_ = eigen::find_memory_left() + base::find_memory().resident - base_bytes_;
  solved_.materials.list = {run_.job.material};
  solved_.volume_m3 = {known.volume_m3};
  guess();
  const double patience = run_.options.patience_s;
  if (run_.job.body && run_.job.body->shape.empty()) {
    constexpr double kMeshSecondsPerNode = 1e-4;  // meshing, with some trials to meet a count
    const double meshing = calc_clock(kMeshSecondsPerNode * static_cast<double>(known.nodes)) / kMeshShare;
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

/// The room that K and M will take [byte].
double Validation::calc_matrix_bytes() const {
  const double neighbours = extent_.is_quadratic ? 28 : 15;  // nodes, itself among them, that share an element with a node
  return 2 * 12.0 * 3 * neighbours * static_cast<double>(extent_.unknowns);
}

/// A body that is too large to be assembled here: all by powers of its unknowns.
void Validation::guess() {
  if (!body_.estimate) {
    solved_.materials = fem::find_materials(run_.comm, body_.pieces.local, run_.job, body_.region_names);
    solved_.volume_m3 = fem::calc_volumes(run_.comm, body_.pieces.local, solved_.materials);
  }
  const Extent whole = complete(extent_);
  outlook_.entries = whole.factor_entries;
  outlook_.flops = whole.factor_flops;
  outlook_.factor_kept_bytes = 8 * outlook_.entries;
  outlook_.factor_bytes = outlook_.factor_kept_bytes * 3 / 2;  // with the update matrices
  outlook_.copies_bytes = outlook_.copies_kept_bytes = static_cast<std::int64_t>(calc_matrix_bytes());
  held_bytes_ = base::find_memory().resident + static_cast<std::int64_t>(calc_matrix_bytes());
  extent_.factor_flops = outlook_.flops;
  extent_.factor_entries = outlook_.entries;
  if (body_.estimate) return;
  notes_.push_back(
      needed_s_ > 0
          ? fmt::format("K and M were not assembled and their factorisation not analysed, since that would take about {:.0f} s "
                        "and {:.1f} of the {:g} s of --patience were left: {}; {} analyses it",
                        needed_s_, std::max(find_seconds_left(), 0.0), run_.options.patience_s, kGuessed, suggest_patience(needed_s_))
          : fmt::format("too large to be assembled in the memory that is left here: {}", kGuessed));
}

bool Validation::may_count(const eigen::Outlook& outlook) {
  Extent extent = extent_;
  extent.factor_flops = outlook.flops;
  extent.factor_entries = outlook.entries;
  extent.modes = 1;
  const double counts_s = calc_clock(2 * predict_costs(extent).factor / static_cast<double>(predict_factorisations(1)));
  if (static_cast<double>(outlook.factor_bytes) >= kRoomUsed * static_cast<double>(eigen::find_memory_left())) {
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
  pulse_.begin("counting the modes by two factorisations");
  return true;
}

void Validation::look_ahead(const Setting& setting) {
  extent_ = find_extent(run_, setting, body_);
  const Costs costs = predict_costs(extent_);
  const double needed = calc_clock(costs.assemble + costs.analyse);
  if (needed >= find_seconds_left()) needed_s_ = needed;
  const std::int64_t left = eigen::find_memory_left();
  left_bytes_ = left + base::find_memory().resident - base_bytes_;
  // K, M, and room to sort their entries.
  if (needed_s_ > 0 || 2 * calc_matrix_bytes() > kRoomUsed * static_cast<double>(left)) {
    guess();
  } else {
    is_analysed_ = true;
    pulse_.begin(fmt::format("assembling {} unknowns", extent_.unknowns));
    const fem::System system = assemble_body(run_, setting, body_, solved_);
    held_bytes_ = base::find_memory().resident;
    read_bytes_ = base::find_memory().peak;
    assembled_s_ = base::get_process_cpu_s();
    pulse_.begin("analysing the factorisation");
    outlook_ = name_errors(body_.source, run_, [&] {
      return eigen::look_ahead({system.stiffness, system.mass, make_layout(body_.pieces)}, make_options(run_, setting),
                               [&](const eigen::Outlook& outlook) { return may_count(outlook); });
    });
  }
  extent_.factor_flops = outlook_.flops;
  extent_.factor_entries = outlook_.entries;
}

void Validation::predict_modes() {
  if (!knows_volume()) {
    extent_.modes = complete(extent_).modes;
    notes_.push_back(fmt::format("the modes are not known, as nothing but the size of the mesh is: the figures are for {}", extent_.modes));
    return;
  }
  estimate_ = estimate_modes(solved_.materials.list, solved_.volume_m3,
                             body_.estimate ? body_.estimate->area_m2 : calc_area(body_.surface.vertices_m, body_.surface.triangles),
                             run_.job.band_hz[0], run_.job.band_hz[1]);
  if (run_.job.max_modes) {
    const auto most = static_cast<double>(*run_.job.max_modes);
    for (double* count : {&estimate_.count, &estimate_.low, &estimate_.high}) *count = std::min(*count, most);
  }
  extent_.is_thin = estimate_.slenderness > kVeryThin;
  extent_.modes = outlook_.modes.value_or(std::llround(estimate_.count));
  if (outlook_.modes) return;
  notes_.push_back(fmt::format("the modes are estimated from volume and surface (Weyl's law), between {:.0f} and {:.0f}{}", estimate_.low,
                               estimate_.high,
                               estimate_.is_thin ? ": its walls are thinner than half a shear wave, where that is rough" : ""));
}

void Validation::predict_memory() {
  const std::int64_t modes = get_most_modes();
  const std::int64_t rows = extent_.unknowns;
  // Update matrices and basis never meet; modes that were found stay while the next slice is factorised. Of the room that a slice's basis
  // has, what is not used takes no memory.
  const bool is_cut = modes > eigen::kSliceModes;
  const std::int64_t found = is_cut ? 8 * rows * modes : 0;
  const std::int64_t columns = 5 * predict_solves(modes) / (4 * count_slices(modes));
  const std::int64_t search =
      outlook_.factor_kept_bytes + (is_cut ? found + 8 * rows * columns : eigen::calc_search_bytes(rows, modes, outlook_.rigid_count));
  const std::int64_t sparse = std::max(outlook_.copies_bytes, outlook_.copies_kept_bytes + std::max(outlook_.factor_bytes + found, search));
  const std::int64_t solve = outlook_.is_dense ? eigen::calc_dense_bytes(rows) : sparse;
  const auto own = static_cast<double>(std::max(held_bytes_ + solve, read_bytes_) - base_bytes_);
  for (std::size_t i = 0; i < kRanks.size(); ++i)
    bytes_[i] = static_cast<std::int64_t>(kRanks[i] * (static_cast<double>(base_bytes_) + kRankBytes) + kMore[i] * own);
}

void Validation::predict_time() {
  const double pace = get_pace();
  costs_ = predict_costs(extent_);
  const double predicted_here = costs_.read + costs_.partition + costs_.assemble;
  for (double Costs::*phase : {&Costs::analyse, &Costs::factor, &Costs::solve, &Costs::orthogonalise, &Costs::check, &Costs::errors,
                               &Costs::collect, &Costs::write})
    costs_.*phase *= pace;
  const double here = assembled_s_ > 0 ? assembled_s_ / std::max(predicted_here, 1e-9) : pace;
  for (double Costs::*phase : {&Costs::read, &Costs::partition, &Costs::assemble}) costs_.*phase *= here;
  for (std::size_t i = 0; i < kRanks.size(); ++i) wall_s_[i] = calc_wall(costs_, extent_, kRanks[i]).sum();
}

/// On one rank, in the memory that is left now.
bool Validation::fits_here() const { return bytes_[0] - base_bytes_ <= left_bytes_; }

Json::Value Validation::describe() const {
  Json::Value root;
  root["ok"] = true;
  Json::Value& mesh = root["mesh"];
  mesh["source"] = body_.source;
  mesh["how"] = body_.estimate ? "estimated" : "made";
  mesh["nodes"] = Json::Int64(extent_.nodes);
  mesh["tets"] = Json::Int64(extent_.tets);
  mesh["components"] = body_.pieces.components;
  mesh["held_nodes"] = Json::Int64(body_.held_nodes);
  mesh["min_dihedral_deg"] = body_.check.min_dihedral_deg;
  mesh["mean_ratio_min"] = body_.check.mean_ratio_min;
  root["unknowns"] = Json::Int64(extent_.unknowns);
  Json::Value& modes = root["modes"];
  modes["count"] = Json::Int64(extent_.modes);
  modes["how"] = outlook_.modes ? "counted" : knows_volume() ? "estimated" : "unknown";
  modes["estimate"] = Json::Int64(std::llround(estimate_.count));
  modes["low"] = Json::Int64(outlook_.modes ? extent_.modes : std::llround(std::floor(estimate_.low)));
  modes["high"] = Json::Int64(get_most_modes());
  root["factor"]["entries"] = Json::Int64(outlook_.entries);
  root["factor"]["flops"] = outlook_.flops;
  root["factor"]["how"] = is_analysed_ ? "analysed" : "guessed";
  for (std::size_t i = 0; i < kRanks.size(); ++i) {
    root["memory_bytes"][std::to_string(kRanks[i])] = Json::Int64(bytes_[i]);
    root["wall_seconds"][std::to_string(kRanks[i])] = wall_s_[i];
  }
  root["cpu_seconds"] = costs_.sum();
  root["seconds_taken"] = find_process_seconds();
  root["fits_here"] = fits_here();
  for (const std::string& note : notes_) root["notes"].append(note);
  for (const std::string& warning : run_.stations.get_warnings()) root["warnings"].append(warning);
  return root;
}

std::string Validation::describe_for_people() const {
  std::string text = fmt::format("{}: well\n{}{} nodes, {} tetrahedra, {} unknowns\n", run_.job.file.string(),
                                 body_.estimate ? "about " : "", extent_.nodes, extent_.tets, extent_.unknowns);
  text += outlook_.modes
              ? fmt::format("{} modes in {:g} .. {:g} Hz, counted by inertia\n", extent_.modes, run_.job.band_hz[0], run_.job.band_hz[1])
              : fmt::format("{} {} modes in {:g} .. {:g} Hz\n", knows_volume() ? "about" : "as for", extent_.modes, run_.job.band_hz[0],
                            run_.job.band_hz[1]);
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

std::string validate_job(MPI_Comm comm, const std::filesystem::path& job_file, const RunOptions& options) {
  RunOptions silent = options;
  silent.quiet = true;
  Validation validation(comm, silent, !options.quiet);
  validation.look(job_file);
  return options.json ? write_json(validation.describe()) : validation.describe_for_people();
}

std::string describe_failure(const std::string& message, int code) {
  Json::Value root;
  root["ok"] = false;
  root["error"] = message;
  root["code"] = code;
  return write_json(root);
}

}  // namespace carillon::io
