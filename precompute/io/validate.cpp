// Method:     The first half of a run, then the analysis of its factorisation. Memory of one rank: what is held after the assembly, as
// measured
//             here, and what the solver's own checks would ask for; of several ranks by factors measured on the bodies of
//             tests/bench/predict. Time: the parts done here as measured, the others by costs.cpp at the pace of what was measured.
// Source:     none. Deviations: none.
#include "precompute/io/validate.hpp"

#include <fmt/core.h>
#include <json/json.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/needs.hpp"
#include "precompute/io/accuracy.hpp"
#include "precompute/io/describe_run.hpp"
#include "precompute/io/open_job.hpp"
#include "precompute/io/solve_body.hpp"
#include "precompute/io/weyl.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/slabs/read_parallel.hpp"
#include "runtime/config/printable.hpp"

namespace carillon::io {
namespace {

constexpr double kCountSeconds = 20;  // Two factorisations that take longer are not made to count.
constexpr double kVeryThin = 100;     // slenderness of bodies whose lowest modes are mended
constexpr double kRoomUsed = 0.8;     // of the memory that is left, at most
constexpr std::array<int, 3> kRanks{1, 2, 4};
// All ranks together, over one: halos, the interface between the ranks, which is eliminated last, and what MPI holds for each.
constexpr std::array<double, 3> kMore{1.3, 1.42, 1.55};
constexpr double kRankBytes = 10e6;

/// Of this process, now [byte].
std::int64_t find_resident_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmRSS:")) return std::strtoll(line.c_str() + 6, nullptr, 10) * 1024;
  return 0;
}

double calc_area(const Surface& surface) {
  double area = 0;
  for (const auto& t : surface.triangles) {
    const mesh::Vec3 &a = surface.vertices_m[t[0]], &b = surface.vertices_m[t[1]], &c = surface.vertices_m[t[2]];
    const mesh::Vec3 u{b[0] - a[0], b[1] - a[1], b[2] - a[2]}, v{c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    area += 0.5 * std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
  }
  return area;
}

class Validation {
 public:
  Validation(MPI_Comm comm, const RunOptions& options, bool tells)
      : run_(comm, options), tells_(tells), base_bytes_(find_resident_bytes()) {}

  void look(const std::filesystem::path& job_file);
  Json::Value describe() const;
  std::string describe_for_people() const;

 private:
  void look_ahead(const Setting& setting);
  void look_from_afar(const Setting& setting);
  void say(const std::string& what) const;
  double calc_matrix_bytes() const;
  void guess();
  bool may_count(const eigen::Outlook& outlook) const;
  void predict_modes();
  void predict_memory();
  void predict_time();
  double get_pace() const;
  bool fits_here() const;
  std::int64_t get_most_modes() const { return outlook_.modes.value_or(std::llround(std::ceil(estimate_.high))); }

  Run run_;
  bool tells_ = true;        // of its progress
  std::int64_t base_bytes_;  // of a rank that has nothing yet
  Body body_;
  SolvedBody solved_;
  eigen::Outlook outlook_;
  std::int64_t held_bytes_ = 0;  // after the assembly
  std::int64_t read_bytes_ = 0;  // at the worst moment until then
  double assembled_s_ = 0;       // CPU seconds until then
  double speed_ = 1;
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
  open_job(run_, job_file, spec::BankKey::optional);
  Setting setting = get_setting(run_.job);
  if (run_.job.accuracy_cents) {
    setting = find_first_setting(run_);
    notes_.push_back("\"accuracy_cents\" chooses the mesh by trial: this is the first and coarsest trial, and those that follow need more");
  }
  Patience patience{.seconds = run_.options.patience_s};
  say(fmt::format("reading {}", run_.job.body ? io::describe(*run_.job.body, {setting.nodes, setting.edge_m}) : run_.job.mesh.string()));
  body_ = make_body(run_, setting, &patience);
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
  const double foreseen = predict_costs(one).factor / static_cast<double>(predict_factorisations(1));
  // Small factorisations say little.
  constexpr double kTrustSeconds = 0.1;
  return (outlook_.factor_seconds + kTrustSeconds / speed_) / (foreseen + kTrustSeconds);
}

/// Progress on standard error.
void Validation::say(const std::string& what) const {
  if (run_.rank == 0 && tells_) fmt::print(stderr, "carillon-precompute: {}\n", config::printable(what));
}

/// A surface that takes long to mesh: all from its volume, area and thickness.
void Validation::look_from_afar(const Setting& setting) {
  const BodyEstimate& known = *body_.estimate;
  speed_ = measure_speed();
  extent_ = {};
  extent_.is_quadratic = setting.element == spec::Element::T10;
  extent_.is_lumped = run_.job.mass == spec::Mass::lumped;
  extent_.nodes = known.nodes;
  // One layer of elements has two tetrahedra of ten nodes for every four nodes, a solid two for three.
  extent_.tets = extent_.is_quadratic ? known.nodes * 3 / 5 : known.nodes * 4;
  extent_.unknowns = 3 * known.nodes;
  extent_.surface_nodes = known.nodes / 2;
  left_bytes_ = eigen::find_memory_left() + find_resident_bytes() - base_bytes_;
  solved_.materials.list = {run_.job.material};
  solved_.volume_m3 = {known.volume_m3};
  guess();
  notes_.push_back(fmt::format(
      "the surface was not meshed, since that takes longer than {:g} s (--patience): its nodes are estimated from volume ({:.4g} m^3), "
      "area ({:.4g} m^2) and thickness ({:.4g} m), to a factor of two, and so is all that follows; fixed nodes are not counted",
      run_.options.patience_s, known.volume_m3, known.area_m2, known.thickness_m));
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
  held_bytes_ = find_resident_bytes() + static_cast<std::int64_t>(calc_matrix_bytes());
  extent_.factor_flops = outlook_.flops;
  extent_.factor_entries = outlook_.entries;
  if (body_.estimate) return;
  notes_.push_back(
      "too large to be assembled in the memory that is left here: memory and time are guessed by powers of the unknowns, to a factor of "
      "two");
}

bool Validation::may_count(const eigen::Outlook& outlook) const {
  Extent extent = extent_;
  extent.factor_flops = outlook.flops;
  extent.factor_entries = outlook.entries;
  extent.modes = 1;
  const double factor_s = predict_costs(extent).factor / static_cast<double>(predict_factorisations(1)) / speed_;
  return 2 * factor_s < kCountSeconds &&
         static_cast<double>(outlook.factor_bytes) < kRoomUsed * static_cast<double>(eigen::find_memory_left());
}

void Validation::look_ahead(const Setting& setting) {
  speed_ = measure_speed();
  extent_ = find_extent(run_, setting, body_);
  const std::int64_t left = eigen::find_memory_left();
  left_bytes_ = left + find_resident_bytes() - base_bytes_;
  // K, M, and room to sort their entries.
  if (2 * calc_matrix_bytes() > kRoomUsed * static_cast<double>(left)) {
    guess();
  } else {
    say(fmt::format("assembling {} unknowns", extent_.unknowns));
    const fem::System system = assemble_body(run_, setting, body_, solved_);
    held_bytes_ = find_resident_bytes();
    read_bytes_ = find_peak_bytes();
    assembled_s_ = find_cpu_seconds();
    say("analysing the factorisation");
    outlook_ = name_errors(body_.source, run_, [&] {
      return eigen::look_ahead({system.stiffness, system.mass, make_layout(body_.pieces)}, make_options(run_, setting),
                               [&](const eigen::Outlook& outlook) { return may_count(outlook); });
    });
  }
  extent_.factor_flops = outlook_.flops;
  extent_.factor_entries = outlook_.entries;
}

void Validation::predict_modes() {
  estimate_ = estimate_modes(solved_.materials.list, solved_.volume_m3, body_.estimate ? body_.estimate->area_m2 : calc_area(body_.surface),
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
  const double foreseen_here = costs_.read + costs_.partition + costs_.assemble;
  for (double Costs::*phase : {&Costs::analyse, &Costs::factor, &Costs::solve, &Costs::orthogonalise, &Costs::check, &Costs::errors,
                               &Costs::collect, &Costs::write})
    costs_.*phase *= pace;
  const double here = assembled_s_ > 0 ? assembled_s_ / std::max(foreseen_here, 1e-9) : pace;
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
  modes["how"] = outlook_.modes ? "counted" : "estimated";
  modes["estimate"] = Json::Int64(std::llround(estimate_.count));
  modes["low"] = Json::Int64(outlook_.modes ? extent_.modes : std::llround(std::floor(estimate_.low)));
  modes["high"] = Json::Int64(get_most_modes());
  root["factor"]["entries"] = Json::Int64(outlook_.entries);
  root["factor"]["flops"] = outlook_.flops;
  for (std::size_t i = 0; i < kRanks.size(); ++i) {
    root["memory_bytes"][std::to_string(kRanks[i])] = Json::Int64(bytes_[i]);
    root["wall_seconds"][std::to_string(kRanks[i])] = wall_s_[i];
  }
  root["cpu_seconds"] = costs_.sum();
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
              : fmt::format("about {} modes in {:g} .. {:g} Hz\n", extent_.modes, run_.job.band_hz[0], run_.job.band_hz[1]);
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
