#include "precompute/simulation/predict.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "precompute/run/run_log.hpp"
#include "precompute/simulation/emission_input.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/json.hpp"

namespace carillon::simulation {
namespace {

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

}  // namespace

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

}  // namespace carillon::simulation
