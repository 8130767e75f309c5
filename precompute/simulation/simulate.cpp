// Method: steps of transient::Motion feed emission::Emission; energy books every 0.01 s.
// Source: docs/equations.md E11 and E14; O'Brien, Cook and Essl 2001.
#include "precompute/simulation/simulate.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/job/simulation.hpp"
#include "precompute/run/interrupt.hpp"
#include "precompute/run/io/progress_file.hpp"
#include "precompute/run/meshing.hpp"
#include "precompute/run/run_log.hpp"
#include "precompute/run/same_start.hpp"
#include "precompute/simulation/checkpoint.hpp"
#include "precompute/simulation/emission/emission.hpp"
#include "precompute/simulation/emission_input.hpp"
#include "precompute/simulation/outputs.hpp"
#include "precompute/simulation/simulation.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/host.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::simulation {
namespace {

namespace fs = std::filesystem;

constexpr int kTrialSteps = 200;
constexpr std::int64_t kTrialSamples = 64, kTimedSamples = 48;  // of the trial's sound
constexpr int kMaxPredictedRanks = 1024;
constexpr std::int64_t kPictureBytes = 40 << 20;        // spectrogram, twice the measured memory
constexpr std::int64_t kOutputLibraryBytes = 24 << 20;  // libraries loaded for writing files
constexpr double kSurfaceBytesPerNode = 8192;  // blocks of the recorded surface: two triangles of 256 samples, of all ranks and of one
constexpr double kFilmBytesPerNode = 256;      // motion frames

/// Bytes of a run on top of those before its first step, maximum over ranks.
std::int64_t count_later_bytes(const Simulation& simulation, int ranks, bool has_checkpoint, double finer) {
  const job::SimulationSpec& spec = simulation.spec;
  const transient::Assembly& assembly = *simulation.bodies.assembly;
  constexpr std::int64_t kNumber = sizeof(double);
  std::int64_t arrivals = 0, later = kOutputLibraryBytes;  // half-samples of all receivers; at the end of the run
  if (simulation.makes_sound()) {
    const emission::Options sound = make_emission_options(spec, simulation.motion->get_steps_per_sample(), false);
    const auto frames = static_cast<std::int64_t>(sound.frames);
    arrivals = 2 * kNumber * frames * static_cast<std::int64_t>(sound.receivers.size());
    later += arrivals / 2 + 3 * kNumber * frames;  // channels, and the sum for one of them
  }
  if (!spec.spectrogram.empty()) later += kPictureBytes;
  const double nodes = finer * assembly.node_count(), elements = finer * assembly.element_count();
  if (!spec.surface.empty()) later += static_cast<std::int64_t>(nodes * kSurfaceBytesPerNode);
  if (!spec.motion.empty()) later += static_cast<std::int64_t>(nodes * kFilmBytesPerNode);
  // State of this rank (a vector grown by doubling); on rank 0 also that of all ranks and the file bytes.
  const std::int64_t state = has_checkpoint ? kOutputLibraryBytes + (3 + 2 * ranks) * arrivals +
                                                  static_cast<std::int64_t>(3 * kNumber * (30.0 * nodes + 25.0 * elements))
                                            : 0;
  return arrivals + std::max(later, state);
}

/// CPU seconds of one sound sample, from surfaces at rest, after warm-up of all stages.
double measure_sound(const comm::Communicator& comm, const Simulation& simulation) {
  if (!simulation.makes_sound()) return 0.0;
  const int steps = simulation.motion->get_steps_per_sample();
  emission::Options options = make_emission_options(simulation.spec, steps, false);
  options.surface_file.clear();
  options.frames = kTrialSamples + kTimedSamples;
  emission::Emission sound(comm, make_surface_part(*simulation.domain, simulation.spec), options);
  const auto play = [&](std::int64_t samples) {
    const double before = base::get_process_cpu_s();
    for (std::int64_t n = 0; n < samples * steps; ++n) sound.add_step(&simulation.motion->get_u()[0].x);
    return (base::get_process_cpu_s() - before) / static_cast<double>(samples);
  };
  play(kTrialSamples);
  return play(kTimedSamples);
}

/// From a few steps and sound samples. finer: nodes of the job over nodes of these meshes; program_bytes: memory before the bodies were
/// made. Collective.
std::string predict(const comm::Communicator& comm, Simulation& simulation, const SimulateOptions& options, double finer,
                    std::int64_t program_bytes) {
  transient::Motion& motion = *simulation.motion;
  const double before = base::get_process_cpu_s();
  for (int step = 0; step < kTrialSteps; ++step) motion.advance();
  const double step_cpu_s = (base::get_process_cpu_s() - before) / kTrialSteps * finer;
  const double sound_cpu_s = measure_sound(comm, simulation) * std::pow(finer, 2.0 / 3.0);
  // Element size and step scale with the cube root of the nodes.
  const double slower = std::cbrt(finer), steps = std::ceil(simulation.spec.duration_s / motion.get_step_s() * slower);
  const double own_cpu_s = steps * step_cpu_s + simulation.spec.duration_s * simulation.spec.sample_rate_hz * sound_cpu_s;
  const double cpu_s = comm.sum(own_cpu_s), most_cpu_s = comm.max(own_cpu_s), sound_s = comm.sum(sound_cpu_s);
  const std::vector<std::int64_t> peaks = run::gather_peak_bytes(comm);
  const auto bodies_bytes = static_cast<double>((peaks.empty() ? 0 : *std::max_element(peaks.begin(), peaks.end())) - program_bytes);
  const auto count_bytes = [&](int ranks) {
    return program_bytes + static_cast<std::int64_t>(finer * std::max(0.0, bodies_bytes)) +
           count_later_bytes(simulation, ranks, !options.checkpoint.empty(), finer);
  };
  const double elements = finer * simulation.bodies.assembly->element_count(), nodes = finer * simulation.bodies.assembly->node_count();
  base::Json record = base::Json::object();
  record.set("step_s", base::significant(motion.get_step_s() / slower, 6)).set("steps", base::significant(steps, 12));
  record.set("longest_step_s", base::significant(motion.get_longest_step_s() / slower, 6));
  record.set("elements", std::llround(elements)).set("nodes", std::llround(nodes)).set("ranks", comm.size());
  record.set("seconds", base::significant(most_cpu_s, 3)).set("memory_bytes_a_rank", count_bytes(comm.size()));
  record.set("cpu_seconds", base::significant(cpu_s, 3));
  record.set("sound_cpu_seconds", base::significant(simulation.spec.duration_s * simulation.spec.sample_rate_hz * sound_s, 3));
  // Same format as carillon-precompute --validate, for the queue: ranks are counted as if not sharing the bodies.
  base::Json memory = base::Json::object();
  for (int ranks = 1; ranks <= kMaxPredictedRanks; ranks *= 2) memory.set(std::to_string(ranks), ranks * count_bytes(ranks));
  record.set("memory_bytes", std::move(memory)).set("warnings", base::Json::array(simulation.spec.warnings));
  const std::string note =
      finer > 1.0 ? fmt::format(
                        "meshes were made with 1 node for {:.3g}, since theirs would take longer than the {:g} s of --patience: all "
                        "of this is scaled from there, to a factor of two; --patience {:.0f} or more makes them",
                        finer, options.patience_s, 10 * std::ceil(finer * options.patience_s / 10))
                  : "";
  if (finer > 1.0) record.set("note", note);
  if (options.json) return record.text();
  return fmt::format(
      "{:.0f} elements, {:.0f} nodes\nstep {:.4g} s (the longest stable one is {:.4g} s), {:.0f} steps\nabout {:.3g} CPU s on {} rank{}, "
      "of "
      "which sound {:.0f} %; {:.0f} MB a rank{}",
      elements, nodes, motion.get_step_s() / slower, motion.get_longest_step_s() / slower, steps, cpu_s, comm.size(),
      comm.size() == 1 ? "" : "s", 100.0 * simulation.spec.duration_s * simulation.spec.sample_rate_hz * sound_s / std::max(1e-9, cpu_s),
      static_cast<double>(count_bytes(comm.size())) / 1e6, note.empty() ? "" : "\n" + note);
}

constexpr double kNodesPerSecond = 20000.0;  // meshing, partition and some hundred steps
constexpr double kBytesPerNode = 100.0;      // of mesh files, lower bound
constexpr long long kCoarseNodes = 1000;     // trial mesh that relates edge length to nodes
constexpr double kSurfaceShare = 5.0;        // meshing time of a surface over that of a shape

/// Requested nodes; 0: the mesher's default.
double estimate_nodes(const job::Body& body, int order) {
  if (body.nodes) return static_cast<double>(*body.nodes);
  if (!body.edge_m || body.shape.empty()) return 0.0;
  run::MesherWords unused;
  const mesh::TetMesh coarse = run::make_body_mesh(body, order, {.nodes = kCoarseNodes, .edge_m = {}}, unused);
  const std::size_t width = coarse.nodes_per_tet();
  double edges_m = 0.0;
  for (std::size_t t = 0; t < static_cast<std::size_t>(coarse.tet_count()); ++t)
    edges_m += norm(coarse.nodes_m[coarse.tets[width * t + 1]] - coarse.nodes_m[coarse.tets[width * t]]);
  edges_m /= static_cast<double>(coarse.tet_count());
  return static_cast<double>(coarse.nodes_m.size()) * std::pow(edges_m / *body.edge_m, 3);
}

/// Reduces the nodes of shapes and surfaces so that meshing and preparation take `seconds`. Returns the largest ratio of nodes before to
/// after; 1: unchanged. Throws InputError for a mesh file too large to read in time. Not collective.
double coarsen(job::SimulationSpec& spec, double seconds) {
  const double most = std::max(static_cast<double>(kCoarseNodes), kNodesPerSecond * seconds / static_cast<double>(spec.bodies.size()));
  double finer = 1.0;
  for (job::SimulatedBody& body : spec.bodies) {
    if (!body.mesh.empty()) {
      std::error_code error;  // reported by the reader of the mesh
      const auto bytes = std::filesystem::file_size(body.mesh, error);
      if (!error && static_cast<double>(bytes) / kBytesPerNode > most)
        throw InputError(
            fmt::format("{}: the mesh {} has {:.0f} MB, and is not read in {:g} s; {} or more reads it", body.place, body.mesh.string(),
                        static_cast<double>(bytes) / 1e6, seconds,
                        fmt::format("--patience {:.0f}", 10 * std::ceil(static_cast<double>(bytes) / kBytesPerNode *
                                                                        static_cast<double>(spec.bodies.size()) / kNodesPerSecond / 10))));
    }
    if (!body.body) continue;
    const double own = body.body->shape.empty() ? std::max(static_cast<double>(kCoarseNodes), most / kSurfaceShare) : most;
    const double nodes = estimate_nodes(*body.body, body.element == job::Element::T10 ? 2 : 1);
    if (nodes <= own) continue;
    finer = std::max(finer, nodes / own);
    body.body->nodes = static_cast<long long>(own);
    body.body->edge_m.reset();
  }
  return finer;
}

constexpr std::uint64_t kMaxJobBytes = 16 << 20;
constexpr double kBookIntervalS = 0.01;       // simulated time
constexpr std::int64_t kPollSamples = 16;     // samples between two polls of signals
constexpr std::int64_t kMeasureSamples = 17;  // samples between two measurements of the sound's CPU time

/// One line on rank 0.
struct Log {
  const comm::Communicator& comm;
  bool quiet;
  void print(const std::string& text) const {
    if (!comm.is_root() || quiet) return;
    fmt::print("{}\n", text);
    std::fflush(stdout);
  }
  void warn(const std::string& text) const {
    if (comm.is_root()) fmt::print(stderr, "carillon-simulate: warning: {}\n", base::printable(text));
  }
};

job::SimulationSpec read_spec(const comm::Communicator& comm, const fs::path& file, const SimulateOptions& options, std::string& text) {
  text = comm.broadcast([&] { return base::read_file(file, "job file", kMaxJobBytes); });
  run::check_same(comm, "jobs", run::look_at_job(file, kMaxJobBytes));
  job::SimulationSpec spec = comm.agree([&] { return job::parse_simulation(text, fs::absolute(file)); });
  const auto replace = [](fs::path& path, const fs::path& other) {
    if (!other.empty()) path = fs::absolute(other).lexically_normal();
  };
  replace(spec.sound, options.sound);
  replace(spec.spectrogram, options.spectrogram);
  replace(spec.surface, options.surface);
  replace(spec.motion, options.motion);
  replace(spec.record, options.record);
  for (const job::SimulationOutput& output : job::kSimulationOutputs)
    run::check_same(comm, fmt::format("{} to write", output.name), run::look_at_place(spec.*output.file));
  comm.agree([&] {
    if (!comm.is_root()) return;
    if (const job::SimulationOutput* output = job::find_overwriting_output(spec))
      throw InputError(fmt::format("{}: the {} would overwrite another file of this job; choose another name",
                                   (spec.*output->file).string(), output->name));
  });
  for (const job::SimulationOutput& output : job::kSimulationOutputs)
    spec.*output.file = job::find_opened(spec.*output.file, spec.file, file);
  comm.agree([&] {
    if (!comm.is_root() || options.validate) return;
    job::check_has_output(spec, file.string());
    for (const job::SimulationOutput& output : job::kSimulationOutputs)
      if (!(spec.*output.file).empty()) base::check_writable(spec.*output.file, output.name);
    if (!options.checkpoint.empty()) base::check_writable(options.checkpoint, "checkpoint");
  });
  return spec;
}

/// Files removed at the end of the run, on rank 0.
struct TemporaryFiles {
  std::vector<std::unique_ptr<run::TemporaryFile>> resumable;  // kept with a checkpoint
  std::vector<std::unique_ptr<run::TemporaryFile>> others;
};

TemporaryFiles make_temporary_files(const comm::Communicator& comm, const job::SimulationSpec& spec) {
  TemporaryFiles files;
  if (!comm.is_root()) return files;
  const auto make = [](const fs::path& output, const char* end) {
    return std::make_unique<run::TemporaryFile>(fs::absolute(output).concat(end));
  };
  if (!spec.surface.empty()) files.resumable.push_back(make(spec.surface, ".part"));
  if (!spec.motion.empty()) {
    files.resumable.push_back(make(spec.motion, ".frames"));
    files.others.push_back(make(spec.motion, ".part"));
  }
  return files;
}

/// Least CPU time between two clock readings.
double measure_clock() {
  double least = std::numeric_limits<double>::infinity();
  for (int look = 0; look < 100; ++look) {
    const double before = base::get_process_cpu_s();
    least = std::min(least, base::get_process_cpu_s() - before);
  }
  return least;
}

/// Steps and sound of one sample.
void advance_sample(Simulation& simulation) {
  transient::Motion& motion = *simulation.motion;
  if (simulation.film) simulation.film->add_sample(motion);
  // Reading the clock costs as much as a step of a small body: measure one sample in 17 (coprime with the sound's periods of 8 and 16
  // samples), less the time of two readings.
  const bool is_measured = simulation.sound && motion.get_sample() % kMeasureSamples == 0;
  do {
    motion.advance();
    if (!simulation.sound) continue;
    const double before = is_measured ? base::get_process_cpu_s() : 0.0;
    if (motion.get_steps_per_sample() != simulation.steps_per_sample) {
      simulation.steps_per_sample = motion.get_steps_per_sample();
      simulation.sound->set_steps_per_sample(simulation.steps_per_sample);
    }
    if (motion.is_at_sample()) set_balls(simulation);
    simulation.sound->add_step(&motion.get_u()[0].x);
    if (is_measured)
      simulation.sound_cpu_s += static_cast<double>(kMeasureSamples) * (base::get_process_cpu_s() - before - simulation.clock_s);
  } while (!motion.is_at_sample());
}

/// Progress lines, on rank 0.
class Reporter {
 public:
  Reporter(const Log& log, const fs::path& file) : log_(log) {
    if (!file.empty()) file_.emplace(file);
  }

  double find_seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }
  void report(const transient::Motion& motion, std::int64_t frames) {
    const double taken = find_seconds();
    if (taken < last_ + 1.0) return;
    last_ = taken;
    const double share = static_cast<double>(motion.get_sample()) / static_cast<double>(frames), left = taken * (1.0 / share - 1.0);
    if (file_) file_->append({"simulate", 100.0 * share, 0, {}, left, taken});
    if (taken < last_printed_ + 10.0) return;
    last_printed_ = taken;
    log_.print(fmt::format("{:5.1f} %, {:.4g} s simulated, about {:.0f} s left", 100.0 * share, motion.get_time_s(), left));
  }
  void finish() {
    if (file_) file_->append({"done", 100.0, 0, {}, 0.0, find_seconds()});
  }

 private:
  const Log& log_;
  std::optional<io::ProgressFile> file_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  double last_ = 0.0, last_printed_ = 0.0;
};

/// Creates sound and film, and resumes from a checkpoint. Collective.
void start(const comm::Communicator& comm, Simulation& simulation, const std::optional<SimulationState>& saved, const Log& log) {
  transient::Motion& motion = *simulation.motion;
  const job::SimulationSpec& spec = simulation.spec;
  if (simulation.makes_sound())
    simulation.sound = std::make_unique<emission::Emission>(comm, make_surface_part(*simulation.domain, spec),
                                                            make_emission_options(spec, motion.get_steps_per_sample(), saved.has_value()));
  if (!spec.motion.empty()) simulation.film = std::make_unique<MotionFile>(*simulation.domain, spec, saved.has_value());
  if (saved) {
    resume(comm, *saved, simulation);
    simulation.first_step = motion.get_step_count();
    log.print(fmt::format("resumed at {:.6g} s", motion.get_time_s()));
  } else {
    if (simulation.sound) {
      set_balls(simulation);
      simulation.sound->add_step(&motion.get_u()[0].x);
    }
    simulation.books.push_back(motion.calc_book());
  }
  simulation.steps_per_sample = motion.get_steps_per_sample();
  log.print(fmt::format("step {:.4g} s, {} a sample; {} rank{}", motion.get_step_s(), simulation.steps_per_sample, comm.size(),
                        comm.size() == 1 ? "" : "s"));
}

}  // namespace

SimulateSummary simulate(const comm::Communicator& comm, const fs::path& job_file, const SimulateOptions& options) {
  const Log log{comm, options.quiet || options.validate};
  std::string text;
  Simulation simulation;
  simulation.spec = read_spec(comm, job_file, options, text);
  simulation.job_sha256 = base::to_hex(base::calc_sha256(text));
  const job::SimulationSpec& spec = simulation.spec;
  for (std::string& warning : find_deaf_receivers(spec)) simulation.spec.warnings.push_back(std::move(warning));
  const std::int64_t program_bytes = base::find_memory().resident;
  const double finer = !options.validate ? 1.0 : comm.agree([&] { return coarsen(simulation.spec, options.patience_s); });
  simulation.bodies = make_bodies(comm, spec, [&](const std::string& line) { log.print(line); });
  simulation.spec.warnings.insert(simulation.spec.warnings.end(), simulation.bodies.warnings.begin(), simulation.bodies.warnings.end());
  for (const std::string& warning : spec.warnings) log.warn(warning);
  make_motion(comm, simulation);
  transient::Motion& motion = *simulation.motion;
  SimulateSummary summary;
  if (options.validate) {
    summary.result = predict(comm, simulation, options, finer, program_bytes);
    return summary;
  }
  const base::Sha256::Hash identity = find_identity(text, *simulation.bodies.assembly);
  const std::optional<SimulationState> saved = load_checkpoint(comm, options.checkpoint, identity);
  const auto temporary = comm.agree([&] { return make_temporary_files(comm, spec); });
  const auto keep_for_checkpoint = [&] {
    for (const auto& file : temporary.resumable) file->set_needed(true);
  };
  if (saved) keep_for_checkpoint();
  start(comm, simulation, saved, log);

  Reporter reporter = comm.agree([&] { return Reporter(log, comm.is_root() ? options.progress : fs::path()); });
  const std::int64_t frames = std::llround(spec.duration_s * spec.sample_rate_hz);
  const std::int64_t book_every = std::max<std::int64_t>(1, std::llround(kBookIntervalS * spec.sample_rate_hz));
  const bool is_kept = !options.checkpoint.empty();
  if (is_kept) run::set_news(true);
  double last_save_s = 0.0;
  simulation.clock_s = measure_clock();
  const double cpu_s = base::get_process_cpu_s();
  while (motion.get_sample() < frames) {
    advance_sample(simulation);
    if (motion.get_sample() % book_every == 0 || motion.get_sample() == frames) simulation.books.push_back(motion.calc_book());
    if (motion.get_sample() % kPollSamples != 0 || motion.get_sample() == frames) continue;
    reporter.report(motion, frames);
    if (!is_kept) continue;
    enum : std::int32_t { kNothing, kSave, kStop };
    const bool is_due = comm.is_root() && reporter.find_seconds() > last_save_s + options.checkpoint_every_s;
    const std::int32_t wanted = comm.max(run::is_stop_asked() ? std::int32_t{kStop}
                                         : is_due             ? std::int32_t{kSave}
                                                              : std::int32_t{kNothing});
    if (wanted == kNothing) continue;
    save_checkpoint(comm, options.checkpoint, identity, collect_state(comm, simulation));
    keep_for_checkpoint();
    last_save_s = reporter.find_seconds();
    if (wanted == kSave) continue;
    summary.is_stopped = true;
    summary.result = fmt::format("stopped by {} at {:.6g} s; the same command resumes from {}", run::find_stop_name(), motion.get_time_s(),
                                 options.checkpoint.string());
    return summary;
  }
  simulation.sound_cpu_s = std::max(0.0, simulation.sound_cpu_s);
  simulation.steps_cpu_s = std::max(0.0, base::get_process_cpu_s() - cpu_s - simulation.sound_cpu_s);
  if (simulation.film) simulation.film->add_sample(motion);
  summary.result = write_outputs(comm, simulation, reporter.find_seconds());
  comm.agree([&] {
    if (!comm.is_root()) return;
    reporter.finish();
    std::error_code ignored;
    if (is_kept) fs::remove(options.checkpoint, ignored);
    for (const auto& file : temporary.resumable) file->set_needed(false);
  });
  return summary;
}

}  // namespace carillon::simulation
