#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <system_error>
#include <utility>
#include <vector>

#include "precompute/fem/derivatives.hpp"
#include "precompute/job/job_spec.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/run/accuracy.hpp"
#include "precompute/run/interrupt.hpp"
#include "precompute/run/io/checkpoint_file.hpp"
#include "precompute/run/io/fingerprint.hpp"
#include "precompute/run/io/matrices.hpp"
#include "precompute/run/io/surface_modes.hpp"
#include "precompute/run/known_body.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/of_material.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/bank/write.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {
namespace {

namespace fs = std::filesystem;

bank::Damping make_damping(const fem::Materials& materials) {
  if (materials.list.size() == 1) return bank::make_damping(materials.list[0]);
  bank::Damping damping;
  damping.law = "mixed";
  return damping;
}

/// A single material unchanged; several as their isotropic equivalent, with the mean density.
bank::Material make_material(const SolvedBody& solved) {
  const auto& list = solved.properties.materials.list;
  bank::Material material;
  if (list.size() == 1) {
    material = {list[0].young_modulus_pa, list[0].poisson_ratio, list[0].density_kg_m3, 0.0, 0.0};
    if (list[0].law == material::DampingLaw::rayleigh) {
      material.alpha1_s = list[0].alpha1_s;
      material.alpha2_per_s = list[0].alpha2_per_s;
    }
  } else {
    const material::Equivalent equivalent = material::calc_equivalent(list, solved.properties.volume_m3);
    material = {equivalent.young_modulus_pa, equivalent.poisson_ratio, equivalent.density_kg_m3, 0.0, 0.0};
  }
  return material;
}

std::string make_regions(const SolvedBody& solved) {
  const auto& materials = solved.properties.materials;
  const bool is_plain = materials.list.size() == 1 && !materials.list[0].orthotropic;
  return is_plain ? std::string() : describe_materials(materials, solved.properties.volume_m3).sorted_text();
}

/// Names from the job, the node set or the box; several patches of one entry are numbered.
bank::Supports make_supports(const job::JobSpec& job, const fem::Supports& found) {
  bank::Supports supports;
  base::Json supports_json = base::Json::object();
  std::map<std::int32_t, int> patches, seen;
  for (const fem::Support& support : found.list) ++patches[support.entry];
  for (const fem::Support& support : found.list) {
    const job::Fixed& fixed = job.fixed[support.entry];
    std::string name = !fixed.name.empty() ? fixed.name : fixed.node_set ? *fixed.node_set : fmt::format("box {}", support.entry + 1);
    if (patches[support.entry] > 1) name += fmt::format(":{}", ++seen[support.entry]);
    supports_json["supports"].add(material::write_fixing(fixed.fixing, base::Json::object().set("name", name)));
    supports.centre_m.push_back(support.centre_m);
    supports.normal.push_back(support.normal);
    supports.area_m2.push_back(support.area_m2);
    supports.thickness_m.push_back(support.thickness_m);
  }
  if (!found.list.empty()) supports.text = supports_json.line();
  supports.reaction = found.reaction;
  supports.energy = found.energy;
  return supports;
}

bank::Corrected make_corrected(const SolvedBody& solved) {
  const error_bars::Corrections& found = solved.errors.bars.corrected;
  bank::Corrected corrected;
  for (std::size_t m = 0; m < found.lambda.size(); ++m) {
    corrected.freq_hz.push_back(std::sqrt(found.lambda[m]) / (2 * std::numbers::pi));
    corrected.error_cents.push_back(found.cents[m] + solved.errors.bars.algebraic_cents[m]);
  }
  corrected.correction = found.correction;
  corrected.decay_per_s = fem::calc_decay_per_s(solved.properties.materials, solved.errors.shares, found.lambda);
  return corrected;
}

/// The larger of the values for the mesh's and for the corrected frequency.
std::vector<double> find_facet_cents(const error_bars::ErrorBars& bars) {
  std::vector<double> cents = bars.facet_cents;
  for (std::size_t m = 0; m < cents.size(); ++m) cents[m] = std::max(cents[m], bars.corrected.facet_cents[m]);
  return cents;
}

bank::Proof make_proof(const eigen::Modes& modes) {
  bank::Proof proof;
  for (const eigen::Count& count : modes.proof.counts) {
    proof.cut_hz.push_back(count.freq_hz);
    proof.below.push_back(count.below);
    proof.margin.push_back(std::min(count.margin, 1.0));
  }
  proof.rigid_per_component = modes.proof.rigid_per_component;
  proof.found = modes.proof.found;
  proof.orthonormality = modes.orthonormality_error;
  proof.backward_error = modes.proof.factor_backward_error;
  for (const eigen::Cluster& cluster : modes.proof.clusters) {
    proof.cluster_first.push_back(cluster.first);
    proof.cluster_count.push_back(cluster.count);
  }
  proof.method = modes.proof.method;
  return proof;
}

/// Sensitivities of a bank whose surface still has the mesh's order. Rank 0 only.
bank::Sensitivities make_sensitivities(const material::Material& material, const Body& body, const error_bars::ErrorBars& bars,
                                       const bank::Bank& bank, const fem::Derivatives& derivatives) {
  std::vector<std::uint8_t> fixed;
  for (const std::int32_t row : body.surface.row) fixed.push_back(row < 0 ? 1 : 0);
  const std::size_t count = derivatives.values.size() / derivatives.parameters.size();
  bank::Sensitivities made = bank::calc_sensitivities(bank, material.calc_elasticity_pa(), material.density_kg_m3, count, fixed);
  made.parameters = base::Json::array(derivatives.parameters).line();
  made.by_parameter = derivatives.values;
  for (std::size_t m = 0; m < count; ++m) made.own_error_cents.push_back(bars.corrected.own_cents[m] + bars.algebraic_cents[m]);
  return made;
}

/// Number of the lowest modes with sensitivities: as many as asked for, and those that are within 1 % of the last, which a cut mixes with
/// it.
std::size_t count_sensitive(std::span<const double> lambda, std::size_t asked) {
  constexpr std::size_t kMore = 8;
  std::size_t count = std::min(lambda.size(), asked);
  const std::size_t most = std::min(lambda.size(), asked + kMore);
  while (count < most && lambda[count] < bank::kPairRatio * bank::kPairRatio * lambda[count - 1]) ++count;
  return count;
}

/// Makes the bank without its provenance; moves the surface out of `found.body` and the steps out of `surface_modes`. Rank 0 only.
bank::Bank make_bank(const job::JobSpec& job, Solution& found, io::SurfaceModes& surface_modes, const fem::Derivatives& derivatives) {
  Body& body = found.body;
  const SolvedBody& solved = found.solved;
  const eigen::Modes& modes = solved.modes;
  bank::Bank bank;
  bank.vertices_m = std::move(body.surface.vertices_m);
  bank.triangles = std::move(body.surface.triangles);
  bank.eigenvalue_rad2_s2 = modes.lambda;
  bank.residual = modes.residual;
  bank.decay_per_s = solved.errors.decay_per_s;
  bank.radiation_gain = std::move(surface_modes.radiation_gain);
  bank.shape_scale = std::move(surface_modes.shape_scale);
  bank.shape = std::move(surface_modes.shape);
  bank.algebraic_error_cents = solved.errors.bars.algebraic_cents;
  bank.discretisation_error_cents = solved.errors.bars.discretisation_cents;
  bank.facet_error_cents = find_facet_cents(solved.errors.bars);
  bank.corrected = make_corrected(solved);
  bank.rigid = {solved.properties.rigid.mass_kg, solved.properties.rigid.centre_m, solved.properties.rigid.inertia_kg_m2,
                solved.properties.rigid.volume_m3};
  bank.material = make_material(solved);
  bank.damping = make_damping(solved.properties.materials);
  bank.regions = make_regions(solved);
  bank.supports = make_supports(job, solved.errors.supports);
  bank.proof = make_proof(modes);
  bank.counts = {body.pieces.nodes, body.pieces.tets, body.pieces.components, modes.rigid_count};
  const error_bars::Corrections& corrected = solved.errors.bars.corrected;
  const double low_hz = find_low_hz(job, modes);
  bank.complete = modes.band_count == static_cast<std::int64_t>(modes.lambda.size()) &&
                  (corrected.lambda.empty() || (std::sqrt(corrected.stated_above) >= 2 * std::numbers::pi * job.band_hz[1] &&
                                                std::sqrt(corrected.stated_below) <= 2 * std::numbers::pi * low_hz));
  bank.element = job::to_text(found.setting.element);
  bank.mass = job::to_text(job.mass);
  if (!derivatives.parameters.empty())
    bank.sensitivities = make_sensitivities(solved.properties.materials.list.front(), body, solved.errors.bars, bank, derivatives);
  bank.band_hz = job.band_hz;
  bank::keep_band(bank);
  bank.band_hz[0] = low_hz;
  if (job.max_modes) bank::keep_lowest(bank, static_cast<std::size_t>(*job.max_modes));
  return bank;
}

/// Opens the progress file and registers it with the log.
void open_progress(Run& run) {
  comm::Communicator(run.comm).agree([&] {
    const fs::path& file = run.options.progress;
    if (!run.comm.is_root() || file.empty()) return;
    for (const fs::path& other : {run.job.file, job::get_input(run.job), run.job.bank, job::find_resolved_path(run.job.bank)}) {
      std::error_code error;  // missing files are equal to none
      if (!other.empty() && (file == other || fs::equivalent(file, other, error)))
        throw InputError(fmt::format("{}: progress would be appended to a file of this job; give another with --progress", file.string()));
    }
    run.progress = std::make_unique<ProgressReporter>(file);
    run.log.set_listener([progress = run.progress.get()](const std::string& name) { progress->begin(name); });
  });
}

/// Rejects unused solver options.
void check_options_used(const comm::Communicator& comm) {
  comm::Communicator(comm).agree([] {
    const std::vector<std::string> unused = petsc::find_unused_options();
    if (!unused.empty())
      throw InputError(
          fmt::format("the solver option \"{}\" was not used: it is misspelt, or belongs to a solver that did not run", unused[0]));
  });
}

/// The bank of the solution, on rank 0 only. Frees the shapes of all nodes.
bank::Bank collect_bank(Run& run, Solution& found) {
  SolvedBody& solved = found.solved;
  run.log.begin("collect", run.job.sensitivities > 0 ? "shapes on the surface, radiation gains, sensitivities"
                                                     : "shapes on the surface, radiation gains");
  std::vector<double> omega;
  for (const double lambda : solved.modes.lambda) omega.push_back(std::sqrt(lambda));
  io::SurfaceModes surface_modes = io::calc_surface_modes(run.comm, solved.modes.shapes, omega, found.body.surface);
  fem::Derivatives derivatives;
  if (run.job.sensitivities > 0 && !omega.empty()) {
    const std::size_t count = count_sensitive(solved.modes.lambda, static_cast<std::size_t>(run.job.sensitivities));
    derivatives = fem::calc_derivatives(run.comm, found.body.pieces.local, solved.properties.materials.list.front(), run.job.mass,
                                        std::span(solved.modes.lambda).first(count), solved.modes.shapes);
  }
  solved.modes.shapes.reset();
  bank::Bank bank;
  comm::Communicator(run.comm).agree([&] {
    if (run.comm.is_root()) bank = make_bank(run.job, found, surface_modes, derivatives);
  });
  run.log.end();
  return bank;
}

constexpr double kAudibleCents = 50.0;

/// Warning of wide error bars, with the remedy; empty: none. is_asked: the job has accuracy_cents, which was met.
std::string describe_wide_bars(const bank::Bank& bank, const Setting& setting, bool is_asked) {
  const std::vector<double>& cents = bank.corrected.error_cents;
  if (cents.empty() || is_asked) return {};
  if (std::isinf(*std::max_element(cents.begin(), cents.end())))
    return "frequencies have no error bars: among so few modes of T4 with a lumped mass a whole family may be missing; use a consistent "
           "mass, \"element\": \"T10\", or a wider band";
  // Errors within the width of a strongly damped mode's resonance are inaudible.
  std::size_t worst = 0, wide = 0;
  double worst_cents = 0.0;
  for (std::size_t m = 0; m < cents.size(); ++m) {
    const double omega = 2.0 * std::numbers::pi * bank.corrected.freq_hz[m];
    const double half_width_cents = 1200.0 * std::log2(1.0 + bank.corrected.decay_per_s[m] / omega);
    if (!(cents[m] > std::max(kAudibleCents, half_width_cents))) continue;
    ++wide;
    if (cents[m] > worst_cents) worst_cents = cents[worst = m];
  }
  if (wide == 0) return {};
  return fmt::format(
      "frequencies can be wrong by {:.0f} cents (estimate, mode {}; {} of {} modes by more than {:g} and than half the width of their "
      "resonance): use {}a finer mesh, or \"accuracy_cents\" in the job",
      worst_cents, worst + 1, wide, cents.size(), kAudibleCents,
      setting.element == job::Element::T4 ? "\"element\": \"T10\" (--order 2), " : "");
}

std::string describe_result(const bank::Bank& bank) {
  std::string text = fmt::format("{}\n{}", bank::describe_completeness(bank), bank::describe_accuracy(bank));
  if (bank.mode_count() > 0) {
    std::vector<double> played_hz;
    for (std::size_t m = 0; m < bank.mode_count(); ++m) played_hz.push_back(bank::find_played_hz(bank, m));
    const auto [low, high] = std::minmax_element(played_hz.begin(), played_hz.end());
    text += fmt::format("\n{:.2f} Hz to {:.2f} Hz as played; {:.2f} Hz to {:.2f} Hz on the mesh", *low, *high, bank.freq_hz(0),
                        bank.freq_hz(bank.mode_count() - 1));
  }
  return text;
}

}  // namespace

void write_bank(Run& run, const bank::Bank& bank) {
  std::string why = run.job.shapes == job::Shapes::exact ? "as the job wants" : "";
  std::optional<bank::PackedBank> packed;
  if (why.empty()) packed = bank::try_packed(bank, why);
  if (packed) {
    packed->bank.provenance = bank.provenance;  // pack/error_db has the error
    bank::write_packed_bank(*packed, run.bank);
  } else {
    bank::write_bank(bank, run.bank);
  }
  run.log.print(fmt::format("{} bytes, {}", fs::file_size(run.bank),
                            packed ? "shapes packed, " + bank::describe(*packed->bank.packing) : fmt::format("exact shapes ({})", why)));
}

namespace {

/// "3", "3, 4 and 7", "3, 4, 7 and 12 more"
std::string list_numbers(const std::vector<std::size_t>& numbers) {
  constexpr std::size_t kMost = 8;
  const std::size_t named = numbers.size() > kMost ? kMost : numbers.size() - 1;
  const std::string rest = numbers.size() > kMost ? fmt::format("{} more", numbers.size() - named) : fmt::format("{}", numbers.back());
  return named == 0
             ? rest
             : fmt::format("{} and {}", fmt::join(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(named), ", "), rest);
}

/// Modes of the bank and modes left out that may lie on the other side of an end of the band, and where modes of the body may be missing;
/// empty: none.
std::string describe_ends(const job::JobSpec& job, const bank::Bank& bank, const error_bars::Corrections& corrected) {
  if (corrected.lambda.empty()) return {};
  const auto to_hz = [](double lambda) { return std::sqrt(lambda) / (2 * std::numbers::pi); };
  const auto is_near = [](double hz, double end_hz, double cents) { return std::abs(1200 * std::log2(hz / end_hz)) <= cents; };
  std::vector<std::string> parts;
  for (const double end_hz : job.band_hz) {
    const bool is_low = end_hz == job.band_hz[0];
    std::vector<std::size_t> near;
    for (std::size_t m = 0; m < bank.mode_count(); ++m)
      if (is_near(bank.corrected.freq_hz[m], end_hz, bank.corrected.error_cents[m])) near.push_back(m + 1);
    if (!near.empty())
      parts.push_back(fmt::format("mode{} {} may lie on either side of the band's end at {:g} Hz, within {} error bar{}",
                                  near.size() == 1 ? "" : "s", list_numbers(near), end_hz, near.size() == 1 ? "its" : "their",
                                  near.size() == 1 ? "" : "s"));
    if (!is_low && !bank.complete && job.max_modes) continue;
    std::vector<double> left_hz;
    for (std::size_t m = 0; m < corrected.lambda.size(); ++m)
      if (const double hz = to_hz(corrected.lambda[m]);
          (is_low ? !bank::is_above_begin(hz, end_hz) : !bank::is_below_end(hz, end_hz)) && is_near(hz, end_hz, corrected.cents[m]))
        left_hz.push_back(hz);
    if (!left_hz.empty())
      parts.push_back(fmt::format("{} mode{} left out, {} {:.2f} Hz, may lie {} {:g} Hz", left_hz.size(), left_hz.size() == 1 ? "" : "s",
                                  is_low ? "up to" : "from", is_low ? std::ranges::max(left_hz) : std::ranges::min(left_hz),
                                  is_low ? "above" : "below", end_hz));
    if (const double hz = to_hz(corrected.complete_above); is_low && hz > end_hz)
      parts.push_back(fmt::format("modes below {:.4g} Hz may be missing", hz));
    if (const double hz = to_hz(corrected.complete_below); !is_low && hz < end_hz)
      parts.push_back(fmt::format("modes above {:.4g} Hz may be missing", hz));
  }
  return fmt::format("{}", fmt::join(parts, "; "));
}

/// The record in the bank is made before the bank is written; <bank>.resolved.json includes the time of writing.
RunSummary write_outputs(Run& run, const Solution& found, const AccuracyReport& accuracy, const AirReport& air,
                         const CouplingReport& coupling, bank::Bank bank) {
  RunSummary summary;
  summary.bank = run.job.bank;
  summary.resolved = job::find_resolved_path(run.job.bank);
  if (run.comm.is_root()) summary.warning = describe_wide_bars(bank, found.setting, run.job.accuracy_cents.has_value());
  const std::string end = run.comm.is_root() ? describe_ends(run.job, bank, found.solved.errors.bars.corrected) : "";
  const fs::path folder = fs::absolute(summary.bank).parent_path();
  const auto make_record = [&](const Measured& measured) {
    base::Json record = describe_run(run, found, measured);
    if (run.job.accuracy_cents) record["accuracy"] = describe_accuracy(accuracy);
    if (!air.why.empty()) {
      record["air"].set("solved", air.is_solved).set("why", air.why);
      if (!air.result.empty()) record["air"]["result"] = air.result;
    }
    if (!end.empty()) record["end_of_band"] = end;
    if (!coupling.result.empty()) record["coupling"] = coupling.result;
    if (!summary.warning.empty()) record["warnings"].append(summary.warning);
    return job::resolved_json(run.job, folder, record.sorted_text());
  };
  run.log.begin("write", summary.bank.string());
  Measured measured = measure(run.comm);
  comm::Communicator(run.comm).agree([&] {
    if (!run.comm.is_root()) return;
    bank.provenance = make_record(measured);
    write_bank(run, bank);
    summary.result = describe_result(bank) + (end.empty() ? "" : "\n" + end);
  });
  run.log.end();
  measured = measure(run.comm);
  comm::Communicator(run.comm).agree([&] {
    if (run.comm.is_root()) base::write_file(job::find_resolved_path(run.bank), make_record(measured));
  });
  return summary;
}

/// The checkpoint must not replace a file of the job.
void check_checkpoint(const Run& run) {
  const fs::path& file = run.options.checkpoint;
  base::check_writable(file, "checkpoint");
  std::vector<fs::path> others{run.job.file, run.job.bank, job::find_resolved_path(run.job.bank), run.options.progress};
  others.push_back(job::get_input(run.job));
  for (const fs::path& other : others) {
    std::error_code ignored;
    if (other.empty()) continue;
    if (fs::absolute(file).lexically_normal() == fs::absolute(other).lexically_normal() || fs::equivalent(file, other, ignored))
      throw InputError(fmt::format("{}: the checkpoint would overwrite a file of this job; give it another name", file.string()));
  }
}

void open_checkpoint(Run& run) {
  if (run.options.checkpoint.empty()) return;
  comm::Communicator(run.comm).agree([&] {
    if (run.comm.is_root()) check_checkpoint(run);
  });
  io::CheckpointHost host{[&run](const std::string& text) { run.log.print(text); }, [&run](const std::string& text) { run.log.warn(text); },
                          is_stop_asked, set_news};
  run.checkpoint = std::make_shared<io::CheckpointFile>(run.comm, run.options.checkpoint, run.options.checkpoint_every_s,
                                                        io::find_job_fingerprint(run.job, run.options.solver_options), std::move(host));
}

/// Solves the setting of the job.
Solution solve_once(Run& run) {
  Solution found;
  found.setting = job::get_setting(run.job);
  found.body = make_body(run, found.setting);
  found.solved = solve_body(run, found.setting, found.body);
  return found;
}

RunSummary carry_out(Run& run, const fs::path& job_file) {
  open_job(run, job_file);
  io::check_matrices(run.comm, run.options.matrices);
  open_progress(run);
  if (run.job.analytic) {
    RunSummary summary = write_known_body(run);
    if (run.progress) run.progress->finish();
    return summary;
  }
  open_checkpoint(run);
  AccuracyReport accuracy;
  Solution found = run.job.accuracy_cents ? solve_to_accuracy(run, accuracy) : solve_once(run);
  check_options_used(run.comm);
  if (run.checkpoint && !has_later_stages(run.job)) run.checkpoint->finish();
  CouplingReport coupling = couple_modes(run, found);
  bank::Bank bank = collect_bank(run, found);
  bank.quartic = std::move(coupling.energy);
  const AirReport air = add_air(run, bank);
  if (run.checkpoint) run.checkpoint->finish();
  RunSummary summary = write_outputs(run, found, accuracy, air, coupling, std::move(bank));
  if (run.checkpoint) run.checkpoint->remove();
  if (run.progress) run.progress->finish();
  return summary;
}

/// Summary of a run stopped by a signal.
RunSummary describe_stop(const Run& run) {
  RunSummary summary;
  summary.is_stopped = true;
  summary.result = fmt::format("stopped by {}; {}", find_stop_name(),
                               run.checkpoint->was_saved() ? "the same command resumes from " + run.options.checkpoint.string()
                                                           : "the run can be resumed from an earlier checkpoint, if any");
  return summary;
}

}  // namespace

RunSummary run_job(const comm::Communicator& comm, const fs::path& job_file, const RunOptions& options) {
  Run run(comm, options);
  try {
    return carry_out(run, job_file);
  } catch (const eigen::Stopped&) {
    return describe_stop(run);
  }
}

}  // namespace carillon::run
