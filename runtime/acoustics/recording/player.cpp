// Method:     for each triangle and sample p = rho / (4 pi r) [ g + cos (g - (c/a) P) ], delayed by r / c: spread over 32 samples at its
//             arrival (runtime/base/sinc.hpp). Positions between keys: cubic (Catmull and Rom); distances and cosines are linear over 16
//             samples. A moving receiver is at its place of arrival: found for the centre of the surface by iteration, for a triangle by
//             its velocity. Samples compressed in time by an approaching receiver are divided by their density, 1 / (1 - n . v / c), so
//             that the level does not rise.
// Source:     docs/equations.md E14.
#include "runtime/acoustics/recording/player.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/base/sinc.hpp"

namespace carillon::recording {

Player::Player(const RecordedSurface& recording, std::size_t receivers) : recording_(&recording), arriving_(receivers) {
  const Header& header = recording.get_header();
  for (const double radius : recording.get_radii_m()) poles_.push_back(make_pole(radius, header.sample_rate_hz, header.sound_speed_m_s));
  state_.assign(header.triangles, 0.0);
  for (auto& places : places_m_) places.resize(header.vertices);
  for (auto& key : keys_m_) key.resize(header.vertices);
  for (auto& block : blocks_) block.resize(header.triangles * kBlockFrames);
}

void Player::find_places(std::uint64_t frame, std::vector<Vec3>& places_m) {
  const Header& header = recording_->get_header();
  const auto key = static_cast<std::int64_t>(frame / header.key_frames);
  const auto last = static_cast<std::int64_t>(header.count_keys()) - 1;
  if (key != first_key_ + 1) {
    const bool is_next = key == first_key_ + 2;
    if (is_next) std::rotate(std::begin(keys_m_), std::begin(keys_m_) + 1, std::end(keys_m_));
    first_key_ = key - 1;
    for (std::int64_t i = is_next ? 3 : 0; i < 4; ++i)
      recording_->read_places(static_cast<std::uint64_t>(std::clamp<std::int64_t>(first_key_ + i, 0, last)), keys_m_[i]);
  }
  const double u = static_cast<double>(frame % header.key_frames) / static_cast<double>(header.key_frames);
  // At the ends the missing neighbour continues the motion.
  const bool is_first = key == 0, is_last = key + 2 > last;
  const double a = -0.5 * u + u * u - 0.5 * u * u * u, d = -0.5 * u * u + 0.5 * u * u * u;
  double b = 1.0 - 2.5 * u * u + 1.5 * u * u * u, c = 0.5 * u + 2.0 * u * u - 1.5 * u * u * u;
  double at0 = a, at3 = d;
  if (is_first) {
    b += 2.0 * a;
    c -= a;
    at0 = 0.0;
  }
  if (is_last) {
    c += 2.0 * d;
    b -= d;
    at3 = 0.0;
  }
  for (std::size_t v = 0; v < places_m.size(); ++v)
    places_m[v] = at0 * keys_m_[0][v] + b * keys_m_[1][v] + c * keys_m_[2][v] + at3 * keys_m_[3][v];
}

float Player::get_acceleration(std::int64_t frame, std::size_t triangle) {
  if (frame < 0 || static_cast<std::uint64_t>(frame) >= recording_->get_header().frames) return 0.0F;
  const std::int64_t block = frame / kBlockFrames;
  return blocks_[block - first_block_][triangle * kBlockFrames + static_cast<std::size_t>(frame) % kBlockFrames];
}

/// Initial guess: delay of the last segment.
void Player::find_ears(const Way& way, double time_s, const std::vector<Vec3>& places_m, std::vector<Ear>& ears) const {
  constexpr int kRounds = 4;  // each reduces the error by v / c
  Vec3 middle{};
  for (const Vec3& place : places_m) middle = middle + place;
  middle = (1.0 / static_cast<double>(std::max<std::size_t>(1, places_m.size()))) * middle;
  for (std::size_t i = 0; i < ears.size(); ++i) {
    Ear& ear = ears[i];
    for (int round = 0; round < kRounds; ++round) {
      ear.at = way(i, time_s + ear.delay_s);
      ear.delay_s = norm(ear.at.receiver.place_m - middle) / recording_->get_header().sound_speed_m_s;
    }
    ear.at = way(i, time_s + ear.delay_s);
    ear.moves = ear.at.velocity_m_s != Vec3{};
  }
}

void Player::look(const Ear& ear, std::size_t triangle, const std::vector<Vec3>& places_m, Spot& spot) const {
  const Header& header = recording_->get_header();
  const Triangle& corners = recording_->get_triangles()[triangle];
  const Vec3& a = places_m[corners[0]];
  const Vec3& b = places_m[corners[1]];
  const Vec3& c = places_m[corners[2]];
  const Vec3 centre = (1.0 / 3.0) * (a + b + c), twice = cross(b - a, c - a);
  const Microphone& receiver = ear.at.receiver;
  Vec3 way = receiver.place_m - centre;
  double r = std::max(norm(way), 0.01), delay_s = r / header.sound_speed_m_s, density = 1.0;
  if (ear.moves) {
    // c (delay + more) = r + more n . v
    const double away = std::min(0.9, dot(way, ear.at.velocity_m_s) / (r * header.sound_speed_m_s));
    const double more_s = (delay_s - ear.delay_s) / (1.0 - away);
    way = way + more_s * ear.at.velocity_m_s;
    r = std::max(norm(way), 0.01);
    delay_s = ear.delay_s + more_s;
    density = 1.0 - away;
  }
  const double area = norm(twice);
  const double cosine = area > 0.0 ? dot(way, twice) / (r * area) : 0.0;
  const double heard = 1.0 - receiver.directivity - receiver.directivity * dot(receiver.axis, way) / r;
  spot.delay = delay_s * header.sample_rate_hz;
  spot.gain = heard / (4.0 * std::numbers::pi * r * density);
  spot.turned = spot.gain * cosine;
}

void Player::emit_segment(const Way& way) {
  const Header& header = recording_->get_header();
  const auto frame = static_cast<std::int64_t>(emitted_);
  // Samples 15 before to 32 after.
  const std::int64_t block = frame / kBlockFrames - 1;
  if (block != first_block_) {
    const bool is_next = block == first_block_ + 1;
    if (is_next) std::rotate(std::begin(blocks_), std::begin(blocks_) + 1, std::end(blocks_));
    first_block_ = block;
    for (std::int64_t i = is_next ? 2 : 0; i < 3; ++i)
      if (block + i >= 0 && block + i < static_cast<std::int64_t>(header.count_blocks()))
        recording_->read_accelerations(static_cast<std::uint64_t>(block + i), blocks_[i]);
  }
  const std::size_t receivers = arriving_.size();
  const double begin_s = static_cast<double>(emitted_) / header.sample_rate_hz;
  if (emitted_ == 0) {
    find_places(0, places_m_[1]);
    ears_[1].resize(receivers);
    find_ears(way, 0.0, places_m_[1], ears_[1]);
  }
  std::swap(places_m_[0], places_m_[1]);
  find_places(std::min(emitted_ + kSegment, header.frames - 1), places_m_[1]);
  ears_[0] = ears_[1];
  find_ears(way, begin_s + kSegment / header.sample_rate_hz, places_m_[1], ears_[1]);

  const base::Sinc& sinc = base::Sinc::get();
  std::vector<Spot> begin(receivers), end(receivers);
  std::array<float, base::kSincTaps> taps{};
  std::array<double, kSegment + kPoleTaps> g{};
  for (std::size_t t = 0; t < state_.size(); ++t) {
    const Pole& pole = poles_[recording_->get_triangle_bodies()[t]];
    const double area = recording_->get_areas_m2()[t];
    for (std::size_t i = 0; i < g.size(); ++i)
      g[i] = area * get_acceleration(frame - base::kSincHalf + 1 + static_cast<std::int64_t>(i), t);
    for (std::size_t i = 0; i < receivers; ++i) {
      look(ears_[0][i], t, places_m_[0], begin[i]);
      look(ears_[1][i], t, places_m_[1], end[i]);
    }
    for (std::size_t k = 0; k < kSegment; ++k) {
      const double now = g[k + base::kSincHalf - 1];
      const double source = header.air_density_kg_m3 * now;
      const double turned = header.air_density_kg_m3 * (now - pole.rate_per_s * state_[t]);
      double next = pole.keep * state_[t];
      for (std::size_t j = 0; j < kPoleTaps; ++j) next += pole.weight[j] * g[k + j];
      state_[t] = next;
      if (emitted_ + k >= header.frames) continue;
      const double along = static_cast<double>(k) / kSegment;
      for (std::size_t i = 0; i < receivers; ++i) {
        const auto mix = [&](double Spot::*part) { return begin[i].*part + along * (end[i].*part - begin[i].*part); };
        const double pressure = mix(&Spot::gain) * source + mix(&Spot::turned) * turned;
        const double arrival = static_cast<double>(emitted_ + k - time_) + mix(&Spot::delay);
        const double whole = std::floor(arrival);
        if (whole > 4e6) continue;  // beyond 28 km: bounds the memory for untrusted files
        sinc.make_delay(arrival - whole, taps);
        const auto first = static_cast<std::int64_t>(whole) - base::kSincHalf + 1;
        auto& heard = arriving_[i];
        if (first + base::kSincTaps > static_cast<std::int64_t>(heard.size())) heard.resize(first + base::kSincTaps, 0.0);
        for (std::int64_t j = std::max<std::int64_t>(0, -first); j < base::kSincTaps; ++j) heard[first + j] += pressure * taps[j];
      }
    }
  }
  emitted_ += kSegment;
}

void Player::release() {
  for (auto& places : places_m_) places = {};
  for (auto& key : keys_m_) key = {};
  for (auto& block : blocks_) block = {};
  state_ = {};
  poles_ = {};
}

bool Player::is_over() const {
  const auto is_silent = [](const std::vector<double>& heard) { return heard.empty(); };
  return emitted_ >= recording_->get_header().frames && std::all_of(arriving_.begin(), arriving_.end(), is_silent);
}

void Player::play(const Way& way, std::size_t count, std::span<double> out) {
  const std::uint64_t end = time_ + count + base::kSincHalf, frames = recording_->get_header().frames;
  if (emitted_ < frames) {
    while (emitted_ < end && emitted_ < frames) emit_segment(way);
    if (emitted_ >= frames) release();
  }
  for (std::size_t i = 0; i < arriving_.size(); ++i) {
    auto& heard = arriving_[i];
    const std::size_t there = std::min(count, heard.size());
    for (std::size_t n = 0; n < there; ++n) out[i * count + n] += heard[n];
    heard.erase(heard.begin(), heard.begin() + static_cast<std::ptrdiff_t>(there));
  }
  time_ += count;
}

void Player::play(std::span<const Microphone> receivers, std::size_t count, std::span<double> out) {
  play([&](std::size_t i, double) { return MovingMicrophone{receivers[i], {}}; }, count, out);
}

}  // namespace carillon::recording
