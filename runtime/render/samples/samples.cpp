// Method: each sample is a scene of one blow along the normal (runtime/scene), heard at 1 m without delay; the body does not move, so there
// is no acceleration noise. A layer is struck at the speed of its middle velocity, v = v127 (velocity / 127)^2, because samplers play a
// velocity at (velocity / 127)^2 of full scale (SFZ's amp_veltrack): samples are the sound over that factor, times one common gain. Within
// a layer the level follows the blow as far as it is linear; brightness changes from layer to layer. Source: SFZ 1 (Cakewalk 2004);
// docs/equations.md E5a.
#include "runtime/render/samples/samples.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <variant>

#include "runtime/bank/blows.hpp"
#include "runtime/bank/nearest.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/material/mallets.hpp"
#include "runtime/render/render.hpp"
#include "runtime/render/sound/sound_store.hpp"
#include "runtime/render/sound_file.hpp"
#include "runtime/scene/banks.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/strikes.hpp"

namespace carillon::samples {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSampleFolder = "samples";
constexpr int kVelocities = 127, kKeyCount = 128;
constexpr std::size_t kMaxPlaces = 64, kMaxMallets = 16;
constexpr int kMaxLayers = 16, kMaxRoundRobin = 16;
constexpr double kPeakDbfs = -1.0;
constexpr double kSilence = 1e-4;  // end of a sample, share of its peak
constexpr double kShortestS = 0.05;
constexpr double kAround = 0.05;  // distance of alternating strikes from their place, share of the body's extent
constexpr int kVelocityStep = 3;  // step of velocities at which layers are compared with exact blows; not a divisor of usual layer widths

/// Level at which a sampler plays a velocity, relative to full scale.
double calc_share(int velocity) { return std::pow(static_cast<double>(velocity) / kVelocities, 2); }

/// A range of velocities and the one that is struck.
struct Layer {
  int low = 1, high = kVelocities, middle = 64;
  double share() const { return calc_share(middle); }
};

std::vector<Layer> divide_velocities(int layers) {
  std::vector<Layer> list;
  for (int i = 0; i < layers; ++i) {
    Layer layer{.low = 1 + i * kVelocities / layers, .high = (i + 1) * kVelocities / layers};
    layer.middle = (layer.low + layer.high + 1) / 2;
    list.push_back(layer);
  }
  return list;
}

/// One strike and its sound.
struct Sample {
  std::size_t mallet = 0, place = 0;
  int layer = 0, turn = 0;
  std::string file;           // relative to the folder
  std::vector<float> frames;  // [Pa]
  double peak_pa = 0.0;
};

class Maker {
 public:
  explicit Maker(const SampleOptions& options) : options_(&options) {
    check();
    name_ = options.name.empty() ? options.bank.stem().string() : options.name;
    layers_ = divide_velocities(options.layers);
    open();
    choose_places();
  }

  SampleSet run() {
    const fs::path place = base::find_replaceable(
        options_->folder, [](const fs::path& entry) { return entry.filename() == kSampleFolder || base::find_extension(entry) == ".sfz"; },
        "an instrument folder");
    SampleSet set;
    strike_all(set);
    base::WholeFolder whole(place);
    folder_ = whole.path();
    fs::create_directory(folder_ / kSampleFolder);
    const double gain = write_waves(set);
    set.full_scale_pa = 1.0 / gain;
    write_instruments(set);
    whole.commit();
    for (fs::path& instrument : set.instruments) instrument = options_->folder / instrument.filename();
    return set;
  }

 private:
  void check() const {
    const auto require = [](bool is_so, const std::string& message) {
      if (!is_so) throw InputError(message);
    };
    const SampleOptions& o = *options_;
    require(o.layers >= 1 && o.layers <= kMaxLayers, fmt::format("{} velocity layers; give 1 to {}", o.layers, kMaxLayers));
    require(o.round_robin >= 1 && o.round_robin <= kMaxRoundRobin,
            fmt::format("{} alternating strikes; give 1 to {}", o.round_robin, kMaxRoundRobin));
    require(!o.mallets.empty() && o.mallets.size() <= kMaxMallets, fmt::format("{} mallets; give 1 to {}", o.mallets.size(), kMaxMallets));
    require(o.speed_m_s > 0.0 && o.speed_m_s <= 100.0, fmt::format("a mallet of {:g} m/s; give a speed up to 100 m/s", o.speed_m_s));
    require(o.max_seconds >= kShortestS && o.max_seconds <= 600.0,
            fmt::format("samples of {:g} s; give {:g} to 600", o.max_seconds, kShortestS));
    require(o.first_key >= 0 && o.first_key < kKeyCount, fmt::format("key {}; keys are 0 to {}", o.first_key, kKeyCount - 1));
    for (const std::string& name : o.mallets) (void)material::require_mallet("--mallets", name);
  }

  void open() {
    scene_.file = options_->bank;
    scene_.sample_rate_hz = options_->rate_hz;
    scene_.gravity_m_s2 = {};
    scene::SceneBody body;
    body.name = name_;
    body.place = options_->bank.string();
    body.bank = fs::absolute(options_->bank);
    body.spec.name = name_;
    body.spec.fixed = true;
    scene_.bodies.push_back(body);
    scene_.overrides.automatic = false;
    scene_.overrides.on = {synth::Effect::kModal, synth::Effect::kHertzPulse};
    scene_.effects = scene_.overrides.on;
    banks_ = scene::read_banks(scene_);
    bank_ = scene_.bodies[0].spec.bank;
    if (bank_->mode_count() == 0 || bank_->triangles.empty())
      throw InputError(fmt::format("{}: the bank has no modes, so it has no sound", options_->bank.string()));
    scene_.microphones_m = {bank_->rigid.centre_m + Vec3{1.0, 0.0, 0.0}};
    const auto [low, high] = bank::find_extent(bank_->vertices_m);
    extent_m_ = norm(high - low);
  }

  void choose_places() {
    points_ = options_->points_m;
    if (points_.empty())
      for (const std::size_t v : bank::find_strikes(*bank_, options_->places)) points_.push_back(bank_->vertices_m[v]);
    if (points_.empty() || points_.size() > kMaxPlaces)
      throw InputError(fmt::format("{} places; give 1 to {}", points_.size(), kMaxPlaces));
    const std::size_t keys = points_.size() * options_->mallets.size();
    if (options_->keys == Keys::kPlaces && options_->first_key + keys > kKeyCount)
      throw InputError(fmt::format("{} places times {} mallets do not fit the keys from {} to {}; give fewer, or a lower --first-key",
                                   points_.size(), options_->mallets.size(), options_->first_key, kKeyCount - 1));
  }

  /// The place itself, or a neighbouring point of the surface.
  Vec3 find_point(std::size_t place, int turn) const {
    if (turn == 0) return points_[place];
    const bank::NearestPlace at = bank::find_nearest(*bank_, points_[place]);
    const Vec3 normal = bank::calc_normal(bank_->vertices_m, bank_->triangles[at.triangle]);
    if (!(norm(normal) > 0.0)) return points_[place];
    const Vec3 u = find_across(normalise(normal)), v = cross(normalise(normal), u);
    const double angle = 2.0 * std::numbers::pi * turn / std::max(1, options_->round_robin - 1), far = kAround * extent_m_;
    return bank::find_nearest(*bank_, at.point_m + far * std::cos(angle) * u + far * std::sin(angle) * v).point_m;
  }

  scene::SceneStrike make_strike(std::size_t mallet, const Vec3& point_m, int velocity) const {
    scene::SceneStrike strike;
    strike.place = options_->bank.string();
    strike.time_s = 0.0;
    strike.point_m = point_m;
    strike.mallet = scene::make_mallet(material::require_mallet("--mallets", options_->mallets[mallet]));
    strike.mallet->speed_m_s = options_->speed_m_s * calc_share(velocity);
    return strike;
  }

  /// Excitation of each mode by a blow, A-weighted (m) [Pa at 1 m], over the sampler's level at its velocity.
  std::vector<double> calc_amplitudes(const std::vector<events::Event>& events, int velocity) const {
    std::vector<double> amplitudes(bank_->mode_count());
    for (std::size_t m = 0; m < amplitudes.size(); ++m) {
      const double omega = std::sqrt(bank_->eigenvalue_rad2_s2[m]);
      std::complex<double> sum = 0.0;
      for (const events::Event& event : events) {
        const auto* force = std::get_if<events::Force>(&event);
        if (force == nullptr) continue;
        const std::vector<double>& shapes = find_shapes(*force);
        for (int k = 0; k < force->count; ++k) {
          const std::array<float, 3>& j = force->impulse_n_s[k];
          const double amplitude = shapes[3 * m] * j[0] + shapes[3 * m + 1] * j[1] + shapes[3 * m + 2] * j[2];
          sum += amplitude * std::polar(1.0, -omega * (force->time_s + (k + 0.5) * force->step_s));
        }
      }
      amplitudes[m] = bank::calc_a_weight(bank_->freq_hz(m)) * bank_->radiation_gain[m] * std::abs(sum) / calc_share(velocity);
    }
    return amplitudes;
  }

  const std::vector<double>& find_shapes(const events::Force& force) const {
    if (shapes_triangle_ != force.triangle || shapes_at_ != force.barycentric) {
      shapes_triangle_ = force.triangle;
      shapes_at_ = force.barycentric;
      shapes_ = bank::calc_shapes(*bank_, force.triangle, force.barycentric);
    }
    return shapes_;
  }

  /// Accumulates the difference between each velocity's blow and its layer's sample, at this place.
  void compare(std::size_t mallet, const Vec3& point_m) {
    std::vector<std::vector<double>> of_layer;
    for (const Layer& layer : layers_) of_layer.push_back(calc_amplitudes(make_blow(mallet, point_m, layer.middle), layer.middle));
    for (int velocity = kVelocityStep; velocity < kVelocities; velocity += kVelocityStep) {
      const std::vector<double> exact = calc_amplitudes(make_blow(mallet, point_m, velocity), velocity);
      const auto layer = std::find_if(layers_.begin(), layers_.end(), [&](const Layer& l) { return velocity <= l.high; });
      const std::vector<double>& played = of_layer[layer - layers_.begin()];
      double difference = 0.0, whole = 0.0;
      for (std::size_t m = 0; m < exact.size(); ++m) {
        difference += (played[m] - exact[m]) * (played[m] - exact[m]);
        whole += exact[m] * exact[m];
      }
      if (!(whole > 0.0)) continue;
      error_sum_ += difference / whole;
      ++error_count_;
    }
  }

  std::vector<events::Event> make_blow(std::size_t mallet, const Vec3& point_m, int velocity) {
    scene_.strikes = {make_strike(mallet, point_m, velocity)};
    return scene::make_strikes(scene_, {bank_}).events;
  }

  void strike_all(SampleSet& set) {
    const double all = static_cast<double>(options_->mallets.size() * points_.size()) * options_->layers * options_->round_robin;
    for (std::size_t mallet = 0; mallet < options_->mallets.size(); ++mallet)
      for (std::size_t place = 0; place < points_.size(); ++place)
        for (int turn = 0; turn < options_->round_robin; ++turn) {
          const Vec3 point_m = find_point(place, turn);
          if (turn == 0) compare(mallet, point_m);
          for (int layer = 0; layer < options_->layers; ++layer) {
            const std::vector<events::Event> blow = make_blow(mallet, point_m, layers_[layer].middle);
            samples_.push_back(render(blow, {.mallet = mallet, .place = place, .layer = layer, .turn = turn, .file = {}, .frames = {}}));
            if (options_->progress) options_->progress(static_cast<double>(samples_.size()) / all);
          }
        }
    set.samples = samples_.size();
    set.warning = render::describe_bending(name_, *bank_, deflection_);
    set.error_db = error_count_ > 0 ? 10.0 * std::log10(std::max(error_sum_ / error_count_, 1e-30)) : 0.0;
  }

  Sample render(const std::vector<events::Event>& events, Sample sample) {
    scene_.duration_s = options_->max_seconds;
    sound::SoundStore store(options_->rate_hz, 1);
    const render::Sound sound =
        render::calc_sound(scene_, {bank_}, scene::make_events(events), {.rate_hz = options_->rate_hz, .fades_end = true}, store);
    deflection_ = std::max(deflection_, sound.body_deflection[0]);
    sample.frames.resize(store.get_frames());
    store.read(0, sample.frames);
    for (const float p : sample.frames) sample.peak_pa = std::max(sample.peak_pa, static_cast<double>(std::abs(p)));
    std::size_t end = sample.frames.size();
    while (end > 0 && std::abs(static_cast<double>(sample.frames[end - 1])) <= kSilence * sample.peak_pa) --end;
    sample.frames.resize(
        std::min(sample.frames.size(), std::max<std::size_t>(end, static_cast<std::size_t>(kShortestS * options_->rate_hz))));
    sample.file = fmt::format("{}/{}-{}-{}-v{}{}.wav", kSampleFolder, name_, options_->mallets[sample.mallet], sample.place + 1,
                              layers_[sample.layer].middle, options_->round_robin > 1 ? fmt::format("-r{}", sample.turn + 1) : "");
    return sample;
  }

  /// Full scale per pascal at velocity 127.
  double write_waves(SampleSet& set) const {
    double loudest = 0.0;
    const auto share = [&](const Sample& sample) { return layers_[sample.layer].share(); };
    for (const Sample& sample : samples_) loudest = std::max(loudest, sample.peak_pa / share(sample));
    if (!(loudest > 0.0)) throw InputError(fmt::format("{}: all strikes are silent; choose other points", options_->bank.string()));
    const double gain = std::pow(10.0, kPeakDbfs / 20.0) / loudest;
    for (const Sample& sample : samples_) {
      sound::SoundStore store(options_->rate_hz, 1);
      store.append(sample.frames);
      base::WholeFile file(folder_ / sample.file);
      render::write_wav(store, gain / share(sample), options_->format, [&](std::string_view bytes) { file.append(bytes); });
      file.commit();
      set.bytes += static_cast<double>(render::calc_wav_bytes(1, options_->format, sample.frames.size()));
    }
    return gain;
  }

  std::string write_region(const Sample& sample) const {
    const Layer& layer = layers_[sample.layer];
    const bool is_pitched = options_->keys == Keys::kPitches;
    const auto places = static_cast<int>(points_.size());
    std::string text = fmt::format("<region> sample={} lovel={} hivel={}", sample.file, layer.low, layer.high);
    const int length = options_->round_robin * (is_pitched ? places : 1);
    const int position = sample.turn * (is_pitched ? places : 1) + (is_pitched ? static_cast<int>(sample.place) : 0) + 1;
    if (length > 1) text += fmt::format(" seq_length={} seq_position={}", length, position);
    return text + "\n";
  }

  /// Key and cents of the loudest mode at the first place.
  std::pair<int, double> find_pitch() const {
    const bank::NearestPlace at = bank::find_nearest(*bank_, points_[0]);
    const std::size_t vertex = bank_->triangles[at.triangle][0];
    const std::vector<double> levels = bank::calc_blow_amplitudes(*bank_, vertex, bank::calc_vertex_normals(*bank_)[vertex]);
    const std::size_t loudest = std::max_element(levels.begin(), levels.end()) - levels.begin();
    const double key = 69.0 + 12.0 * std::log2(bank_->freq_hz(loudest) / 440.0);
    const int nearest = std::clamp(static_cast<int>(std::lround(key)), 0, kKeyCount - 1);
    return {nearest, 100.0 * (key - nearest)};
  }

  std::string write_head(double full_scale_pa) const {
    return fmt::format(
        "// {}: strikes of a body. Full scale at velocity 127 is {:.4g} Pa at 1 m; below, the level goes with the square of the velocity.\n"
        "<global>\nloop_mode=one_shot\namp_veltrack=100\nampeg_release=0.05\n",
        name_, full_scale_pa);
  }

  void write_instruments(SampleSet& set) const {
    const auto write = [&](const std::string& name, const std::string& text) {
      set.instruments.push_back(folder_ / (name + ".sfz"));
      base::write_file(set.instruments.back(), text);
    };
    if (options_->keys == Keys::kPitches) {
      const auto [key, cents] = find_pitch();
      for (std::size_t mallet = 0; mallet < options_->mallets.size(); ++mallet) {
        std::string text = write_head(set.full_scale_pa);
        text +=
            fmt::format("<group> lokey=0 hikey={} pitch_keycenter={} tune={}\n", kKeyCount - 1, key, -static_cast<int>(std::lround(cents)));
        for (const Sample& sample : samples_)
          if (sample.mallet == mallet) text += write_region(sample);
        write(options_->mallets.size() == 1 ? name_ : fmt::format("{}-{}", name_, options_->mallets[mallet]), text);
      }
      return;
    }
    std::string text = write_head(set.full_scale_pa);
    const Sample* before = nullptr;
    for (const Sample& sample : samples_) {
      if (before == nullptr || before->mallet != sample.mallet || before->place != sample.place) {
        const std::size_t key = static_cast<std::size_t>(options_->first_key) + sample.mallet * points_.size() + sample.place;
        const Vec3& x = points_[sample.place];
        text += fmt::format("// {}, at {:.4g}, {:.4g}, {:.4g} m\n<group> lokey={} hikey={} pitch_keycenter={} pitch_keytrack=0\n",
                            options_->mallets[sample.mallet], x[0], x[1], x[2], key, key, key);
      }
      before = &sample;
      text += write_region(sample);
    }
    write(name_, text);
  }

  const SampleOptions* options_;
  fs::path folder_;  // temporary until complete
  std::string name_;
  std::vector<Layer> layers_;
  scene::Scene scene_;
  scene::Banks banks_;
  const bank::Bank* bank_ = nullptr;
  double extent_m_ = 0.0;
  std::vector<Vec3> points_;
  std::vector<Sample> samples_;
  double deflection_ = 0.0;  // in thicknesses
  double error_sum_ = 0.0;
  int error_count_ = 0;
  mutable std::int32_t shapes_triangle_ = -1;
  mutable Vec3 shapes_at_{};
  mutable std::vector<double> shapes_;
};

}  // namespace

SampleSet make_samples(const SampleOptions& options) { return Maker(options).run(); }

}  // namespace carillon::samples
