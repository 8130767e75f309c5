#include "runtime/host/program.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>

#include "runtime/config/file.hpp"
#include "runtime/host/banks.hpp"
#include "runtime/host/events.hpp"
#include "runtime/host/microphones.hpp"
#include "runtime/host/planning.hpp"
#include "runtime/host/render.hpp"
#include "runtime/host/report.hpp"
#include "runtime/host/scene.hpp"
#include "runtime/host/sound_file.hpp"
#include "runtime/host/spectrogram.hpp"
#include "runtime/plan/costs.hpp"
#include "runtime/plan/table.hpp"

namespace carillon::host {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double kMostAudibleHz = 20000.0;

double get_seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Prints "what: 40 %" on stderr: in place on a terminal, every quarter elsewhere.
class Progress {
 public:
  Progress(std::string what, bool quiet) : what_(std::move(what)), quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}
  void operator()(double fraction) {
    const int percent = static_cast<int>(std::floor(100.0 * std::clamp(fraction, 0.0, 1.0)));
    if (quiet_ || percent < next_) return;
    fmt::print(stderr, "{}{}: {} %{}", terminal_ ? "\r" : "", what_, percent, terminal_ ? "" : "\n");
    if (terminal_ && percent == 100) fmt::print(stderr, "\n");
    std::fflush(stderr);
    const int step = terminal_ ? 1 : 25;
    next_ = percent == 100 ? 101 : (percent / step + 1) * step;
  }

 private:
  std::string what_;
  bool quiet_ = false;
  bool terminal_ = false;
  int next_ = 0;
};

bool is_same_file(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::equivalent(a, b, error)) return true;
  return fs::weakly_canonical(fs::absolute(a), error) == fs::weakly_canonical(fs::absolute(b), error);
}

/// WAV is what is written, so that is what the name says.
void check_sound_name(const fs::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  if (file == "-" || extension == ".wav" || extension == ".wave") return;
  throw InputError(fmt::format("{}: the sound is written as WAV; give the output a name that ends in .wav", file.string()));
}

/// Every output: can be written, is none of the inputs, and is not named twice.
void check_outputs(const ProgramOptions& options, const Scene& scene) {
  std::vector<std::pair<fs::path, std::string>> outputs;
  if (!options.plan) check_sound_name(options.wav);
  if (!options.plan) outputs.emplace_back(options.wav, "WAV file");
  if (options.spectrogram) outputs.emplace_back(*options.spectrogram, "spectrogram");
  if (options.trajectory) outputs.emplace_back(*options.trajectory, "trajectory");
  if (options.report) outputs.emplace_back(*options.report, "report");
  if (options.record) outputs.emplace_back(*options.record, "contacts file");
  std::vector<std::pair<fs::path, std::string>> taken{{scene.file, "scene"}};
  if (options.contacts) taken.emplace_back(*options.contacts, "contacts file to play");
  for (const SceneBody& body : scene.bodies) taken.emplace_back(body.bank, fmt::format("bank of \"{}\"", body.name));
  for (const auto& [file, what] : outputs) {
    for (const auto& [other, name] : taken) {
      if (is_same_file(file, other)) {
        throw InputError(fmt::format("{}: the {} would overwrite the {}; give it another name", file.string(), what, name));
      }
    }
    config::check_writable(file, what);
    taken.emplace_back(file, what);
  }
}

/// A line for each body whose bank leaves out some of what is heard.
void print_bands(const Scene& scene, double rate_hz) {
  for (const SceneBody& body : scene.bodies) {
    const double end_hz = body.spec.bank->band_hz[1];
    if (end_hz < std::min(kMostAudibleHz, 0.5 * rate_hz))
      fmt::print("  {:<16} nothing above {:.5g} Hz, where its bank ends; compute one with a higher \"band_hz\" to hear more\n", body.name,
                 end_hz);
  }
}

void print_summary(const Scene& scene, const Sound& sound, const Figures& figures) {
  fmt::print("bodies             {}\n", figures.bodies);
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    fmt::print("  {:<16} {} modes, {}peak {:.3g} Pa at 1 m\n", scene.bodies[i].name, sound.body_modes[i],
               scene.bodies[i].spec.fixed ? "fixed, " : "", sound.body_peak_pa[i]);
  }
  print_bands(scene, sound.rate_hz);
  fmt::print("modes sounding     {}\n", figures.modes);
  fmt::print("contacts           {}\n", figures.contacts);
  fmt::print("physics            {:.2f} s\n", figures.physics_s);
  fmt::print("sound              {:.2f} s for {:g} s at {} Hz\n", figures.sound_s, scene.duration_s, sound.rate_hz);
  fmt::print("real-time factor   {:.3f} (below 1 is faster than real time)\n", figures.real_time_factor);
  if (figures.audit) {
    const contact::EnergyAudit& bodies = figures.audit->bodies;
    fmt::print("energy of bodies   rises by {:.2g} J at most, and by {:.2g} J at a hit; the largest of motion is {:.3g} J\n", bodies.rise_j,
               bodies.hit_rise_j, bodies.kinetic_j);
    fmt::print("energy of modes    rises by a share of {:.2g} at most while nothing acts\n", figures.audit->modes_rise);
  }
  if (figures.peak_pa > 0.0) {
    fmt::print("peak               {:.4g} Pa at the {}\n", figures.peak_pa, scene.microphones_m.empty() ? "ears" : "microphones");
    fmt::print("level              {:.1f} dB re 20 uPa, loudest 125 ms {:.1f} dB\n", figures.levels.mean_db, figures.levels.loudest_db);
    fmt::print("gain               {:.4g} full scale per Pa, peak at {:.1f} dBFS\n", figures.gain.per_pa,
               20.0 * std::log10(figures.gain.per_pa * figures.peak_pa));
  } else {
    fmt::print("peak               0 Pa: nothing sounds in this scene, the file is silent\n");
  }
}

void print_warnings(const Scene& scene, const Sound& sound, const Figures& figures) {
  if (figures.gain.reduced) {
    fmt::print(stderr, "warning: the gain {:g} would clip ({:.1f} dB over full scale at a peak of {:.4g} Pa); {:.4g} is used instead\n",
               *scene.output.gain_per_pa, 20.0 * std::log10(*scene.output.gain_per_pa * figures.peak_pa), figures.peak_pa,
               figures.gain.per_pa);
  }
  if (sound.refused > 0) fmt::print(stderr, "warning: {} contact pulses could not be played (too many at once)\n", sound.refused);
  if (sound.resets > 0) fmt::print(stderr, "warning: {} times a body's state was no number and was cleared\n", sound.resets);
}

void write_output(const fs::path& file, const std::string& bytes, const char* what, bool quiet) {
  config::write_file(file, bytes);
  if (!quiet) fmt::print("{:<18} {}\n", what, file.string());
}

}  // namespace

void run(const ProgramOptions& options) {
  Scene scene = read_scene(options.scene);
  if (options.rate_hz) {
    scene.sample_rate_hz = *options.rate_hz;
    if (!fits_in_memory(scene)) {
      throw InputError(
          fmt::format("--rate {}: {:g} s at this rate need too much memory; give a lower rate", *options.rate_hz, scene.duration_s));
    }
  }
  if (options.format) {
    const auto name = std::find(kSampleFormatNames.begin(), kSampleFormatNames.end(), *options.format);
    scene.output.format = static_cast<SampleFormat>(name - kSampleFormatNames.begin());
  }
  if (options.plan && (options.spectrogram || options.trajectory || options.report || options.record || !options.wav.empty())) {
    throw InputError("--plan makes no sound and writes no files; leave the options that name files away");
  }
  check_outputs(options, scene);
  const Banks banks = read_banks(scene);
  plan::SceneFacts facts = make_facts(scene, make_microphones(scene), options.contacts.has_value() || has_physics(scene));
  std::vector<const bank::Bank*> body_banks;
  std::vector<contact::Vec3> centres_m;
  for (const SceneBody& body : scene.bodies) {
    body_banks.push_back(body.spec.bank);
    centres_m.push_back(body.spec.bank->rigid.centre_m);
  }

  Figures figures;
  figures.bodies = scene.bodies.size();
  auto started = Clock::now();
  const std::clock_t ticks = std::clock();
  const bool has_contacts = options.record.has_value() || plan::Planner(facts).needs_contacts();
  const Course course = options.contacts ? read_course(*options.contacts, scene)
                                         : simulate(scene, has_contacts, options.audit, Progress("physics", options.quiet));
  figures.physics_s = get_seconds_since(started);
  figures.physics_cpu_s = static_cast<double>(std::clock() - ticks) / CLOCKS_PER_SEC;
  const bool measures = options.plan || options.report.has_value();
  const Plan plan = make_plan(std::move(facts), course.recording.events, measures ? plan::measure_costs() : plan::Costs{});
  if (options.plan) {
    fmt::print("{}", plan::format_plan(plan.planner, plan.facts));
    return;
  }
  contact::Simulation simulation = contact::collect(course.recording.events, centres_m);
  simulation.steps = course.steps;
  started = Clock::now();
  const Sound sound = calc_sound(scene, body_banks, course.recording.events,
                                 {.rate_hz = scene.sample_rate_hz,
                                  .plan = &plan,
                                  .measures = measures,
                                  .audits = options.audit,
                                  .progress = Progress("sound", options.quiet)});
  figures.sound_s = get_seconds_since(started);
  if (options.audit) figures.audit = EnergyBooks{course.energy, sound.energy_rise};
  figures.real_time_factor = (figures.physics_s + figures.sound_s) / scene.duration_s;
  figures.modes = sound.modes;
  figures.contacts = count_contacts(simulation);
  figures.peak_pa = calc_peak_pa(sound);
  figures.levels = calc_levels(sound);
  figures.gain = calc_gain(scene.output, figures.peak_pa);

  // Everything is made before anything is written.
  const std::string wav = make_wav(sound, figures.gain.per_pa, scene.output.format);
  const std::string png = options.spectrogram
                              ? make_spectrogram_png(sound, fmt::format("{}: {} contacts, {} modes", scene.file.stem().string(),
                                                                        figures.contacts, figures.modes))
                              : "";
  const std::string trajectory = options.trajectory ? make_trajectory_json(scene, body_banks, simulation) : "";
  const std::string recording = options.record ? stream::format_recording(course.recording) : "";
  const std::string report = options.report ? make_report_json(scene, simulation, sound, plan, figures) : "";
  if (!options.quiet) print_summary(scene, sound, figures);
  print_warnings(scene, sound, figures);
  if (options.spectrogram) write_output(*options.spectrogram, png, "spectrogram", options.quiet);
  if (options.trajectory) write_output(*options.trajectory, trajectory, "trajectory", options.quiet);
  if (options.report) write_output(*options.report, report, "report", options.quiet);
  if (options.record) write_output(*options.record, recording, "contacts file", options.quiet);
  write_output(options.wav, wav, "sound", options.quiet);
}

}  // namespace carillon::host
