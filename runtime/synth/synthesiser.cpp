// Method:     blocks of kBlock samples from the first sample; a call of the host is served from as many whole sub-blocks as it asks for,
//             never across a block. Events are taken from the ring before each piece is rendered, and act at their own times. Bodies are
//             added, swapped and removed at blocks, through two single-producer single-consumer queues. Sleeping bodies cost one bit,
//             tested 64 at once.
// Source:     Lamport 1983, Specifying concurrent program modules (single-producer single-consumer queue).
#include "runtime/synth/synthesiser.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <utility>

#include "runtime/acoustics/head/head.hpp"
#include "runtime/base/error.hpp"
#include "runtime/synth/fp_guard.hpp"

namespace carillon::synth {
namespace {

constexpr double kMaxModes = 1 << 24;
constexpr int kMaxBodies = 1 << 20;
constexpr std::int64_t kGiveBackEvery = 8;  // blocks: 21 ms at 48 kHz
constexpr int kMaxMicrophones = 256;
constexpr int kMaxRoom = 1 << 24;
constexpr std::size_t kWaitingSensors = 1024;

SynthesiserOptions check(SynthesiserOptions options) {
  const auto refuse = [](const char* what) { throw InputError(std::string("a synthesiser needs ") + what); };
  if (!(options.rate_hz >= 1.0 && options.rate_hz <= 1e6)) refuse("a sample rate between 1 Hz and 1 MHz");
  if (options.microphones_m.empty() || options.microphones_m.size() > kMaxMicrophones) refuse("one to 256 microphones");
  for (const Vec3& place : options.microphones_m)
    for (const double x : place)
      if (!std::isfinite(x)) refuse("finite microphone positions");
  for (const double x : options.listener_m)
    if (!std::isfinite(x)) refuse("a finite listener position");
  if (const char* fault = find_fault(options.ground); fault != nullptr) throw InputError(std::string("ground: ") + fault);
  if (const auto& floor = options.floor; floor) {
    if (const char* fault = find_fault(*floor); fault != nullptr) throw InputError(std::string("floor: ") + fault);
    for (const Vec3& place : options.microphones_m)
      if (floor->calc_height_m(options.listener_m + place) < 0.0) refuse("microphones above its floor");
  }
  if (options.head && options.head->ambisonic_order != 0) {
    const int order = options.head->ambisonic_order;
    if (order < 1 || order > kMaxAmbisonicOrder || options.microphones_m.size() != count_ambisonic_channels(order))
      refuse("Ambisonics of order 1 to 3, and a microphone for each of their channels");
  } else if (options.head) {
    if (options.microphones_m.size() != 2) refuse("two microphones, left and right, for a head");
    if (options.head->head == nullptr || options.head->head->get_sample_rate_hz() != options.rate_hz)
      refuse("a head that is made for its sample rate");
  }
  if (options.max_bodies < 1 || options.max_bodies > kMaxBodies) refuse("room for one to 1,048,576 bodies");
  const auto is_room = [](int places, int least) { return places >= least && places <= kMaxRoom; };
  if (!is_room(options.max_strikes, 1) || !is_room(options.max_forces, 0) || !is_room(options.max_waypoints, 2) ||
      !is_room(options.ring_events, 1))
    refuse("room for strikes, waypoints and events, 16,777,216 each at most");
  if (!(options.longest_m > 0.0 && options.longest_m < 1e5)) refuse("a longest distance below 100 km");
  if (!(options.transfers_per_s > 0.0 && options.transfers_per_s < 1e15)) refuse("a positive number of transfers_per_s");
  return options;
}

}  // namespace

/// Single-producer single-consumer queue.
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
  /// Items that push() would take now, or more.
  std::size_t get_room() const noexcept {
    const std::size_t head = head_.load(std::memory_order_acquire), tail = tail_.load(std::memory_order_relaxed);
    return (head + items_.size() - tail - 1) % items_.size();
  }

 private:
  std::vector<T> items_;
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
};

Synthesiser::Synthesiser(SynthesiserOptions options)
    : options_(check(std::move(options))),
      ring_(static_cast<std::size_t>(options_.ring_events)),
      listener_(static_cast<std::size_t>(options_.max_waypoints), options_.microphones_m, options_.listener_m, options_.floor,
                options_.head),
      allowed_(options_.budget) {
  const std::size_t bodies = options_.max_bodies;
  // Per number at most three commands (add, swap, remove) and two answers; add_sensor() leaves room for them.
  commands_ = std::make_unique<Pipe<Command>>(3 * bodies + kWaitingSensors);
  gone_ = std::make_unique<Pipe<Command>>(2 * bodies);
  owned_.resize(bodies);
  published_bodies_ = std::make_unique<Published[]>(bodies);
  playing_.resize(bodies);
  directed_.reserve(bodies);
  sensed_.reserve(bodies);
  awake_.resize((bodies + 63) / 64);
  mix_.resize(options_.microphones_m.size());
  if (options_.head) latency_ += options_.head->get_latency();
}

Synthesiser::~Synthesiser() = default;

void Synthesiser::check_model(const Model* model) const {
  if (model == nullptr) throw InputError("a body needs a model");
  if (model->get_rate_hz() != options_.rate_hz)
    throw InputError("the model is made for " + std::to_string(model->get_rate_hz()) + " Hz, the synthesiser runs at " +
                     std::to_string(options_.rate_hz) + " Hz");
}

/// Throws InputError for effects without the head or the floor that they need.
void Synthesiser::check_surroundings(EffectSet effects) const {
  if (effects.has(Effect::kHead) && !options_.head)
    throw InputError("head needs a listener with a head; give the synthesiser one, or leave the effect out");
  if (effects.has(Effect::kGroundReflection) && !options_.floor)
    throw InputError("ground_reflection needs a floor; give the synthesiser one, or leave the effect out");
}

int Synthesiser::add_body(std::shared_ptr<const Model> model, const BodySettings& settings) {
  check_model(model.get());
  check_surroundings(settings.effects);
  if (events::find_fault(events::BodyMotion{.position_m = settings.position_m, .rotation = settings.rotation}) != nullptr)
    throw InputError("the position of a body must be finite and its rotation a unit quaternion");
  if (!(settings.longest_m >= 0.0 && settings.longest_m < 1e5) || settings.max_waypoints < 0 || settings.max_waypoints > kMaxRoom ||
      settings.max_forces > kMaxRoom)
    throw InputError("a body needs a longest distance below 100 km, and room for at most 16,777,216 waypoints and forces");
  // Also checked for bodies without modes.
  if (!(settings.silence_pa > 0.0) || !std::isfinite(settings.silence_pa))
    throw InputError("silence_pa of a body must be a positive number");
  if (!(settings.gain >= 0.0 && settings.gain <= 1e6)) throw InputError("the gain of a body must be 0 to 1e6");
  if (const char* fault = find_fault(settings.surface); fault != nullptr) throw InputError(std::string("surface of a body: ") + fault);
  collect();
  const std::size_t free = find_free();
  if (free == owned_.size())
    throw InputError("there are " + std::to_string(options_.max_bodies) + " bodies already; raise max_bodies, or remove one");
  const auto number = static_cast<int>(free);
  auto body = std::make_unique<SoundingBody>(
      std::move(model),
      BodyFrame{.propagation = {.rate_hz = options_.rate_hz,
                                .microphones_m = options_.microphones_m,
                                .longest_m = settings.longest_m > 0.0 ? settings.longest_m : options_.longest_m,
                                .max_waypoints = settings.max_waypoints > 0 ? settings.max_waypoints : options_.max_waypoints,
                                .floor = options_.floor,
                                .head = options_.head,
                                .phase = number},
                .max_strikes = options_.max_strikes,
                .max_forces = settings.max_forces >= 0 ? settings.max_forces : options_.max_forces,
                .silence_pa = settings.silence_pa,
                .isa = settings.isa,
                .surface = settings.surface,
                .gain = static_cast<float>(settings.gain),
                .audits_energy = settings.audits_energy},
      settings.effects, settings.position_m, settings.rotation);
  Published& published = published_bodies_[free];
  for (const Effect effect : EffectSet::all()) published.units[effect].store(0, std::memory_order_relaxed);
  published.peak_pa.store(0.0F, std::memory_order_relaxed);
  published.deflection.store(0.0, std::memory_order_relaxed);
  published.energy_rise.store(0.0, std::memory_order_relaxed);
  for (auto* energy : {&published.given_j, &published.lost_j, &published.held_j, &published.radiated_j})
    energy->store(0.0, std::memory_order_relaxed);
  Owned& owned = owned_[free];
  owned.body = std::move(body);
  commands_->push({.body = owned.body.get(), .number = number, .kind = Command::Kind::kAdd});
  return number;
}

/// Index of a body that exists and is not being removed.
std::size_t Synthesiser::check_owned(int body) const {
  const std::size_t i = body;
  if (body < 0 || i >= owned_.size() || owned_[i].body == nullptr || owned_[i].is_leaving)
    throw InputError("there is no body " + std::to_string(body));
  return i;
}

/// First free number; owned_.size() if there is none.
std::size_t Synthesiser::find_free() const {
  const auto free = std::find_if(owned_.begin(), owned_.end(), [](const Owned& owned) { return owned.body == nullptr; });
  return free - owned_.begin();
}

void Synthesiser::swap_model(int body, std::shared_ptr<const Model> model) {
  check_model(model.get());
  collect();
  Owned& owned = owned_[check_owned(body)];
  if (owned.sensors != nullptr) throw InputError("a body with sensors keeps its model; remove it and add it again");
  owned.body->check(*model);
  std::shared_ptr<const Model> before = std::exchange(owned.wanted_model, std::move(model));
  try {
    send_swap(body);
  } catch (...) {
    owned.wanted_model = std::move(before);
    throw;
  }
}

int Synthesiser::add_sensor(int body, const bank::Bank& bank, const SensorSettings& settings) {
  collect();
  Owned& owned = owned_[check_owned(body)];
  const EffectSet effects = owned.body->get_effects();
  if (!effects.has(Effect::kModal)) throw InputError("a sensor needs the effect \"modal\" of its body");
  if (effects.has(Effect::kNonlinear) && settings.quantity == Quantity::kAcceleration)
    throw InputError("the acceleration of a body with the effect \"nonlinear\" is not known; use its velocity, or leave the effect out");
  if (owned.swap != nullptr || owned.wanted_model != nullptr) throw InputError("add sensors before the model of a body is swapped");
  if (owned.sensor_numbers.size() == BodySensors::kMax || (free_sensors_.empty() && sensors_.size() == kMaxSensors))
    throw InputError("there are too many sensors; a body may have " + std::to_string(BodySensors::kMax) + ", all bodies together " +
                     std::to_string(kMaxSensors));
  if (commands_->get_room() <= 3 * owned_.size()) throw InputError("too many new sensors wait; process the next frames first");
  auto sensor = std::make_unique<Sensor>(owned.body->get_model(), bank, settings);
  if (owned.sensors == nullptr) owned.sensors = owned.body->make_sensors();
  sensors_.reserve(kMaxSensors);       // so that find_sensor() needs no lock,
  free_sensors_.reserve(kMaxSensors);  // and that collect() does not allocate
  owned.sensor_numbers.reserve(BodySensors::kMax);
  commands_->push(
      {.body = owned.body.get(), .sensors = owned.sensors.get(), .sensor = sensor.get(), .number = body, .kind = Command::Kind::kSense});
  auto number = static_cast<int>(sensors_.size());
  if (free_sensors_.empty()) {
    sensors_.push_back(std::move(sensor));
    sensor_count_.store(number + 1, std::memory_order_release);
  } else {
    number = free_sensors_.back();
    free_sensors_.pop_back();
    sensors_[number] = std::move(sensor);
  }
  owned.sensor_numbers.push_back(number);
  return number;
}

EffectSet Synthesiser::get_effects(int body) const { return owned_[check_owned(body)].body->get_effects(); }

/// Sends the pending swap unless an earlier one is in progress.
void Synthesiser::send_swap(int number) {
  Owned& owned = owned_[number];
  if (owned.swap != nullptr || owned.is_leaving || owned.wanted_model == nullptr) return;
  owned.swap = owned.body->make_swap(owned.wanted_model);
  owned.wanted_model.reset();
  commands_->push({.body = owned.body.get(), .swap = owned.swap.get(), .number = number, .kind = Command::Kind::kSwap});
}

void Synthesiser::remove_body(int body) {
  Owned& owned = owned_[check_owned(body)];
  owned.is_leaving = true;
  commands_->push({.body = owned.body.get(), .number = body, .kind = Command::Kind::kRemove});
}

void Synthesiser::collect() noexcept {
  const auto try_to_send = [this](int number) noexcept {
    try {
      send_swap(number);
    } catch (...) {  // out of memory: stays pending
      has_unsent_ = true;
    }
  };
  if (std::exchange(has_unsent_, false)) {
    for (std::size_t i = 0; i < owned_.size(); ++i)
      if (owned_[i].body != nullptr) try_to_send(static_cast<int>(i));
  }
  Command command;
  while (gone_->pop(command)) {
    Owned& owned = owned_[command.number];
    if (command.kind == Command::Kind::kRemove) {
      free_sensors_.insert(free_sensors_.end(), owned.sensor_numbers.begin(), owned.sensor_numbers.end());
      owned = Owned{};
      continue;
    }
    owned.swap.reset();
    try_to_send(command.number);
  }
}

bool Synthesiser::is_full() noexcept {
  collect();
  return find_free() == owned_.size();
}

void Synthesiser::set_awake(int number) noexcept {
  awake_[static_cast<std::size_t>(number) / 64] |= std::uint64_t{1} << (static_cast<unsigned>(number) % 64U);
}

/// Bodies with directivity and with sensors.
void Synthesiser::list_kinds() noexcept {
  directed_.clear();
  sensed_.clear();
  for (SoundingBody* body : playing_) {
    if (body != nullptr && body->is_directed()) directed_.push_back(body);
    if (body != nullptr && body->has_sensors()) sensed_.push_back(body);
  }
}

/// At the start of a block: distributes the transfer look-ups over the bodies.
void Synthesiser::share_transfers() noexcept {
  if (directed_.empty()) return;
  std::int64_t needs = 0;
  for (SoundingBody* body : directed_) needs += body->find_transfer_need(sample_);
  transfers_.begin(options_.transfers_per_s * kBlock / options_.rate_hz, static_cast<int>(directed_.size()), needs);
  for (SoundingBody* body : directed_) body->set_transfer_share(transfers_);
}

void Synthesiser::apply_commands() noexcept {
  Command command;
  bool changes = false;
  while (commands_->pop(command)) {
    changes = true;
    if (command.kind == Command::Kind::kRemove) {
      playing_[command.number] = nullptr;
      gone_->push(command);
      continue;
    }
    playing_[command.number] = command.body;
    if (command.kind == Command::Kind::kSense)
      command.body->sense(*command.sensors, *command.sensor, sample_);
    else if (command.kind == Command::Kind::kSwap)
      command.body->apply(*command.swap, listener_, sample_);
    else
      command.body->begin(listener_, sample_);
    set_awake(command.number);
  }
  if (changes) list_kinds();
}

/// Calls `work(number, body)` for every awake body, by number; those for which it returns false fall asleep.
template <typename Work>
void Synthesiser::for_awake(Work&& work) noexcept {
  for (std::size_t w = 0; w < awake_.size(); ++w) {
    for (std::uint64_t left = awake_[w]; left != 0; left &= left - 1) {
      const auto number = static_cast<int>(w * 64) + std::countr_zero(left);
      SoundingBody* body = playing_[number];
      if (body == nullptr || !work(number, *body)) awake_[w] &= ~(left & (~left + 1));
    }
  }
}

/// Runs `work` on a body and adds its counts to the totals.
template <typename Work>
void Synthesiser::count(const SoundingBody& body, Work&& work) noexcept {
  const BodyWork& now = body.get_work();
  const std::int64_t strikes = now.strikes, refused = now.refused, late = now.late, resets = now.resets;
  const std::int64_t mode_samples = now.units[Effect::kModal];
  work();
  work_.strikes += now.strikes - strikes;
  work_.refused += now.refused - refused;
  work_.late += now.late - late;
  work_.resets += now.resets - resets;
  work_.mode_samples += now.units[Effect::kModal] - mode_samples;
}

SoundingBody* Synthesiser::find_body(std::int32_t number) noexcept {
  SoundingBody* body = number >= 0 && number < options_.max_bodies ? playing_[number] : nullptr;
  if (body == nullptr) ++work_.refused;
  return body;
}

void Synthesiser::take(const events::TimeWatermark& mark) noexcept {
  marked_s_ = std::max(marked_s_, mark.time_s);
  has_marks_ = true;
}

/// At the start of a block: counts an underrun if the physics has not reached its end. Later events are late.
void Synthesiser::watch_marks() noexcept {
  const bool is_overtaken = has_marks_ && marked_s_ * options_.rate_hz < static_cast<double>(sample_ + kBlock);
  work_.underruns += static_cast<std::int64_t>(is_overtaken && !is_overtaken_);
  is_overtaken_ = is_overtaken;
}

template <class Strike>
void Synthesiser::take_strike(const Strike& strike) noexcept {
  SoundingBody* body = find_body(strike.body);
  if (body == nullptr) return;
  count(*body, [&] {
    if (!body->take(strike, sample_)) return;
    set_awake(strike.body);
    give_floor(*body);
  });
  publish(strike.body);
}

void Synthesiser::take(const events::LastingContact& contact) noexcept {
  SoundingBody* body = find_body(contact.body);
  if (body == nullptr) return;
  const SoundingBody* other = contact.other >= 0 && contact.other < options_.max_bodies ? playing_[contact.other] : nullptr;
  count(*body, [&] {
    if (!body->take(contact, other != nullptr ? other->get_surface() : options_.ground, sample_, work_.contacts)) return;
    set_awake(contact.body);
    give_floor(*body);
  });
}

void Synthesiser::take(const events::BodyMotion& motion) noexcept {
  SoundingBody* body = find_body(motion.body);
  if (body != nullptr && !body->take(motion)) ++work_.refused;
}

void Synthesiser::take(const events::Listener& listener) noexcept {
  if (!listener_.push(listener)) ++work_.refused;
}

void Synthesiser::take_events() noexcept {
  events::Event event;
  while (ring_.pop(event)) {
    if (const auto* mark = std::get_if<events::TimeWatermark>(&event)) take(*mark);
    if (const auto* impulse = std::get_if<events::Impulse>(&event)) take_strike(*impulse);
    if (const auto* force = std::get_if<events::Force>(&event)) take_strike(*force);
    if (const auto* contact = std::get_if<events::LastingContact>(&event)) take(*contact);
    if (const auto* motion = std::get_if<events::BodyMotion>(&event)) take(*motion);
    if (const auto* listener = std::get_if<events::Listener>(&event)) take(*listener);
  }
}

/// Returns finished swaps to the main thread, at the start of a block.
void Synthesiser::finish_swaps() noexcept {
  for_awake([&](int number, SoundingBody& body) {
    if (ModelSwap* swap = body.finish_swap(sample_))
      gone_->push({.body = &body, .swap = swap, .number = number, .kind = Command::Kind::kSwap});
    return true;
  });
}

/// Sets the audibility floor of strikes in this block, also of a body that wakes within it, and limits the body to as many modes as the
/// whole budget has room for: more would be removed at once, and their work would remove others.
void Synthesiser::give_floor(SoundingBody& body) noexcept {
  ResonatorBank* modes = body.get_modes();
  if (!limited_ || modes == nullptr) return;
  const double allowed = allowed_.load(std::memory_order_relaxed) / options_.rate_hz;
  modes->set_max_modes(allowed > 0.0 ? static_cast<int>(std::min(allowed, kMaxModes)) : 0);
  const std::int64_t begin = sample_ / kBlock * kBlock;
  modes->set_floor(budget_.get_floor_pa() / body.calc_nearness(listener_, begin));
}

/// At the start of a block: removes modes beyond the budget.
void Synthesiser::keep_budget() noexcept {
  const double per_s = allowed_.load(std::memory_order_relaxed);
  const std::int64_t spent = work_.mode_samples - spent_before_;
  spent_before_ = work_.mode_samples;
  if (per_s == std::numeric_limits<double>::infinity()) {
    if (!limited_) return;
    limited_ = false;
    budget_ = Budget();
    for (SoundingBody* body : playing_)
      if (ResonatorBank* modes = body != nullptr ? body->get_modes() : nullptr) {
        modes->set_floor(0.0F);
        modes->set_max_modes(static_cast<int>(kMaxModes));
        modes->allow_contacts(modes->get_group_count());
      }
    return;
  }
  limited_ = true;
  std::int64_t groups = 0;
  int awake = 0;
  for_awake([&](int, SoundingBody& body) {
    const ResonatorBank* modes = body.get_modes();
    const int live = modes == nullptr ? 0 : modes->get_ringing_group_count();
    groups += live;
    awake += static_cast<int>(live > 0);
    return true;
  });
  const double allowed = per_s > 0.0 ? per_s * kBlock / options_.rate_hz : 0.0;
  const bool is_too_much = budget_.begin(allowed, static_cast<double>(spent), groups, awake);
  const bool gives_back = budget_.has_room() && sample_ / kBlock % kGiveBackEvery == 0;
  if (is_too_much) {
    for_awake([&](int, SoundingBody& body) {
      if (ResonatorBank* modes = body.get_modes()) budget_.add(modes->measure(body.calc_nearness(listener_, sample_)));
      return true;
    });
    budget_.decide();
  }
  for_awake([&](int, SoundingBody& body) {
    ResonatorBank* modes = body.get_modes();
    give_floor(body);
    if (modes != nullptr && gives_back) modes->allow_contacts(1);
    if (!is_too_much || modes == nullptr || modes->get_ringing_group_count() == 0) return true;
    const int stay = budget_.find_limit(modes->get_measured());
    work_.faded += modes->get_ringing_group_count() - stay;
    modes->truncate(stay);
    return true;
  });
}

/// Fills mix_ with the next samples: whole sub-blocks within one block.
void Synthesiser::render(int samples) noexcept {
  const bool begins = sample_ % kBlock == 0;
  if (begins) apply_commands();
  take_events();
  if (begins) {
    finish_swaps();
    watch_marks();
    keep_budget();
    share_transfers();
  }
  for (auto& mix : mix_) std::fill_n(mix.begin(), samples, 0.0);
  for_awake([&](int number, SoundingBody& body) {
    if (body.is_asleep()) return false;
    body.reach(marked_s_);
    count(body, [&] { body.render(sample_, static_cast<std::size_t>(samples), listener_, scratch_, mix_); });
    publish(number);
    return true;
  });
  for (SoundingBody* body : sensed_) body->finish_sensors(samples);
  sample_ += samples;
  rendered_ = held_ = samples;
  horizon_.store(sample_, std::memory_order_relaxed);
}

void Synthesiser::process(float* const* out, int channels, int frames) noexcept {
  const FpGuard guard;
  const auto gain = static_cast<double>(gain_.load(std::memory_order_relaxed));
  const int heard = std::min(channels, get_microphone_count());
  for (int c = heard; c < channels; ++c) std::fill_n(out[c], frames, 0.0F);
  if (frames <= 0) {
    if (held_ == 0 && sample_ % kBlock == 0) apply_commands();
    take_events();
  }
  for (int done = 0; done < frames;) {
    if (held_ == 0) {
      const auto left = static_cast<int>(kBlock - sample_ % kBlock);
      const int wanted = std::max(1, (frames - done) / kSubBlock) * kSubBlock;
      render(std::min(left, wanted));
    }
    const int count = std::min(held_, frames - done);
    for (int c = 0; c < heard; ++c) {
      const double* from = mix_[c].data() + (rendered_ - held_);
      int bad = 0;
      for (int n = 0; n < count; ++n) {
        const auto heard_fs = static_cast<float>(gain * from[n]);
        const bool is_number = std::abs(heard_fs) <= std::numeric_limits<float>::max();
        bad += static_cast<int>(!is_number);
        out[c][done + n] = is_number ? heard_fs : 0.0F;
      }
      work_.zeroed += bad;
    }
    held_ -= count;
    done += count;
  }
  position_.store(sample_ - held_, std::memory_order_relaxed);
  publish_counters();
}

}  // namespace carillon::synth
