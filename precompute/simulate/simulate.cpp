// Method:     the steps of transient::Motion, whose displacements go to emission::Emission; books of the energy every hundredth of a
// second. Source:     docs/equations.md E11 and E14; O'Brien, Cook and Essl 2001. Deviations: none beyond those of both.
#include "precompute/simulate/simulate.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "precompute/emission/emission.hpp"
#include "precompute/io/progress_file.hpp"
#include "precompute/job/simulation.hpp"
#include "precompute/run/interrupt.hpp"
#include "precompute/run/run_log.hpp"
#include "precompute/run/same_start.hpp"
#include "precompute/simulate/bodies.hpp"
#include "precompute/simulate/checkpoint.hpp"
#include "precompute/simulate/coarsen.hpp"
#include "precompute/simulate/motion_file.hpp"
#include "precompute/simulate/sound_file.hpp"
#include "precompute/transient/contact.hpp"
#include "precompute/transient/motion.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/host.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/sha256.hpp"
#include "runtime/version/version.hpp"

namespace carillon::simulate {
namespace {

namespace fs = std::filesystem;
using transient::EnergyBook;

constexpr std::uint64_t kMaxJobBytes = 16 << 20;
constexpr double kBookEveryS = 0.01;        // of simulated time
constexpr std::int64_t kLookEvery = 16;     // samples between two polls of signals
constexpr std::int64_t kMeasureEvery = 17;  // samples between two measurements of the sound's CPU time
constexpr double kFullScalePa = 1.0;        // of a WAV file; louder sounds are scaled to a peak of 1
constexpr double kBookGoal = 1e-6;          // error of an energy book over the largest energy
constexpr double kBookScatter = 3.0;  // off the square law by 2.7 at most: 11 scenes with errors above the goal, steps down to a sixth
constexpr int kTrialSteps = 200;      // of --validate
constexpr std::int64_t kTrialSamples = 64, kTimedSamples = 48;  // of the trial's sound
constexpr int kMaxPredictedRanks = 1024;
constexpr std::int64_t kPictureBytes = 40 << 20;  // for drawing the spectrogram, twice the measured memory
constexpr std::int64_t kLaterBytes = 24 << 20;    // libraries loaded for writing files
constexpr double kSurfaceBytesPerNode = 8192;     // blocks of the recorded surface: two triangles of 256 samples, of all ranks and of one
constexpr double kFilmBytesPerNode = 256;         // frames of the motion

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

emission::Options make_emission_options(const job::SimulationSpec& spec, int steps_per_sample, bool is_resumed) {
  emission::Options options;
  options.sample_rate_hz = spec.sample_rate_hz;
  options.steps_per_sample = steps_per_sample;
  options.frames = static_cast<std::uint64_t>(std::llround(spec.duration_s * spec.sample_rate_hz));
  options.radiation = spec.radiation == job::SurfaceSound::kirchhoff  ? emission::Radiation::kKirchhoff
                      : spec.radiation == job::SurfaceSound::rayleigh ? emission::Radiation::kRayleigh
                                                                      : emission::Radiation::kPaper2001;
  if (spec.radiation != job::SurfaceSound::paper2001) options.high_pass_hz = spec.high_pass_hz;
  options.has_visibility = spec.visibility;
  if (spec.receivers.microphones_m.empty()) {
    options.receivers =
        emission::make_ears(spec.receivers.position_m, spec.receivers.position_m + spec.receivers.facing, spec.receivers.ear_distance_m);
  } else {
    for (const Vec3& place : spec.receivers.microphones_m) options.receivers.push_back({place, 0.0, {0, 1, 0}});
  }
  for (emission::Microphone& receiver : options.receivers) {
    receiver.directivity = spec.receivers.cardioid;
    receiver.axis = spec.receivers.facing;
  }
  for (const job::Obstacle& obstacle : spec.obstacles) options.walls.push_back(obstacle.form);
  for (const job::Striker& striker : spec.strikers) options.ball_radius_m.push_back(striker.ball.radius_m);
  options.surface_file = spec.surface;
  options.is_resumed = is_resumed;
  return options;
}

/// Warnings of receivers inside an obstacle, which receive no sound.
std::vector<std::string> find_deaf_receivers(const job::SimulationSpec& spec) {
  std::vector<std::string> warnings;
  if (!spec.visibility) return warnings;
  const emission::Options options = make_emission_options(spec, 0, false);
  for (std::size_t i = 0; i < options.receivers.size(); ++i)
    for (const job::Obstacle& obstacle : spec.obstacles) {
      const Vec3& place = options.receivers[i].place_m;
      if (!emission::is_between(obstacle.form, place, place)) continue;
      const std::string name = !spec.receivers.microphones_m.empty() ? fmt::format("microphone {}", i + 1)
                               : i == 0                              ? "the left ear of the listener"
                                                                     : "the right ear of the listener";
      warnings.push_back(fmt::format("{}: this obstacle encloses {} at ({:.4g}, {:.4g}, {:.4g}) m, which hears nothing; move one of them",
                                     obstacle.place, name, place[0], place[1], place[2]));
    }
  return warnings;
}

/// Each triangle on the rank that owns its lowest node.
emission::SurfacePart make_surface_part(const transient::Domain& domain, const job::SimulationSpec& spec) {
  emission::SurfacePart part;
  const transient::Assembly& assembly = domain.get_assembly();
  part.nodes_m = domain.get_rest_m();
  for (std::int32_t place = 0; place < domain.node_count(); ++place) part.node_number.push_back(domain.find_number(place));
  std::int64_t number = 0;
  for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
    if (!spec.bodies[b].sounds && !spec.visibility) continue;
    // Corners alone, of quadratic elements too: their waves are longer than a facet, and four triangles each cost four times as much.
    for (const auto& facet : transient::list_skin(assembly, static_cast<std::int32_t>(b))) {
      const std::array<std::int32_t, 3> triangle{facet[0], facet[1], facet[2]};
      const std::int32_t owner = domain.find_place(*std::min_element(triangle.begin(), triangle.end()));
      const std::int64_t own = number;
      if (spec.bodies[b].sounds) number += spec.bodies[b].sheet ? 2 : 1;
      if (owner < 0 || owner >= domain.own_count()) continue;
      const Triangle made{domain.find_place(triangle[0]), domain.find_place(triangle[1]), domain.find_place(triangle[2])};
      if (!spec.bodies[b].sounds) {
        part.silent.push_back(made);
        continue;
      }
      part.triangles.push_back(made);
      part.triangle_number.push_back(own);
      part.body.push_back(static_cast<std::int32_t>(b));
      if (!spec.bodies[b].sheet) continue;
      part.triangles.push_back({made[0], made[2], made[1]});
      part.triangle_number.push_back(own + 1);
      part.body.push_back(static_cast<std::int32_t>(b));
    }
  }
  return part;
}

transient::MotionOptions make_motion_options(const job::SimulationSpec& spec) {
  transient::MotionOptions options;
  options.sample_rate_hz = spec.sample_rate_hz;
  if (spec.step_s) options.longest_step_s = *spec.step_s;
  options.gravity_m_s2 = spec.gravity_m_s2;
  options.settle_s = spec.settle_s;
  options.round_steps = emission::find_steps;
  return options;
}

/// The line of the job of what overlaps at the start: the message of Contacts begins with it.
std::string find_overlap_place(const job::SimulationSpec& spec, std::string_view message) {
  for (std::size_t i = 0; i < spec.strikers.size(); ++i)
    if (message.starts_with(fmt::format("striker {} ", i + 1))) return spec.strikers[i].place;
  for (const job::SimulatedBody& body : spec.bodies)
    if (message.starts_with(fmt::format("body \"{}\" ", body.name))) return body.place;
  return spec.file.string();
}

/// Files removed at the end of the run, on rank 0.
struct TemporaryFiles {
  std::vector<std::unique_ptr<run::TemporaryFile>> resumable;  // kept for a checkpoint
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

/// All that moves, on this rank.
struct Simulation {
  job::SimulationSpec spec;
  std::string job_sha256;  // of the bytes of the job
  Bodies bodies;
  std::unique_ptr<transient::Domain> domain;
  std::unique_ptr<transient::Motion> motion;
  std::unique_ptr<transient::Contacts> contacts;
  std::unique_ptr<emission::Emission> sound;
  std::unique_ptr<MotionFile> film;
  std::vector<EnergyBook> books;
  int steps_per_sample = 0;     // of the sound
  std::int64_t first_step = 0;  // of this process; after a resumption, that of the checkpoint
  double sound_cpu_s = 0, steps_cpu_s = 0, clock_s = 0;

  bool makes_sound() const { return !spec.sound.empty() || !spec.spectrogram.empty() || !spec.surface.empty(); }
};

void make_motion(const comm::Communicator& comm, Simulation& simulation) {
  const job::SimulationSpec& spec = simulation.spec;
  simulation.domain = std::make_unique<transient::Domain>(comm, simulation.bodies.assembly);
  simulation.motion = std::make_unique<transient::Motion>(*simulation.domain, make_motion_options(spec), simulation.bodies.constraints,
                                                          simulation.bodies.impulses);
  std::vector<transient::BallStriker> strikers;
  for (const job::Striker& striker : spec.strikers) strikers.push_back(striker.ball);
  std::vector<transient::RigidObstacle> obstacles;
  for (const job::Obstacle& obstacle : spec.obstacles) obstacles.push_back(obstacle.form);
  const transient::TouchRules rules{spec.contact.restitution, spec.contact.friction, spec.gravity_m_s2};
  simulation.contacts = std::make_unique<transient::Contacts>(*simulation.domain, make_touch_surface(*simulation.bodies.assembly, spec),
                                                              std::move(strikers), std::move(obstacles), rules);
  if (simulation.contacts->is_needed()) simulation.motion->add(*simulation.contacts);
  simulation.motion->set_start([&](std::int32_t node, const Vec3& rest_m) {
    const auto body = static_cast<std::size_t>(simulation.bodies.assembly->find_body_of_node(node));
    const job::SimulatedBody& described = spec.bodies[body];
    transient::Motion::Start start;
    start.velocity_m_s = described.velocity_m_s + cross(described.angular_velocity_rad_s, rest_m - simulation.bodies.centre_m[body]);
    if (!simulation.bodies.start.empty()) {
      const transient::Quad& u = simulation.bodies.start[static_cast<std::size_t>(node)];
      start.displacement_m = {u.x, u.y, u.z};
      start.angle_rad = u.x;
    }
    return start;
  });
  // The first forces, with the search for contacts: what overlaps is found here.
  try {
    simulation.motion->prepare();
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", find_overlap_place(spec, error.what()), error.what()));
  }
}

SimulationState collect_state(const comm::Communicator& comm, Simulation& simulation) {
  SimulationState state{simulation.books, simulation.motion->save(), simulation.contacts->save(), {}};
  if (simulation.sound) state.sound = comm.agree([&] { return simulation.sound->save(); });
  return state;
}

void resume(const comm::Communicator& comm, const SimulationState& state, Simulation& simulation) {
  simulation.books = state.books;
  simulation.motion->load(state.motion);
  simulation.contacts->load(state.contacts);
  if (simulation.sound) comm.agree([&] { simulation.sound->load(state.sound); });
}

// ---- outputs ----

base::Json describe(const EnergyBook& book) {
  base::Json json = base::Json::object();
  json.set("time_s", base::significant(book.time_s, 9));
  for (const auto& [name, value] : {std::pair{"kinetic_j", book.kinetic_j},
                                    {"elastic_j", book.elastic_j},
                                    {"dissipated_j", book.dissipated_j},
                                    {"work_j", book.work_j},
                                    {"error_j", book.error_j},
                                    {"relative_error", book.relative_error}})
    json.set(name, base::finite_or_null(value, base::significant, 9));
  return json;
}

/// The step with which the book is expected to close to kBookGoal, as its error falls with the square of the step; none where it does.
std::optional<double> find_closing_step(double step_s, double book_error) {
  if (!(book_error > kBookGoal) || !std::isfinite(book_error)) return std::nullopt;
  return step_s * std::sqrt(kBookGoal / (kBookScatter * book_error));
}

/// Of what the bytes of the job say, without names of files: the picture from the store is that of a run by hand.
std::string make_title(const Simulation& simulation) {
  std::vector<std::string> names;
  for (const job::SimulatedBody& body : simulation.spec.bodies) names.push_back(base::printable(body.name));
  return fmt::format("{}: {} elements", fmt::join(names, ", "), simulation.bodies.assembly->element_count());
}

std::string write_outputs(const comm::Communicator& comm, Simulation& simulation, double seconds) {
  const job::SimulationSpec& spec = simulation.spec;
  std::string result;
  double peak = 0;
  std::vector<std::vector<double>> channels;
  if (simulation.sound) {
    simulation.sound->finish();
    const emission::Options options = make_emission_options(spec, simulation.motion->get_steps_per_sample(), false);
    for (std::size_t r = 0; r < options.receivers.size(); ++r) channels.push_back(simulation.sound->calc_sound(r));
    for (const auto& channel : channels)
      for (const double p : channel) peak = std::max(peak, std::abs(p));
  }
  const transient::ExternalForces::Energy touch = simulation.contacts->calc_energy();
  const double cpu[2] = {comm.sum(simulation.steps_cpu_s), comm.sum(simulation.sound_cpu_s)};
  if (simulation.film) simulation.film->finish();
  comm.agree([&] {
    if (!comm.is_root()) return;
    const EnergyBook& book = simulation.books.back();
    const double gain = peak > kFullScalePa ? kFullScalePa / peak : 1.0;
    std::string picture;  // before anything is written
    if (!spec.spectrogram.empty())
      picture = draw_spectrogram(channels, spec.sample_rate_hz, make_title(simulation), base::find_folder(spec.spectrogram));
    if (!spec.sound.empty()) write_sound(spec.sound, channels, spec.sample_rate_hz, gain);
    if (!spec.spectrogram.empty()) base::write_file(spec.spectrogram, picture);
    double worst = 0;
    for (const EnergyBook& one : simulation.books) worst = std::max(worst, std::abs(one.relative_error));
    // By CPU time, independent of other load on the machine.
    const double rate = static_cast<double>(simulation.bodies.assembly->element_count()) *
                        static_cast<double>(simulation.motion->get_step_count() - simulation.first_step) / std::max(1e-9, cpu[0]);
    base::Json record = base::Json::object();
    record.set("version", version::describe("carillon-simulate")).set("job_sha256", simulation.job_sha256);
    record.set("job", spec.file.filename().string()).set("duration_s", spec.duration_s).set("sample_rate_hz", spec.sample_rate_hz);
    record.set("step_s", base::significant(simulation.motion->get_step_s(), 9)).set("steps", simulation.motion->get_step_count());
    record.set("elements", static_cast<std::int64_t>(simulation.bodies.assembly->element_count())).set("ranks", comm.size());
    record.set("seconds", base::decimals(seconds, 3)).set("cpu_seconds", base::decimals(cpu[0] + cpu[1], 3));
    record.set("sound_cpu_seconds", base::decimals(cpu[1], 3));
    record.set("element_steps_per_second", base::significant(rate, 4));
    record.set("peak_pa", base::finite_or_null(peak, base::significant, 6)).set("gain_per_pa", base::significant(gain, 9));
    record.set("book_error", base::finite_or_null(worst, base::significant, 3));
    const std::optional<double> closing_step_s = find_closing_step(simulation.motion->get_step_s(), worst);
    record.set("closing_step_s", base::finite_or_null(closing_step_s.value_or(NAN), base::significant, 3));
    record.set("contact_stored_j", base::significant(touch.stored_j, 9))
        .set("contact_dissipated_j", base::significant(touch.dissipated_j, 9));
    for (const transient::BallStriker& ball : simulation.contacts->get_strikers()) {
      base::Json striker = base::Json::object();
      for (const double x : ball.position_m) striker.member("position_m").add(base::significant(x, 9));
      for (const double x : ball.velocity_m_s) striker.member("velocity_m_s").add(base::significant(x, 9));
      for (const double x : ball.spin_rad_s) striker.member("angular_velocity_rad_s").add(base::significant(x, 9));
      record.member("strikers").add(std::move(striker));
    }
    for (const Bent& bent : simulation.bodies.bent) {
      base::Json one = base::Json::object();
      one.set("body", spec.bodies[bent.body].name).set("displacement_m", base::significant(bent.displacement_m, 6));
      one.set("energy_j", base::significant(bent.energy_j, 9)).set("cpu_seconds", base::decimals(bent.cpu_s, 3));
      if (bent.mode_hz > 0.0) one.set("mode_hz", base::significant(bent.mode_hz, 9));
      record.member("bent").add(std::move(one));
    }
    for (const EnergyBook& one : simulation.books) record.member("books").add(describe(one));
    for (const std::string& warning : spec.warnings) record.member("warnings").add(warning);
    if (!spec.record.empty()) base::write_file(spec.record, record.text());
    result = fmt::format(
        "{:.6g} s in {} steps of {:.4g} s, {:.3g} element-steps a second of CPU time, sound {:.1f} % of the CPU time\n"
        "energy: kinetic {:.4g} J, elastic {:.4g} J, dissipated {:.4g} J, put in {:.4g} J; the book closes to {:.1e}",
        book.time_s, simulation.motion->get_step_count(), simulation.motion->get_step_s(), rate,
        100.0 * cpu[1] / std::max(1e-9, cpu[0] + cpu[1]), book.kinetic_j, book.elastic_j, book.dissipated_j, book.work_j, worst);
    if (closing_step_s)
      result += fmt::format("\nthe book is expected to close to {:g} with \"step_s\": {:.2e} (its error falls with the square of the step)",
                            kBookGoal, *closing_step_s);
    if (simulation.sound)
      result += fmt::format("\npeak {:.4g} Pa{}", peak, gain < 1.0 ? fmt::format(", the file has it as 1 (gain {:.4g})", gain) : "");
    for (const job::SimulationOutput& output : job::kSimulationOutputs)
      if (!(spec.*output.file).empty()) {
        std::error_code error;  // the folder may be gone
        const fs::path whole = fs::absolute(spec.*output.file, error);
        result += "\n" + (error ? spec.*output.file : whole).string();
      }
  });
  return result;
}

/// Bytes of a run beyond those before its first step, largest over ranks.
std::int64_t count_later_bytes(const Simulation& simulation, int ranks, bool has_checkpoint, double finer) {
  const job::SimulationSpec& spec = simulation.spec;
  const transient::Assembly& assembly = *simulation.bodies.assembly;
  constexpr std::int64_t kNumber = sizeof(double);
  std::int64_t arrivals = 0, later = kLaterBytes;  // half-samples of all receivers; at the end of the run
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
  // State of this rank (a vector grown by doubling); on rank 0 also that of all ranks and the bytes of the file.
  const std::int64_t state =
      has_checkpoint ? kLaterBytes + (3 + 2 * ranks) * arrivals + static_cast<std::int64_t>(3 * kNumber * (30.0 * nodes + 25.0 * elements))
                     : 0;
  return arrivals + std::max(later, state);
}

/// CPU seconds of the sound of one sample, from surfaces at rest, after warm-up of all stages.
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

/// Predicted cost of a run, from a few steps and the sound of some samples. finer: nodes of the job over nodes of these meshes.
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
  // As carillon-precompute --validate says it, for the queue: ranks share the bodies, and are counted as if they did not.
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

/// Least CPU time between two readings of the clock.
double measure_clock() {
  double least = std::numeric_limits<double>::infinity();
  for (int look = 0; look < 100; ++look) {
    const double before = base::get_process_cpu_s();
    least = std::min(least, base::get_process_cpu_s() - before);
  }
  return least;
}

/// Passes the balls' centres to the sound, for visibility.
void set_balls(Simulation& simulation) {
  if (!simulation.spec.visibility || simulation.spec.strikers.empty()) return;
  std::vector<Vec3> centres;
  for (const transient::BallStriker& ball : simulation.contacts->get_strikers()) centres.push_back(ball.position_m);
  simulation.sound->set_balls(centres);
}

/// The steps of one sample, and what they make the surfaces sound.
void advance_sample(Simulation& simulation) {
  transient::Motion& motion = *simulation.motion;
  if (simulation.film) simulation.film->add_sample(motion);
  // Reading the clock costs as much as a step of a small body: one sample in 17 is measured, coprime with the sound's periods of 8
  // and 16 samples, less the time of two readings.
  const bool is_measured = simulation.sound && motion.get_sample() % kMeasureEvery == 0;
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
      simulation.sound_cpu_s += static_cast<double>(kMeasureEvery) * (base::get_process_cpu_s() - before - simulation.clock_s);
  } while (!motion.is_at_sample());
}

/// Lines of progress, on rank 0.
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

  Reporter reporter = comm.agree([&] { return Reporter(log, comm.is_root() ? options.progress : fs::path()); });
  const std::int64_t frames = std::llround(spec.duration_s * spec.sample_rate_hz);
  const std::int64_t book_every = std::max<std::int64_t>(1, std::llround(kBookEveryS * spec.sample_rate_hz));
  const bool is_kept = !options.checkpoint.empty();
  if (is_kept) run::set_news(true);
  double last_save_s = 0.0;
  simulation.clock_s = measure_clock();
  const double cpu_s = base::get_process_cpu_s();
  while (motion.get_sample() < frames) {
    advance_sample(simulation);
    if (motion.get_sample() % book_every == 0 || motion.get_sample() == frames) simulation.books.push_back(motion.calc_book());
    if (motion.get_sample() % kLookEvery != 0 || motion.get_sample() == frames) continue;
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

}  // namespace carillon::simulate
