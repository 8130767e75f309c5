// Method: one Player per pass of a recording; receivers are the ears or microphones and their images under a reflecting ground, in the
// coordinates of the recording. Then resampling to the scene's rate, the DC blocker of simulations, gain, and optionally the head.
// With a head, all bodies of one recording come from one direction, their centre. Other bodies neither shade nor reflect.
// Source: docs/equations.md E14; docs/surface-format.md.
#include "runtime/render/surface_playback.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <list>
#include <map>

#include "runtime/acoustics/head/head.hpp"
#include "runtime/acoustics/recording/high_pass.hpp"
#include "runtime/acoustics/recording/player.hpp"
#include "runtime/acoustics/recording/recording.hpp"
#include "runtime/acoustics/recording/resampler.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/quaternion.hpp"
#include "runtime/synth/ambisonics.hpp"
#include "runtime/synth/head_ears.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::render {
namespace {

constexpr std::size_t kPiece = 1024;    // samples per piece
constexpr std::size_t kTurn = 32;       // samples over which the head's direction fades
constexpr int kTailPieces = 4;          // tail of the resamplers: 16 samples of a recording, at most 3072 of the scene
constexpr double kShortestLoopS = 0.1;  // each pass has a player of its own
constexpr double kLoudestPa = 1e6;      // ten bar: implausible
// CPU time per triangle and sample of the recording, and per additional receiver (one core, AMD EPYC, Zen 5).
constexpr double kTriangleSampleNs = 45.0;
constexpr double kReceiverSampleNs = 65.0;

bool is_reflected(const scene::Scene& scene) {
  const effects::EffectOverrides& effects = scene.overrides;
  const synth::Effect effect = synth::Effect::kGroundReflection;
  return scene::find_floor(scene) && (effects.automatic ? !effects.off.has(effect) : effects.on.has(effect));
}

bool is_heard_by_head(const scene::Scene& scene) {
  return scene::has_ambisonics(scene) ||
         (scene::has_head(scene) && scene.effects.has(synth::Effect::kHead) && scene.effects.has(synth::Effect::kTwoEars));
}

/// Scene time [s].
double calc_start_s(const scene::SceneSurface& surface, double rate_hz) { return std::round(surface.start_s * rate_hz) / rate_hz; }

std::string format_rate(double rate_hz) { return fmt::format("{:.6g} Hz", rate_hz); }

}  // namespace

void read_surfaces(scene::Scene& scene) {
  std::map<std::filesystem::path, std::shared_ptr<const recording::RecordedSurface>> files;
  for (scene::SceneSurface& surface : scene.surfaces) {
    auto& file = files[surface.file];
    try {
      if (!file) file = std::make_shared<const recording::RecordedSurface>(surface.file);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: the recording of body \"{}\": {}", surface.place, surface.name, error.what()));
    }
    surface.recording = file;
    if (surface.loop && file->get_duration_s() < kShortestLoopS)
      throw InputError(fmt::format("{}: the recording of body \"{}\" lasts {:.3g} s; a \"loop\" takes one of at least {:g} s",
                                   surface.place, surface.name, file->get_duration_s(), kShortestLoopS));
  }
}

void refuse_surfaces(const scene::Scene& scene, const char* who) {
  if (scene.surfaces.empty()) return;
  throw InputError(fmt::format("{}: body \"{}\" is a recording, which {} cannot play; play it with carillon-render",
                               scene.surfaces[0].place, scene.surfaces[0].name, who));
}

SurfacePlan make_surface_plan(const scene::Scene& scene, const scene::SceneSurface& surface) {
  const recording::RecordedSurface& recording = *surface.recording;
  SurfacePlan plan;
  plan.has_head = is_heard_by_head(scene);
  plan.is_reflected = is_reflected(scene);
  plan.is_resampled = recording.get_header().sample_rate_hz != scene.sample_rate_hz;
  plan.receivers = (plan.has_head ? 1 : scene::count_channels(scene)) * (plan.is_reflected ? 2 : 1);
  const double left_s = scene.duration_s - surface.start_s;
  plan.sounding_s = surface.loop ? left_s : std::min(left_s, recording.get_duration_s());
  plan.cost_s = 1e-9 * plan.sounding_s * recording.get_header().sample_rate_hz * static_cast<double>(recording.get_triangles().size()) *
                (kTriangleSampleNs + kReceiverSampleNs * static_cast<double>(plan.receivers));
  return plan;
}

std::string describe_surface(const scene::Scene& scene, const scene::SceneSurface& surface) {
  const SurfacePlan plan = make_surface_plan(scene, surface);
  const recording::Header& header = surface.recording->get_header();
  const std::size_t channels = scene::count_channels(scene);
  std::string text = fmt::format("recorded surface, {} triangles of {} {}, {:.4g} s from {:g} s on{}", header.triangles, header.bodies,
                                 header.bodies == 1 ? "body" : "bodies", surface.recording->get_duration_s(), surface.start_s,
                                 surface.loop ? ", looped" : "");
  text += scene::has_ambisonics(scene)   ? fmt::format("; in Ambisonics of order {}", scene.listener.order)
          : plan.has_head                ? "; heard through the listener's head"
          : !scene.microphones_m.empty() ? fmt::format("; at {} {}", channels, channels == 1 ? "microphone" : "microphones")
                                         : "; heard at two free ears";
  text += plan.is_reflected ? fmt::format("; with ground reflection, {:g} of the pressure", *scene.reflection) : "";
  text += plan.is_resampled ? fmt::format("; from {} to {}, since the scene has that rate", format_rate(header.sample_rate_hz),
                                          format_rate(scene.sample_rate_hz))
                            : "";
  return text + fmt::format("; about {:.2g} s of CPU time", plan.cost_s);
}

base::Json make_surface_json(const scene::Scene& scene, const scene::SceneSurface& surface, const SurfaceFigures& figures) {
  const SurfacePlan plan = make_surface_plan(scene, surface);
  const recording::Header& header = surface.recording->get_header();
  base::Json json = base::Json::object();
  json.set("name", surface.name).set("recording", surface.file.string()).set("triangles", static_cast<std::int64_t>(header.triangles));
  json.set("bodies", static_cast<std::int64_t>(header.bodies)).set("recorded_s", base::significant(surface.recording->get_duration_s(), 9));
  json.set("recorded_hz", header.sample_rate_hz).set("start_s", base::significant(calc_start_s(surface, scene.sample_rate_hz), 9));
  json.set("sounding_s", base::significant(plan.sounding_s, 9)).set("receivers", plan.receivers).set("head", plan.has_head);
  json.set("ground_reflection", plan.is_reflected).set("resampled", plan.is_resampled).set("why", describe_surface(scene, surface));
  json.set("planned_cpu_s", base::significant(plan.cost_s, 4)).set("cpu_s", base::significant(figures.seconds_cpu, 4));
  json.set("peak_pa", base::finite_or_null(figures.peak_pa, base::significant, 6));
  return json;
}

/// Playback of one recorded surface at all receivers. Invariant: pieces come in order; finished passes free their memory.
class SurfacePlayback::Voice {
 public:
  Voice(const scene::Scene& scene, const scene::SceneSurface& surface, const scene::Microphones& microphones,
        const std::optional<synth::ListeningHead>& head, int rate_hz)
      : surface_(&surface),
        recording_(surface.recording.get()),
        microphones_(&microphones),
        rate_hz_(rate_hz),
        start_(static_cast<std::uint64_t>(std::llround(surface.start_s * rate_hz))),
        alpha_(recording::calc_alpha(surface.high_pass_hz, rate_hz)) {
    if (is_heard_by_head(scene) && head) head_ = *head;
    if (is_reflected(scene)) floor_ = scene::find_floor(scene);
    offsets_m_ = microphones.offset_m;
    if (head_) offsets_m_ = {synth::calc_middle(offsets_m_)};
    const std::size_t ways = floor_ ? 2 : 1;
    blockers_.resize(ways * offsets_m_.size());
    for (std::size_t way = 0; head_ && way < ways; ++way) {
      if (head_->ambisonic_order > 0)
        encoders_.emplace_back(head_->ambisonic_order);
      else
        ears_.emplace_back(head_->head);
    }
  }

  /// Latency of the head: samples not heard at the beginning.
  std::size_t get_latency() const { return head_ ? static_cast<std::size_t>(head_->get_latency()) : 0; }

  /// Adds the next kPiece samples to out (channels, kPiece), delayed by the head's latency.
  void add(std::vector<std::vector<double>>& out) {
    const std::size_t receivers = blockers_.size();
    heard_.assign(receivers * kPiece, 0.0);
    play();
    for (std::size_t i = 0; i < receivers; ++i) {
      const double gain = surface_->gain * (i >= offsets_m_.size() ? floor_->reflection : 1.0);
      for (double& p : get_heard(i)) {
        if (!(std::abs(p) <= kLoudestPa))
          throw InputError(
              fmt::format("{}: the recording {} of body \"{}\" makes {:.3g} Pa about {:.3g} s, which is implausible; give it "
                          "another place, or run carillon-simulate again",
                          surface_->place, surface_->file.string(), surface_->name, p, static_cast<double>(at_) / rate_hz_));
        p = gain * blockers_[i].next(p, alpha_);
      }
    }
    if (head_)
      hear_by_head(out);
    else
      for (std::size_t i = 0; i < receivers; ++i)
        for (std::size_t n = 0; n < kPiece; ++n) out[i % offsets_m_.size()][n] += heard_[i * kPiece + n];
    at_ += kPiece;
  }

 private:
  /// One pass of the recording.
  struct Round {
    std::uint64_t begin;  // sample of the scene
    recording::Player player;
    std::vector<recording::Resampler> resamplers;  // per receiver; empty at equal rates
    int left = kTailPieces;                        // pieces left after the player's end
  };

  std::span<double> get_heard(std::size_t receiver) { return std::span(heard_).subspan(receiver * kPiece, kPiece); }

  /// Position of a receiver in the recording's coordinates, at scene time.
  recording::MovingMicrophone find(std::size_t receiver, double time_s) const {
    const bool is_mirrored = receiver >= offsets_m_.size();
    const synth::Waypoint listener = microphones_->centre.find(time_s);
    Vec3 place = listener.position_m + offsets_m_[receiver % offsets_m_.size()], velocity = listener.velocity_m_s;
    if (is_mirrored) {
      place = floor_->mirror(place);
      velocity = floor_->mirror_direction(velocity);
    }
    const Quaternion back = find_inverse(surface_->pose.rotation);
    recording::MovingMicrophone at;
    at.receiver.place_m = synth::turn(back, place - surface_->pose.position_m);
    at.velocity_m_s = synth::turn(back, velocity);
    return at;
  }

  /// Renders the passes that sound in this piece into heard_.
  void play() {
    const std::size_t receivers = blockers_.size();
    const double length = recording_->get_duration_s() * rate_hz_;
    for (;;) {
      const auto next = start_ + static_cast<std::uint64_t>(std::llround(static_cast<double>(count_) * length));
      if (next >= at_ + kPiece || (count_ > 0 && !surface_->loop)) break;
      rounds_.push_back({next, recording::Player(*recording_, receivers), {}});
      if (recording_->get_header().sample_rate_hz != rate_hz_)
        rounds_.back().resamplers.assign(receivers, recording::Resampler(recording_->get_header().sample_rate_hz, rate_hz_));
      ++count_;
    }
    for (Round& round : rounds_) {
      const std::size_t offset = round.begin > at_ ? static_cast<std::size_t>(round.begin - at_) : 0, count = kPiece - offset;
      const double begin_s = static_cast<double>(round.begin) / rate_hz_;
      const recording::Way way = [&](std::size_t receiver, double time_s) { return find(receiver, begin_s + time_s); };
      const std::size_t missing = round.resamplers.empty() ? count : round.resamplers[0].count_missing(count);
      played_.assign(receivers * missing, 0.0);
      round.player.play(way, missing, played_);
      for (std::size_t i = 0; i < receivers; ++i) {
        const std::span<double> played = std::span(played_).subspan(i * missing, missing), heard = get_heard(i).subspan(offset);
        if (round.resamplers.empty()) {
          for (std::size_t n = 0; n < count; ++n) heard[n] += played[n];
          continue;
        }
        resampled_.resize(count);
        round.resamplers[i].add(played);
        round.resamplers[i].take(resampled_);
        for (std::size_t n = 0; n < count; ++n) heard[n] += resampled_[n];
      }
    }
    rounds_.remove_if([](Round& round) { return round.player.is_over() && round.left-- == 0; });
  }

  /// Direct sound, then ground reflection, each from its direction.
  void hear_by_head(std::vector<std::vector<double>>& out) {
    const recording::Header& header = recording_->get_header();
    for (std::size_t n = 0; n < kPiece; n += kTurn) {
      const double time_s = static_cast<double>(at_ + n + kTurn) / rate_hz_;
      const Vec3 listener = microphones_->centre.find(time_s).position_m + offsets_m_[0];
      for (std::size_t way = 0; way < ears_.size() + encoders_.size(); ++way) {
        // Centre of the bodies at the retarded time; one iteration suffices.
        double age_s = 0.0;
        Vec3 to{};
        for (int round = 0; round < 3; ++round) {
          Vec3 middle = find_middle(time_s - age_s);
          if (way > 0) middle = floor_->mirror(middle);
          to = middle - listener;
          age_s = norm(to) / header.sound_speed_m_s;
        }
        const Vec3 in_head = synth::turn(find_inverse(head_->rotation), to);
        if (!encoders_.empty())
          encoders_[way].process(in_head, get_heard(way).subspan(n, kTurn), out, n);
        else
          ears_[way].process(in_head, get_heard(way).subspan(n, kTurn), std::span(out[0]).subspan(n, kTurn),
                             std::span(out[1]).subspan(n, kTurn));
      }
    }
  }

  /// Centre of the bodies of the recording in scene coordinates, at scene time.
  Vec3 find_middle(double time_s) const {
    const recording::Header& header = recording_->get_header();
    double played_s = std::max(0.0, time_s - static_cast<double>(start_) / rate_hz_);
    if (surface_->loop) played_s = std::fmod(played_s, recording_->get_duration_s());
    const double key =
        std::min(played_s * header.sample_rate_hz / static_cast<double>(header.key_frames), static_cast<double>(header.count_keys() - 1));
    return surface_->pose.position_m + synth::turn(surface_->pose.rotation, recording_->read_centre(static_cast<std::uint64_t>(key)));
  }

  const scene::SceneSurface* surface_;
  const recording::RecordedSurface* recording_;
  const scene::Microphones* microphones_;
  double rate_hz_;
  std::uint64_t start_;
  double alpha_;
  std::optional<synth::ListeningHead> head_;
  std::optional<synth::Floor> floor_;              // if the ground reflects
  std::vector<Vec3> offsets_m_;                    // of ears or microphones; of the head's centre
  std::vector<recording::HighPass> blockers_;      // per receiver: offsets_m_, then their images
  std::vector<synth::HeadEars> ears_;              // of a head: direct, then reflected
  std::vector<synth::AmbisonicEncoder> encoders_;  // in place of ears_
  std::list<Round> rounds_;
  std::uint64_t count_ = 0, at_ = 0;                // passes started; samples made
  std::vector<double> heard_, played_, resampled_;  // heard_ (receivers, kPiece)
};

SurfacePlayback::SurfacePlayback(const scene::Scene& scene, const scene::Microphones& microphones,
                                 const std::optional<synth::ListeningHead>& head, int rate_hz)
    : channels_(scene::count_channels(scene)), figures_(scene.surfaces.size()), ready_(channels_) {
  for (const scene::SceneSurface& surface : scene.surfaces)
    voices_.push_back(std::make_unique<Voice>(scene, surface, microphones, head, rate_hz));
  if (!voices_.empty()) latency_left_ = voices_[0]->get_latency();  // same for all voices: one head per scene
}

SurfacePlayback::~SurfacePlayback() = default;

/// Next piece, without the head's latency at the beginning.
void SurfacePlayback::fill() {
  for (std::vector<float>& channel : ready_) channel.erase(channel.begin(), channel.begin() + static_cast<std::ptrdiff_t>(used_));
  used_ = 0;
  std::vector<std::vector<double>> mix(channels_, std::vector<double>(kPiece));
  for (std::size_t i = 0; i < voices_.size(); ++i) {
    const double began_s = base::get_process_cpu_s();
    std::vector<std::vector<double>> own(channels_, std::vector<double>(kPiece));
    voices_[i]->add(own);
    for (std::size_t c = 0; c < channels_; ++c)
      for (std::size_t n = 0; n < kPiece; ++n) {
        mix[c][n] += own[c][n];
        figures_[i].peak_pa = std::max(figures_[i].peak_pa, std::abs(own[c][n]));
      }
    figures_[i].seconds_cpu += base::get_process_cpu_s() - began_s;
  }
  const std::size_t skipped = std::min(kPiece, latency_left_);
  latency_left_ -= skipped;
  for (std::size_t c = 0; c < channels_; ++c)
    for (std::size_t n = skipped; n < kPiece; ++n) ready_[c].push_back(static_cast<float>(mix[c][n]));
}

void SurfacePlayback::add(std::span<float* const> out, std::size_t count) {
  while (ready_[0].size() < used_ + count) fill();
  for (std::size_t c = 0; c < channels_; ++c)
    for (std::size_t n = 0; n < count; ++n) out[c][n] += ready_[c][used_ + n];
  used_ += count;
}

}  // namespace carillon::render
