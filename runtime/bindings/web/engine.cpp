// Method: a synth::Synthesiser with interactive input. Listener and bodies moved by hand get waypoints slightly ahead of the sound, so that
// the next one is known in time; after a pause the resting place is a waypoint first. Recorded scenes are scene::EventSchedulers, pushed
// kPushedS before they are due. One watermark per block.
#include "runtime/bindings/web/engine.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "runtime/base/error.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/scene/session.hpp"
#include "runtime/synth/kernels.hpp"

namespace carillon::web {
namespace {

constexpr double kPushedS = 0.1;     // lead of recorded events over their due time
constexpr double kMarginS = 0.01;    // lead of waypoints and contact records over strikes
constexpr double kSoonS = 0.03;      // lead of interactive waypoints over the sound: two display frames
constexpr double kStepS = 0.002;     // minimum interval of waypoints
constexpr double kFastestMs = 60.0;  // maximum speed of interactive motion; waypoints more than kFarAheadS ahead may be faster
constexpr double kFarAheadS = 0.5;
constexpr double kStillS = 0.06;                          // a contact without an update for this long has no slip
constexpr std::size_t kMostBytes = std::size_t{3} << 30;  // maximum size of a surface

}  // namespace

Engine::Engine(const synth::SynthesiserOptions& options) : rate_hz_(options.rate_hz), synthesiser_(options) {
  ways_[-1].position_m = options.listener_m;
}

void Engine::begin_surface(int surface, const SurfaceSizes& sizes) {
  constexpr std::size_t kMost = kMostBytes / 16;
  if (sizes.triangles > kMost || sizes.columns > kMost || sizes.largest > kMost || sizes.shape > kMostBytes / 2)
    throw InputError("the surface is too large");
  Arriving arriving{.sizes = sizes, .surface = std::make_shared<synth::ModelSurface>()};
  arriving.surface->columns = sizes.columns;
  arriving.surface->triangles.reserve(sizes.triangles);
  arriving.surface->largest.reserve(sizes.largest);
  arriving.surface->shape.reserve(sizes.shape);  // filled on arrival, avoiding one long pass
  surfaces_[surface] = std::move(arriving);
}

void Engine::add_to_surface(int surface, std::span<const std::byte> bytes) {
  const auto found = surfaces_.find(surface);
  if (found == surfaces_.end()) throw InputError("there is no surface " + std::to_string(surface));
  Arriving& to = found->second;
  // Pieces are split arbitrarily, but not within a number or a triangle.
  const auto add = [&](auto& values, std::size_t count) {
    using Value = typename std::remove_reference_t<decltype(values)>::value_type;
    const std::size_t more = std::min(count - values.size(), bytes.size() / sizeof(Value));
    const std::size_t before = values.size();
    values.resize(before + more);
    if (more > 0) std::memcpy(values.data() + before, bytes.data(), more * sizeof(Value));
    bytes = bytes.subspan(more * sizeof(Value));
    return values.size() == count;
  };
  if (add(to.surface->triangles, to.sizes.triangles) && add(to.surface->largest, to.sizes.largest)) add(to.surface->shape, to.sizes.shape);
  if (!bytes.empty()) throw InputError("the surface has more bytes than were announced");
}

void Engine::add_model(int model, int surface, std::span<const std::byte> tables) {
  const auto found = surfaces_.find(surface);
  if (found == surfaces_.end()) throw InputError("there is no surface " + std::to_string(surface));
  const Arriving& of = found->second;
  if (of.surface->triangles.size() != of.sizes.triangles || of.surface->largest.size() != of.sizes.largest ||
      of.surface->shape.size() != of.sizes.shape)
    throw InputError("the surface is not complete yet");
  models_[model] = synth::Model::read_tables(tables, of.surface);
}

const std::shared_ptr<const synth::Model>& Engine::find_model(int model) const {
  const auto found = models_.find(model);
  if (found == models_.end()) throw InputError("there is no model " + std::to_string(model));
  return found->second;
}

Engine::PlayedBody& Engine::find_body(int body) {
  const auto found = bodies_.find(body);
  if (found == bodies_.end()) throw InputError("there is no body " + std::to_string(body));
  return found->second;
}

int Engine::add_body(int model, const synth::BodySettings& settings) {
  const std::shared_ptr<const synth::Model>& played = find_model(model);
  const int body = synthesiser_.add_body(played, settings);
  bodies_[body] = {.model = played, .solo = -1, .effects = settings.effects};
  ways_[body] = {.time_s = -1e300, .position_m = settings.position_m, .rotation = settings.rotation};
  return body;
}

void Engine::swap_model(int body, int model) {
  PlayedBody& played = find_body(body);
  const std::shared_ptr<const synth::Model>& next = find_model(model);
  synthesiser_.swap_model(body, played.solo < 0 ? next : synth::Model::make_solo(*next, played.solo));
  played.model = next;
}

void Engine::set_solo(int body, int bank_mode) {
  PlayedBody& played = find_body(body);
  if (played.solo == std::max(-1, bank_mode)) return;
  synthesiser_.swap_model(body, bank_mode < 0 ? played.model : synth::Model::make_solo(*played.model, bank_mode));
  played.solo = std::max(-1, bank_mode);
}

void Engine::remove_body(int body) {
  find_body(body);
  synthesiser_.remove_body(body);
  bodies_.erase(body);
  ways_.erase(body);
}

/// False for an invalid event; find_fault() has the reason.
bool Engine::push_event(const events::Event& event) {
  const char* fault = events::find_fault(event);
  if (fault == nullptr && synthesiser_.push(event)) return true;
  fault_ = fault != nullptr ? fault : "there are too many events at once";
  if (fault != nullptr) (void)synthesiser_.push(event);  // counted there
  return false;
}

/// A waypoint of an interactively moved body or listener, kSoonS ahead.
template <class Waypoint>
bool Engine::move_soon(Way& way, Waypoint waypoint) {
  const double now_s = synthesiser_.get_horizon_s();
  if (way.time_s < now_s) {  // at rest
    Waypoint rest = waypoint;
    rest.time_s = now_s;
    rest.position_m = way.position_m;
    rest.velocity_m_s = {};
    rest.rotation = way.rotation;
    if (!push_event(rest)) return false;
    way.time_s = now_s;
  }
  const double distance_m = calc_length(waypoint.position_m - way.position_m);
  const double takes_s = way.time_s < now_s + kFarAheadS ? distance_m / kFastestMs : 0.0;
  waypoint.time_s = std::max(now_s + kSoonS + waypoint.time_s, way.time_s + std::max(kStepS, takes_s));
  if (norm(waypoint.velocity_m_s) == 0.0)
    waypoint.velocity_m_s = (1.0 / (waypoint.time_s - way.time_s)) * (waypoint.position_m - way.position_m);
  if (!push_event(waypoint)) return false;
  way = {waypoint.time_s, waypoint.position_m, waypoint.rotation};
  return true;
}

bool Engine::push_soon(events::Event event) {
  if (!std::isfinite(events::get_time_s(event)) || events::find_fault(event) != nullptr) return push_event(event);
  const double now_s = synthesiser_.get_horizon_s();
  const auto find_lead_s = [this](std::int32_t body) {
    const auto found = bodies_.find(body);
    return found != bodies_.end() ? scene::calc_strike_lead_s(*found->second.model, found->second.effects) : 0.0;
  };
  if (auto* impulse = std::get_if<events::Impulse>(&event)) {
    impulse->time_s += now_s + scene::calc_half_length_s(event) + find_lead_s(impulse->body);
  } else if (auto* force = std::get_if<events::Force>(&event)) {
    force->time_s += now_s + find_lead_s(force->body);
  } else if (auto* contact = std::get_if<events::LastingContact>(&event)) {
    return touch_soon(*contact);
  } else if (auto* motion = std::get_if<events::BodyMotion>(&event)) {
    const auto found = ways_.find(motion->body);
    if (found != ways_.end() && motion->body >= 0) return move_soon(found->second, *motion);
  } else if (auto* listener = std::get_if<events::Listener>(&event)) {
    return move_soon(ways_[-1], *listener);
  }
  return push_event(event);
}

/// Values are interpolated, so each record must be known before the sound reaches its predecessor.
bool Engine::touch_soon(const events::LastingContact& contact) {
  const ContactKey key{contact.body, contact.id};
  const double now_s = synthesiser_.get_horizon_s();
  events::LastingContact record = contact;
  const auto last = hand_contacts_.find(key);
  if (last == hand_contacts_.end()) {
    if (contact.state == events::ContactState::kEnd) return true;  // already ended
    record.state = events::ContactState::kBegin;
    record.time_s += now_s;
  } else {
    if (contact.state == events::ContactState::kBegin) record.state = events::ContactState::kHold;
    record.time_s = std::max(now_s + kSoonS + contact.time_s, last->second.record.time_s + kStepS);
  }
  if (!push_event(record)) return false;
  if (record.state == events::ContactState::kEnd)
    hand_contacts_.erase(last);
  else
    hand_contacts_[key] = {record, now_s};
  return true;
}

/// Repeats the last record of each interactive contact; without slip after kStillS without an update.
void Engine::hold_contacts() {
  const double now_s = synthesiser_.get_horizon_s();
  for (auto& [key, contact] : hand_contacts_) {
    if (contact.record.time_s > now_s + 0.5 * kSoonS) continue;
    events::LastingContact record = contact.record;
    record.state = events::ContactState::kHold;
    record.time_s = now_s + kSoonS;
    if (now_s > contact.asked_s + kStillS) {
      record.slip_m_s = {};
      record.sweep_m_s = record.other_sweep_m_s = record.spin_rad_s = 0.0;
    }
    if (synthesiser_.push(record)) contact.record = record;
  }
}

int Engine::push(std::span<const double> words) {
  int refused = 0;
  read_words(words, [&](const events::Event& event, Timing timing) {
    if (timing == Timing::kExact) {
      if (const auto* motion = std::get_if<events::BodyMotion>(&event)) {
        if (const auto way = ways_.find(motion->body); way != ways_.end() && motion->body >= 0)
          way->second = {motion->time_s, motion->position_m, motion->rotation};
      } else if (const auto* listener = std::get_if<events::Listener>(&event)) {
        ways_[-1] = {listener->time_s, listener->position_m, listener->rotation};
      }
    }
    if (!(timing == Timing::kSoon ? push_soon(event) : push_event(event))) ++refused;
  });
  return refused;
}

void Engine::begin_playback(int playback, const PlaybackRequest& request) {
  std::vector<scene::ScheduledBody> bodies;
  for (const int body : request.bodies) {
    if (body < 0) {
      bodies.push_back({});
      continue;
    }
    const PlayedBody& played = find_body(body);
    bodies.push_back({.number = body, .moves = true, .lead_s = scene::calc_strike_lead_s(*played.model, played.effects)});
  }
  if (!std::isfinite(request.at_s) || !std::isfinite(request.from_s)) throw InputError("a recording begins at a finite time");
  end_playback(playback);
  Playback& made = playbacks_[playback];
  made.request = request;
  made.scheduler = std::make_unique<scene::EventScheduler>(bodies, kMarginS);
}

void Engine::add_to_playback(int playback, std::span<const double> words) {
  const auto found = playbacks_.find(playback);
  if (found == playbacks_.end()) return;  // already ended
  Playback& to = found->second;
  const PlaybackRequest& request = to.request;
  const auto place = [&](const events::BodyMotion& motion) {
    if (motion.body < 0 || motion.body >= std::ssize(request.bodies)) return;
    const int body = request.bodies[motion.body];
    const auto way = ways_.find(body);
    if (body < 0 || way == ways_.end() || events::find_fault(motion) != nullptr) return;
    const bool is_there = calc_length(way->second.position_m - motion.position_m) < 1e-9;
    events::BodyMotion there = motion;
    there.body = body;
    there.time_s = 0.0;
    there.velocity_m_s = {};
    if (!is_there) (void)move_soon(way->second, there);
  };
  read_words(words, [&](events::Event event, Timing) {
    const double time_s = events::get_time_s(event);
    if (std::holds_alternative<events::Listener>(event) || std::holds_alternative<events::TimeWatermark>(event)) return;
    auto* motion = std::get_if<events::BodyMotion>(&event);
    if (time_s < request.from_s) {
      if (motion != nullptr) to.before[motion->body] = *motion;
      return;
    }
    // Initial poses of the bodies at the start of the recording.
    if (!to.has_begun)
      for (const auto& [number, before] : to.before) place(before);
    to.has_begun = true;
    if (motion != nullptr && to.before.try_emplace(motion->body, *motion).second) place(*motion);
    std::visit([&](auto& one) { one.time_s = request.at_s + (one.time_s - request.from_s); }, event);
    to.scheduler->add(event);
  });
}

void Engine::end_playback(int playback) {
  const auto found = playbacks_.find(playback);
  if (found == playbacks_.end()) return;
  const double now_s = synthesiser_.get_horizon_s();
  for (auto& [key, contact] : found->second.touching) {
    contact.state = events::ContactState::kEnd;
    contact.time_s = std::max(contact.time_s, now_s) + kStepS;
    (void)synthesiser_.push(contact);
  }
  playbacks_.erase(found);
}

/// Forwards one event of a recording with the engine's body numbers. False: no room.
bool Engine::play(Playback& playback, const events::Event& event) noexcept {
  if (std::holds_alternative<events::TimeWatermark>(event)) return true;
  if (!synthesiser_.push(event)) return events::find_fault(event) != nullptr;
  if (const auto* motion = std::get_if<events::BodyMotion>(&event)) {
    if (const auto way = ways_.find(motion->body); way != ways_.end()) way->second = {motion->time_s, motion->position_m, motion->rotation};
  } else if (const auto* contact = std::get_if<events::LastingContact>(&event)) {
    const ContactKey key{contact->body, contact->id};
    if (contact->state == events::ContactState::kEnd)
      playback.touching.erase(key);
    else
      playback.touching[key] = *contact;
  }
  return true;
}

void Engine::advance_playbacks(double now_s) {
  for (auto& entry : playbacks_) {
    Playback& playback = entry.second;
    playback.scheduler->push_until(now_s + kPushedS, std::numeric_limits<double>::infinity(),
                                   [&](const events::Event& event) { return play(playback, event); });
  }
}

void Engine::process(float* const* out, int channels, int frames) {
  const double now_s = synthesiser_.get_time_s();
  if (!playbacks_.empty()) advance_playbacks(now_s);
  if (!hand_contacts_.empty()) hold_contacts();
  // Interactive events are pushed at the horizon or later, recordings earlier: nothing before the end of this block follows.
  (void)synthesiser_.push(events::TimeWatermark{now_s + (std::max(frames, synth::kBlock) + 1) / rate_hz_});
  synthesiser_.process(out, channels, frames);
  synthesiser_.collect();
}

}  // namespace carillon::web
