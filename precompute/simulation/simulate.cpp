// Method: steps of transient::Motion feed emission::Emission; energy books every 0.01 s.
// Source: docs/equations.md E11 and E14; O'Brien, Cook and Essl 2001.
#include "precompute/simulation/simulate.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "precompute/job/simulation.hpp"
#include "precompute/run/interrupt.hpp"
#include "precompute/run/io/progress_file.hpp"
#include "precompute/run/run_log.hpp"
#include "precompute/run/same_start.hpp"
#include "precompute/simulation/checkpoint.hpp"
#include "precompute/simulation/coarsen.hpp"
#include "precompute/simulation/emission/emission.hpp"
#include "precompute/simulation/emission_input.hpp"
#include "precompute/simulation/outputs.hpp"
#include "precompute/simulation/predict.hpp"
#include "precompute/simulation/simulation.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/host.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::simulation {
namespace {

namespace fs = std::filesystem;

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
