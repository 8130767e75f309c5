// Method:     time is cut into periods of kPeriod samples from the first one; a host's block is served from as many whole quanta as it asks
//             for, never across a period. Events are taken from the ring before each piece is made, and act at their own times. Bodies come
//             and go at periods, handed over by two queues with one writer and one reader.
// Source:     Lamport 1983, Specifying concurrent program modules (the queue with one writer and one reader).
// Deviations: none.
#include "runtime/synth/synthesiser.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "runtime/config/error.hpp"
#include "runtime/synth/fp_guard.hpp"

namespace carillon::synth {
namespace {

constexpr int kMostBodies = 1 << 20;
constexpr int kMostMicrophones = 256;

SynthesiserOptions check(SynthesiserOptions options) {
  const auto refuse = [](const char* what) { throw InputError(std::string("a synthesiser needs ") + what); };
  if (!(options.rate_hz >= 1.0 && options.rate_hz <= 1e6)) refuse("a sample rate between 1 Hz and 1 MHz");
  if (options.microphones_m.empty() || options.microphones_m.size() > kMostMicrophones) refuse("one to 256 microphones");
  for (const Vec3& place : options.microphones_m)
    for (const double x : place)
      if (!std::isfinite(x)) refuse("microphones at finite places");
  for (const double x : options.listener_m)
    if (!std::isfinite(x)) refuse("a listener at a finite place");
  if (options.max_bodies < 1 || options.max_bodies > kMostBodies) refuse("room for one to 1,048,576 bodies");
  if (options.max_strikes < 1 || options.max_waypoints < 2 || options.ring_events < 1) refuse("room for strikes, waypoints and events");
  if (!(options.longest_m > 0.0 && options.longest_m < 1e5)) refuse("a longest distance below 100 km");
  return options;
}

}  // namespace

/// One writer, one reader.
template <typename T>
class Synthesiser::Pipe {
 public:
  explicit Pipe(std::size_t room) : items_(room + 1) {}
  bool push(const T& item) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    const std::size_t next = (tail + 1) % items_.size();
    if (next == head_.load(std::memory_order_acquire)) return false;
    items_[tail] = item;
    tail_.store(next, std::memory_order_release);
    return true;
  }
  bool pop(T& item) noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    item = items_[head];
    head_.store((head + 1) % items_.size(), std::memory_order_release);
    return true;
  }

 private:
  std::vector<T> items_;
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
};

struct Synthesiser::Body {
  Body(std::shared_ptr<const Model> model, const BodySettings& settings, const SynthesiserOptions& options)
      : voice(std::move(model), {.max_strikes = options.max_strikes, .silence_pa = settings.silence_pa, .isa = settings.isa}),
        history(options.longest_m, options.rate_hz, kPeriod),
        track(static_cast<std::size_t>(options.max_waypoints)) {
    track.push({.position_m = settings.position_m});
    source.track = &track;
    source.monopole = &history;
    for (const Vec3& place : options.microphones_m) ears.emplace_back(place, options.rate_hz);
  }

  /// [audio-thread] The voice begins with this sample.
  void begin(std::int64_t sample) noexcept {
    first = sample;
    history.skip(sample);
  }

  Voice voice;
  History history;
  Track track;
  Source source;
  std::vector<Ear> ears;   // one a microphone
  std::int64_t first = 0;  // sample of the scene with which the voice began
};

Synthesiser::Synthesiser(SynthesiserOptions options)
    : options_(check(std::move(options))),
      ring_(static_cast<std::size_t>(options_.ring_events)),
      listener_(static_cast<std::size_t>(options_.max_waypoints)) {
  const auto bodies = static_cast<std::size_t>(options_.max_bodies);
  // A number is in at most one command to come and one to leave.
  commands_ = std::make_unique<Pipe<Command>>(2 * bodies);
  gone_ = std::make_unique<Pipe<Command>>(bodies);
  owned_.resize(bodies);
  leaving_.resize(bodies);
  playing_.resize(bodies);
  mix_.resize(options_.microphones_m.size());
  listener_.push({.position_m = options_.listener_m});
}

Synthesiser::~Synthesiser() = default;

int Synthesiser::add_body(std::shared_ptr<const Model> model, const BodySettings& settings) {
  if (model == nullptr) throw InputError("a body needs a model");
  if (model->get_rate_hz() != options_.rate_hz)
    throw InputError("the model is made for " + std::to_string(model->get_rate_hz()) + " Hz, the synthesiser runs at " +
                     std::to_string(options_.rate_hz) + " Hz");
  for (const double x : settings.position_m)
    if (!std::isfinite(x)) throw InputError("a body must be at a finite place");
  collect();
  const auto free = std::find(owned_.begin(), owned_.end(), nullptr);
  if (free == owned_.end())
    throw InputError("there are " + std::to_string(options_.max_bodies) + " bodies already; raise max_bodies, or remove one");
  const auto number = static_cast<int>(free - owned_.begin());
  *free = std::make_unique<Body>(std::move(model), settings, options_);
  commands_->push({.body = free->get(), .number = number});
  return number;
}

void Synthesiser::remove_body(int body) {
  if (body < 0 || body >= options_.max_bodies || owned_[static_cast<std::size_t>(body)] == nullptr ||
      leaving_[static_cast<std::size_t>(body)])
    throw InputError("there is no body " + std::to_string(body));
  leaving_[static_cast<std::size_t>(body)] = true;
  commands_->push({.body = owned_[static_cast<std::size_t>(body)].get(), .number = body, .removes = true});
}

void Synthesiser::collect() {
  Command command;
  while (gone_->pop(command)) {
    owned_[static_cast<std::size_t>(command.number)].reset();
    leaving_[static_cast<std::size_t>(command.number)] = false;
  }
}

bool Synthesiser::is_full() {
  collect();
  return std::find(owned_.begin(), owned_.end(), nullptr) == owned_.end();
}

void Synthesiser::apply_commands() noexcept {
  Command command;
  while (commands_->pop(command)) {
    Body*& place = playing_[static_cast<std::size_t>(command.number)];
    if (command.removes) {
      place = nullptr;
      gone_->push(command);
    } else {
      command.body->begin(sample_);
      place = command.body;
    }
  }
}

Synthesiser::Body* Synthesiser::find_body(std::int32_t number) noexcept {
  Body* body = number >= 0 && number < options_.max_bodies ? playing_[static_cast<std::size_t>(number)] : nullptr;
  if (body == nullptr) ++work_.refused;
  return body;
}

void Synthesiser::take(const stream::Impulse& impulse) noexcept {
  Body* body = find_body(impulse.body);
  if (body == nullptr) return;
  stream::Impulse own = impulse;
  own.time_s -= static_cast<double>(body->first) / options_.rate_hz;
  const VoiceCounters before = body->voice.get_counters();
  body->voice.strike(own);
  const VoiceCounters& after = body->voice.get_counters();
  work_.strikes += after.accepted - before.accepted;
  work_.refused += after.refused - before.refused;
  work_.late += after.late - before.late;
}

void Synthesiser::take(const stream::Motion& motion) noexcept {
  Body* body = find_body(motion.body);
  if (body != nullptr && !body->track.push({motion.time_s, motion.position_m, motion.velocity_m_s})) ++work_.refused;
}

void Synthesiser::take(const stream::Listener& listener) noexcept {
  if (!listener_.push({listener.time_s, listener.position_m, listener.velocity_m_s})) ++work_.refused;
}

void Synthesiser::take_events() noexcept {
  stream::Event event;
  while (ring_.pop(event)) {
    if (const auto* impulse = std::get_if<stream::Impulse>(&event)) take(*impulse);
    if (const auto* motion = std::get_if<stream::Motion>(&event)) take(*motion);
    if (const auto* listener = std::get_if<stream::Listener>(&event)) take(*listener);
  }
}

/// Fills mix_ with the next samples: whole quanta, all of one period.
void Synthesiser::render(int samples) noexcept {
  if (sample_ % kPeriod == 0) apply_commands();
  take_events();
  for (auto& mix : mix_) std::fill_n(mix.begin(), samples, 0.0);
  const auto count = static_cast<std::size_t>(samples);
  for (Body* body : playing_) {
    if (body == nullptr) continue;
    std::fill_n(mono_.begin(), samples, 0.0F);
    const VoiceCounters before = body->voice.get_counters();
    body->voice.process(std::span(mono_).first(count));
    const VoiceCounters& after = body->voice.get_counters();
    work_.resets += after.resets - before.resets;
    work_.mode_samples += after.mode_samples - before.mode_samples;
    body->history.push(std::span<const float>(mono_).first(count));
    if (body->history.is_silent()) continue;
    for (std::size_t m = 0; m < mix_.size(); ++m) body->ears[m].process(body->source, listener_, sample_, std::span(mix_[m]).first(count));
  }
  sample_ += samples;
  rendered_ = held_ = samples;
  horizon_.store(sample_, std::memory_order_relaxed);
}

void Synthesiser::process(float* const* out, int channels, int frames) noexcept {
  const FpGuard guard;
  const auto gain = static_cast<double>(gain_.load(std::memory_order_relaxed));
  const int heard = std::min(channels, get_microphone_count());
  for (int c = heard; c < channels; ++c) std::fill_n(out[c], frames, 0.0F);
  for (int done = 0; done < frames;) {
    if (held_ == 0) {
      const auto left = static_cast<int>(kPeriod - sample_ % kPeriod);
      const int wanted = std::max(1, (frames - done) / kQuantum) * kQuantum;
      render(std::min(left, wanted));
    }
    const int count = std::min(held_, frames - done);
    for (int c = 0; c < heard; ++c) {
      const double* from = mix_[static_cast<std::size_t>(c)].data() + (rendered_ - held_);
      for (int n = 0; n < count; ++n) out[c][done + n] = static_cast<float>(gain * from[n]);
    }
    held_ -= count;
    done += count;
  }
  position_.store(sample_ - held_, std::memory_order_relaxed);
  publish_counters();
}

void Synthesiser::publish_counters() noexcept {
  const std::array<std::int64_t, 5> values{work_.strikes, work_.refused, work_.late, work_.resets, work_.mode_samples};
  for (std::size_t i = 0; i < values.size(); ++i) published_[i].store(values[i], std::memory_order_relaxed);
}

SynthesiserCounters Synthesiser::get_counters() const noexcept {
  const auto get = [this](std::size_t i) { return published_[i].load(std::memory_order_relaxed); };
  return {.strikes = get(0),
          .refused = get(1),
          .late = get(2),
          .faults = ring_.get_faults(),
          .overflows = ring_.get_overflows(),
          .resets = get(3),
          .mode_samples = get(4)};
}

}  // namespace carillon::synth
