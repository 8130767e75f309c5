#include "runtime/render/program.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <memory>

#include "runtime/base/clock.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/standard_output.hpp"
#include "runtime/render/labels.hpp"
#include "runtime/render/render.hpp"
#include "runtime/render/report.hpp"
#include "runtime/render/sensor_playback.hpp"
#include "runtime/render/sound/spectrogram.hpp"
#include "runtime/render/sound_file.hpp"
#include "runtime/render/surface_playback.hpp"
#include "runtime/scene/banks.hpp"
#include "runtime/scene/effects/table.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/microphones.hpp"
#include "runtime/scene/planning.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::render {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double kMaxAudibleHz = 20000.0;

double get_seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Prints "LABEL: 40 %" on stderr: in place on a terminal, otherwise every 25 %.
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

using base::is_standard_output;

/// Folder of intermediate files.
fs::path find_spool_folder(const fs::path& wav) {
  if (wav.empty() || is_standard_output(wav)) return {};
  return base::find_folder(wav);
}

/// Throws SystemError before the work if the sound does not fit on the disk.
void check_room(const scene::Scene& scene, const fs::path& wav) {
  const std::uint64_t frames = count_frames(scene.duration_s, scene.sample_rate_hz);
  const std::size_t channels = scene::count_channels(scene);
  const auto kept = static_cast<double>(frames * channels * sizeof(float));
  const double whole = is_standard_output(wav) ? 0.0 : static_cast<double>(calc_wav_bytes(channels, scene.output.format, frames));
  std::error_code error;
  const fs::path folder = is_standard_output(wav) ? fs::temp_directory_path(error) : find_spool_folder(wav);
  const fs::space_info space = fs::space(folder, error);
  if (error || kept <= static_cast<double>(base::Spool::kMemory) || static_cast<double>(space.available) >= kept + whole) return;
  throw SystemError(
      fmt::format("{}: {:.3g} GB are free, and the sound needs {:.3g} GB: {:.3g} GB for its file and {:.3g} GB while it is "
                  "made; make room or choose another place",
                  folder.string(), 1e-9 * static_cast<double>(space.available), 1e-9 * (kept + whole), 1e-9 * whole, 1e-9 * kept));
}

/// Output files that appear together once all are complete.
class Outputs {
 public:
  base::WholeFile& add(const fs::path& file, const char* what) {
    files_.push_back({std::make_unique<base::WholeFile>(file), what, file});
    return *files_.back().file;
  }
  /// `notes`: stream for the file names; may be null.
  void commit(std::FILE* notes) {
    for (const OutputFile& output : files_) {
      output.file->commit();
      if (notes != nullptr) fmt::print(notes, "{:<18} {}\n", output.what, base::printable(output.path.string()));
    }
  }

 private:
  struct OutputFile {
    std::unique_ptr<base::WholeFile> file;
    const char* what;
    fs::path path;
  };
  std::vector<OutputFile> files_;
};

bool is_npz(const fs::path& labels) { return base::find_extension(labels) == ".npz"; }

bool is_same_file(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::equivalent(a, b, error)) return true;
  return fs::weakly_canonical(fs::absolute(a), error) == fs::weakly_canonical(fs::absolute(b), error);
}

/// Checks that every output is writable, differs from all inputs, and is named once.
void check_outputs(const ProgramOptions& options, const scene::Scene& scene) {
  std::vector<std::pair<fs::path, std::string>> outputs;
  if (!options.plan && !is_standard_output(options.sound)) outputs.emplace_back(options.sound, "sound file");
  if (options.spectrogram) outputs.emplace_back(*options.spectrogram, "spectrogram");
  if (options.trajectory) outputs.emplace_back(*options.trajectory, "trajectory");
  if (options.report) outputs.emplace_back(*options.report, "report");
  if (options.record) outputs.emplace_back(*options.record, "contacts file");
  if (options.labels) outputs.emplace_back(*options.labels, "file of labels");
  const bool has_sensors = !options.plan && !scene.sensors.empty();
  if (has_sensors && is_standard_output(options.sound))
    throw InputError(fmt::format("{}: the scene has sensors, whose file is named after the sound; give -o a name", scene.file.string()));
  if (has_sensors) outputs.emplace_back(find_sensor_file(options.sound), "file of the sensors");
  std::vector<std::pair<fs::path, std::string>> taken{{scene.file, "scene"}};
  if (options.contacts) taken.emplace_back(*options.contacts, "contacts file to play");
  for (const scene::SceneBody& body : scene.bodies)
    if (!body.bank.empty()) taken.emplace_back(body.bank, fmt::format("bank of \"{}\"", body.name));
  for (const scene::SceneSurface& surface : scene.surfaces)
    taken.emplace_back(surface.file, fmt::format("recording of \"{}\"", surface.name));
  for (const auto& [file, what] : outputs) {
    for (const auto& [other, name] : taken) {
      if (is_same_file(file, other)) {
        throw InputError(fmt::format("{}: the {} would overwrite the {}; give it another name", file.string(), what, name));
      }
    }
    base::check_writable(file, what);
    taken.emplace_back(file, what);
  }
  if (!options.plan)
    find_codec(options.sound, scene.sample_rate_hz, scene::count_channels(scene), scene.output.format, options.format.has_value());
  if (options.labels && !is_npz(*options.labels) && base::find_extension(*options.labels) != ".jsonl")
    throw InputError(fmt::format("{}: labels are written as .npz or .jsonl; give the file a name that ends so", options.labels->string()));
}

/// One line per body whose bank ends below the audible range.
void print_bands(std::FILE* notes, const scene::Scene& scene, double rate_hz) {
  for (const scene::SceneBody& body : scene.bodies) {
    const double end_hz = body.spec.bank->band_hz[1];
    if (end_hz < std::min(kMaxAudibleHz, 0.5 * rate_hz))
      fmt::print(notes, "  {:<16} no modes above {:.5g} Hz, the limit of its bank; compute one with a higher \"band_hz\" to hear more\n",
                 base::printable(body.name), end_hz);
  }
}

void print_contacts(std::FILE* notes, const scene::Scene& scene, const physics::ContactAudit& contacts) {
  const auto print_depth = [&](const char* when, const physics::Depth& d) {
    fmt::print(notes, "  {:<16} {:.3g} mm, {}, at {:.4g} s; unexplained {:.3g} mm\n", when, 1e3 * d.depth_m,
               describe_pair(scene, d.body, d.other), d.time_s, 1e3 * d.unexplained_m);
  };
  fmt::print(notes, "depth              of bodies in each other and in the ground:\n");
  print_depth("now", contacts.now);
  print_depth("ever", contacts.deepest);
  print_depth("most unexplained", contacts.unexplained);
  fmt::print(notes, "  pushes           {}\n", contacts.pushes);
  const physics::HitRate &worst = contacts.worst_pair, &busiest = contacts.busiest;
  fmt::print(notes, "hits               {:.0f} in the last second, {:.0f} of them of {}; at most {:.0f} per s in half a second, of {}\n",
             contacts.hits_per_s, worst.per_s, describe_pair(scene, worst.body, worst.other), busiest.per_s,
             describe_pair(scene, busiest.body, busiest.other));
  fmt::print(notes, "impacts with modes {:.3g} ms the longest; {} ended before their contacts had parted\n",
             1e3 * contacts.longest_impact_s, contacts.ended_impacts);
}

void print_summary(std::FILE* notes, const scene::Scene& scene, const Sound& sound, const Figures& figures) {
  fmt::print(notes, "bodies             {}\n", figures.bodies);
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    fmt::print(notes, "  {:<16} {} modes, {}peak {:.3g} Pa at 1 m\n", base::printable(scene.bodies[i].name), sound.body_modes[i],
               scene.bodies[i].spec.fixed ? "fixed, " : "", sound.body_peak_pa[i]);
    if (const std::string& text = scene.bodies[i].mounting.text; !text.empty())
      fmt::print(notes, "  {:<16} {}\n", "", base::printable(text));
    if (const std::string text = describe_limited(scene.bodies[i]); !text.empty()) fmt::print(notes, "  {:<16} {}\n", "", text);
  }
  for (const scene::SceneSurface& surface : scene.surfaces)
    fmt::print(notes, "  {:<16} {}\n", base::printable(surface.name), describe_surface(scene, surface));
  print_bands(notes, scene, sound.rate_hz);
  fmt::print(notes, "modes sounding     {}\n", figures.modes);
  if (!scene.joints.empty() || !scene.cords.empty())
    fmt::print(notes, "joints             {}{}, {} cords\n", scene.joints.size(), scene.joints.empty() ? "" : " (Simbody)",
               scene.cords.size());
  fmt::print(notes, "contacts           {}\n", figures.tally.contacts);
  constexpr std::size_t kMaxPrinted = 8;
  for (std::size_t i = 0; i < std::min(figures.blows.size(), kMaxPrinted); ++i) {
    const scene::Blow& blow = figures.blows[i];
    fmt::print(notes, "mallet             at {:g} s on {}: {:.3g} ms, {:.3g} N s, {:.3g} N at most, leaves with {:.2g} of its speed\n",
               blow.time_s, base::printable(blow.body), 1e3 * blow.contact_s, blow.impulse_n_s, blow.peak_n, blow.restitution);
  }
  if (figures.blows.size() > kMaxPrinted)
    fmt::print(notes, "mallet             and {} more (--report)\n", figures.blows.size() - kMaxPrinted);
  fmt::print(notes, "physics            {:.2f} s\n", figures.physics_s);
  fmt::print(notes, "sound              {:.2f} s for {:g} s at {} Hz\n", figures.sound_s, scene.duration_s, sound.rate_hz);
  fmt::print(notes, "real-time factor   {:.3f} (below 1 is faster than real time)\n", figures.real_time_factor);
  if (figures.audit) {
    const physics::EnergyAudit& bodies = figures.audit->bodies;
    fmt::print(notes, "energy of bodies   rises by {:.2g} J at most, and by {:.2g} J at a hit; the largest of motion is {:.3g} J\n",
               bodies.rise_j, bodies.hit_rise_j, bodies.kinetic_j);
    fmt::print(notes, "books              {:.4g} J = motion {:.4g} + modes {:.4g} + lost {:.4g}, to {:.2g}; modes had {:.3g} J at most\n",
               bodies.start_j, bodies.motion_j, bodies.modes_j, bodies.lost_j, bodies.error_j, bodies.max_modes_j);
    fmt::print(notes, "energy of modes    rises by a share of {:.2g} at most while nothing acts\n", figures.audit->modes_rise);
    fmt::print(notes, "energy books       at the start {:.4g} J; at the end, of that:\n", bodies.start_j);
    fmt::print(notes, "  motion           {:.4g} J, kinetic and of gravity\n", bodies.motion_j);
    fmt::print(notes, "  modes            {:.4g} J, and {:.4g} J at most\n", bodies.modes_j, bodies.max_modes_j);
    fmt::print(notes, "  lost             {:.4g} J, by friction, in contacts and by the damping of modes\n", bodies.lost_j);
    fmt::print(notes, "  lifted           {:.3g} J, given to bodies that were moved apart ({:.2g} of the largest of motion)\n",
               bodies.lifted_j, bodies.kinetic_j > 0.0 ? bodies.lifted_j / bodies.kinetic_j : 0.0);
    fmt::print(notes, "  difference       {:.2g} J at most\n", bodies.error_j);
    const synth::ModeEnergy& modes = figures.audit->modes;
    fmt::print(notes, "modes as played    were given {:.4g} J, of which they hold {:.4g} J at the end and have lost {:.4g} J\n",
               modes.given_j, modes.held_j, modes.lost_j);
    fmt::print(notes, "  radiated         {:.4g} J of what damping takes from modes, by their radiation gains\n", modes.radiated_j);
    print_contacts(notes, scene, figures.contacts);
  }
  if (sound.peak_pa > 0.0) {
    fmt::print(notes, "peak               {:.4g} Pa at the {}\n", sound.peak_pa, scene.microphones_m.empty() ? "ears" : "microphones");
    fmt::print(notes, "level              {:.1f} dB re 20 uPa, loudest 125 ms {:.1f} dB\n", sound.levels.mean_db, sound.levels.loudest_db);
    fmt::print(notes, "gain               {:.4g} full scale per Pa, peak at {:.1f} dBFS\n", figures.gain.per_pa,
               20.0 * std::log10(figures.gain.per_pa * sound.peak_pa));
    if (sound.faded_s > 0.0) {
      fmt::print(notes,
                 "end                still sounds: faded within the last {:g} ms (\"output\": {{\"fade_end\": false}} cuts it off)\n",
                 1e3 * sound.faded_s);
    }
  } else {
    fmt::print(notes, "peak               0 Pa: nothing sounds in this scene, the file is silent\n");
  }
}

void print_warnings(const scene::Scene& scene, const Sound& sound, const Figures& figures) {
  if (figures.gain.reduced) {
    fmt::print(stderr, "warning: the gain {:g} would clip ({:.1f} dB over full scale at a peak of {:.4g} Pa); {:.4g} is used instead\n",
               *scene.output.gain_per_pa, 20.0 * std::log10(*scene.output.gain_per_pa * sound.peak_pa), sound.peak_pa, figures.gain.per_pa);
  }
  if (sound.refused > 0) fmt::print(stderr, "warning: {} events could not be played: too many at once\n", sound.refused);
  if (sound.faults > 0)
    fmt::print(stderr, "warning: {} events could not be played: their numbers are not finite or out of range\n", sound.faults);
  if (sound.resets > 0) fmt::print(stderr, "warning: {} times a body's state was no number and was cleared\n", sound.resets);
}

/// The scene with the overrides of the command line. Throws InputError.
scene::Scene prepare_scene(const ProgramOptions& options) {
  scene::Scene scene = scene::read_scene(options.scene);
  if (options.rate_hz) scene.sample_rate_hz = *options.rate_hz;
  if (options.format) {
    const auto name = std::find(scene::kSampleFormatNames.begin(), scene::kSampleFormatNames.end(), *options.format);
    scene.output.format = static_cast<scene::SampleFormat>(name - scene::kSampleFormatNames.begin());
  }
  if (options.plan &&
      (options.spectrogram || options.trajectory || options.report || options.record || options.labels || !options.sound.empty())) {
    throw InputError("--plan makes no sound and writes no files; remove the options that name files");
  }
  return scene;
}

void print_plan(const scene::Scene& scene, const scene::Plan& plan) {
  fmt::print("{}", base::printable_lines(effects::format_plan(plan.selector, plan.facts)));
  for (const scene::SceneBody& body : scene.bodies) {
    if (!body.mounting.text.empty()) fmt::print("{}: {}\n", base::printable(body.name), base::printable(body.mounting.text));
    if (const std::string text = describe_limited(body); !text.empty()) fmt::print("{}: {}\n", base::printable(body.name), text);
  }
  for (const scene::SceneSurface& surface : scene.surfaces)
    fmt::print("{}: {}\n", base::printable(surface.name), describe_surface(scene, surface));
}

/// One run: scene, events, sound; each step uses the previous one.
class Run {
 public:
  explicit Run(const ProgramOptions& options) : options_(&options), scene_(prepare_scene(options)) {
    if (is_standard_output(options.sound)) base::check_standard_output("sound");
    check_outputs(options, scene_);
    if (!options.plan) check_room(scene_, options.sound);
    read_surfaces(scene_);
    banks_ = scene::read_banks(scene_, options.quiet);
    head_ = scene::make_head(scene_, scene_.sample_rate_hz);  // before the physics, to report its errors early
    for (const scene::SceneBody& body : scene_.bodies) body_banks_.push_back(body.spec.bank);
    figures_.bodies = scene_.bodies.size() + scene_.surfaces.size();
  }

  /// Events, and the effects that they need.
  scene::Plan find_events() {
    effects::SceneFacts facts =
        scene::make_facts(scene_, scene::make_microphones(scene_), options_->contacts.has_value() || scene::has_physics(scene_));
    const auto started = Clock::now();
    const double cpu_s = base::get_process_cpu_s();
    const bool has_contacts =
        options_->record.has_value() || options_->labels.has_value() || effects::EffectSelector(facts).needs_contacts();
    happened_ = options_->contacts
                    ? scene::read_scene_events(*options_->contacts, scene_, make_spool("contacts"))
                    : scene::simulate(scene_, has_contacts, options_->audit, Progress("physics", options_->quiet), make_spool("contacts"));
    figures_.physics_s = get_seconds_since(started);
    scene_.warnings.insert(scene_.warnings.end(), happened_.warnings.begin(), happened_.warnings.end());
    for (const std::string& warning : scene_.warnings) fmt::print(stderr, "warning: {}\n", base::printable(warning));
    figures_.physics_cpu_s = base::get_process_cpu_s() - cpu_s;
    figures_.tally = scene::count_impulses(happened_.events, scene_.bodies.size());
    figures_.physics_steps = happened_.steps;
    figures_.blows = happened_.blows;
    return scene::make_plan(std::move(facts), happened_.events);
  }

  /// Renders the sound and writes all outputs; nothing is visible before all are complete.
  void render(const scene::Plan& plan) {
    const auto started = Clock::now();
    sound::SoundStore store(scene_.sample_rate_hz, scene::count_channels(scene_), make_spool("sound"));
    sound::SoundStore sensors(find_sensor_rate(scene_), std::max<std::size_t>(1, scene_.sensors.size()), make_spool("sensors"));
    const Sound sound = calc_sound(scene_, body_banks_, happened_.events,
                                   {.rate_hz = scene_.sample_rate_hz,
                                    .plan = &plan,
                                    .audits = options_->audit,
                                    .fades_end = scene_.output.fade_end,
                                    .head = &head_,
                                    .sensors = &sensors,
                                    .energies = options_->labels ? &energies_ : nullptr,
                                    .progress = Progress("sound", options_->quiet)},
                                   store);
    figures_.sound_s = get_seconds_since(started);
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
      const std::string warning = describe_bending(scene_.bodies[i].name, *body_banks_[i], sound.body_deflection[i]);
      if (warning.empty()) continue;
      fmt::print(stderr, "warning: {}\n", base::printable(warning));
      scene_.warnings.push_back(warning);
    }
    if (options_->audit) {
      figures_.audit = make_books(scene_, happened_.energy, sound);
      figures_.contacts = happened_.contacts;
      for (const std::string& warning : list_contact_warnings(scene_, happened_.contacts, happened_.energy)) {
        fmt::print(stderr, "warning: {}\n", warning);
        scene_.warnings.push_back(warning);
      }
    }
    figures_.real_time_factor = (figures_.physics_s + figures_.sound_s) / scene_.duration_s;
    figures_.modes = sound.modes;
    figures_.gain = calc_gain(scene_.output, sound.peak_pa);
    write(plan, sound, store, sensors);
  }

  const scene::Scene& get_scene() const { return scene_; }

 private:
  base::Spool make_spool(const char* what) const { return base::Spool(find_spool_folder(options_->sound), what); }

  void write(const scene::Plan& plan, const Sound& sound, const sound::SoundStore& store, const sound::SoundStore& sensors) {
    const bool to_standard_output = is_standard_output(options_->sound);
    std::FILE* notes = to_standard_output ? stderr : stdout;
    Outputs outputs;
    const auto append_to = [](base::WholeFile& file) { return [&file](std::string_view bytes) { file.append(bytes); }; };
    if (options_->spectrogram) {
      const std::string title =
          fmt::format("{}: {} contacts, {} modes", scene_.file.stem().string(), figures_.tally.contacts, figures_.modes);
      outputs.add(*options_->spectrogram, "spectrogram").append(sound::make_spectrogram_png(store, title));
    }
    if (options_->trajectory) {
      write_trajectory(scene_, body_banks_, happened_.events, make_spool("paths"),
                       append_to(outputs.add(*options_->trajectory, "trajectory")));
    }
    if (options_->report) outputs.add(*options_->report, "report").append(make_report_json(scene_, sound, plan, figures_));
    if (options_->labels) {
      const auto write_labels = is_npz(*options_->labels) ? write_npz : write_jsonl;
      write_labels(make_labels(scene_, body_banks_, happened_.events, energies_), append_to(outputs.add(*options_->labels, "labels")));
    }
    if (options_->record) scene::write_recording(happened_, append_to(outputs.add(*options_->record, "contacts file")));
    const auto write_sound = [&](auto&& sink) { write_wav(store, figures_.gain.per_pa, scene_.output.format, sink); };
    const SoundCodec codec =
        find_codec(options_->sound, scene_.sample_rate_hz, store.get_channels(), scene_.output.format, options_->format.has_value());
    if (!scene_.sensors.empty())
      write_wav(sensors, 1.0, scene::SampleFormat::kFloat, append_to(outputs.add(find_sensor_file(options_->sound), "sensors")));
    if (codec != SoundCodec::kWav)
      write_coded(store, figures_.gain.per_pa, scene_.output.format, codec, outputs.add(options_->sound, "sound"));
    else if (!to_standard_output)
      write_sound(append_to(outputs.add(options_->sound, "sound")));
    if (!options_->quiet) print_summary(notes, scene_, sound, figures_);
    print_warnings(scene_, sound, figures_);
    if (to_standard_output) {
      std::signal(SIGPIPE, SIG_IGN);  // a closed pipe is reported as an error
      write_sound(base::write_standard_output);
    }
    outputs.commit(options_->quiet ? nullptr : notes);
  }

  const ProgramOptions* options_;
  scene::Scene scene_;
  scene::Banks banks_;
  std::vector<const bank::Bank*> body_banks_;
  std::optional<synth::ListeningHead> head_;  // head of the listener
  scene::SceneEvents happened_;
  Figures figures_;
  ModalEnergies energies_;  // with labels
};

}  // namespace

fs::path find_sensor_file(const fs::path& sound) { return fs::path(sound).replace_extension(".sensors.wav"); }

void run(const ProgramOptions& options) {
  Run run(options);
  const scene::Plan plan = run.find_events();
  if (options.plan)
    print_plan(run.get_scene(), plan);
  else
    run.render(plan);
}

}  // namespace carillon::render
