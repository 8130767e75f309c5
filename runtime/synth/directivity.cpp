// Method:     p at an ear is Re(conj(T) v), v = (1 + i d / omega_d) z the analytic velocity of a mode: the state z is multiplied by a
//             weight, then rendered by the table of a mode whose sound is the real part of its state. A weight W + u D + u (u - 1) / 2 C
//             over a block gives A + u B + u (u - 1) / 2 E, A the sound by W, B by D and E by C, u from 0 to 1, without steps. From block
//             to block W grows by D and D by C, a parabola by forward differences. Next weights are evaluated at a predicted place; C is
//             twice the second divided difference, by blocks, of the weights at both ends of the last segment and at the end of this one.
// Source:     docs/equations.md E4, E10.
// Deviations: T is that of steady oscillation: the first cycles of a strike and decays within few cycles are not exact.
#include "runtime/synth/directivity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/acoustics/radiation/transfers.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/quaternion.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/synth/receiver.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::synth {
namespace {

constexpr double kSettledShare = 1e-3;     // of kTurn / L: smaller movements need no new weight
constexpr double kPredictionError = 0.15;  // of the predicted distance: larger deviations were not predicted
constexpr double kUnsetM = 1e30;           // place before the first look-up
constexpr double kMaxBendRad = 1.5;        // rad times L: the curvature of longer segments is not extrapolated

/// Rotation applied `times` times.
events::Quaternion repeat(const events::Quaternion& q, int times) noexcept {
  const double sine = std::sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(sine > 0.0)) return {1.0, 0.0, 0.0, 0.0};
  const double half = std::atan2(sine, std::abs(q[0])) * times, scale = std::sin(half) / sine * (q[0] < 0.0 ? -1.0 : 1.0);
  return {std::cos(half), scale * q[1], scale * q[2], scale * q[3]};
}

/// Factor of the curvature at a fraction of a block.
float find_bend_share(float u) noexcept { return 0.5F * u * (u - 1.0F); }

/// Fraction of a block at the first sample of a sub-block.
float find_share(int sub_block) noexcept { return static_cast<float>(sub_block * kSubBlock) / kBlock; }

}  // namespace

Directivity::Directivity(std::shared_ptr<const Model> model, std::size_t ears, int phase)
    : model_(std::move(model)), radiation_(model_->get_directivity()), phase_(phase), ears_(ears) {
  if (radiation_ == nullptr)
    throw InputError("directivity: the bank has no multipoles; make it with \"radiation\" in its job, or leave the effect out");
  const std::size_t modes = model_->get_ringing_mode_count();
  const std::size_t groups = radiation_->sound.size();
  orders_.reserve(modes);
  for (std::size_t m = 0; m < modes; ++m) {
    const int mode = model_->get_bank_mode(static_cast<int>(m)), order = radiation_->transfers->get_order(mode);
    orders_.push_back({order, static_cast<int>(std::ceil(radiation_->transfers->get_turn_order(mode)))});
    highest_ = std::max(highest_, order);
  }
  nearest_m_ = std::max(radiation::kNearestRadii * radiation_->transfers->get_radius_m(), kNearestM);
  for (Ear& ear : ears_) {
    ear.weight.assign(groups, ModeWeight{});
    ear.step.assign(groups, ModeWeight{});
    ear.bend.assign(groups, ModeWeight{});
    ear.modes.resize(modes);
    for (auto& list : ear.due) list.reserve(modes);
  }
  kept_.resize(groups);
  first_.reserve(modes);
  bank_modes_.reserve(modes);
  for (auto& room : transfers_) room.resize(modes);
}

/// Place from the centre of the multipoles, `blocks` blocks after the first sample of this one, by extrapolated movement of body and ear.
Vec3 Directivity::find_place(const Ear& ear, const BlockPoses& poses, int blocks) const noexcept {
  const auto along = [=](const std::array<Vec3, 2>& x) { return x[0] + static_cast<double>(blocks) * (x[1] - x[0]); };
  const auto predict = [&] {
    return multiply(poses.rotation[0], repeat(multiply(find_inverse(poses.rotation[0]), poses.rotation[1]), blocks));
  };
  const events::Quaternion rotation = blocks == 0 ? poses.rotation[0] : blocks == 1 ? poses.rotation[1] : predict();
  Vec3 place = turn(find_inverse(rotation), along(ear.world_m) - along(poses.position_m)) - radiation_->offset_m;
  const double distance = norm(place);
  if (distance >= nearest_m_) return place;
  return distance > 0.0 ? (nearest_m_ / distance) * place : Vec3{0.0, 0.0, nearest_m_};
}

/// Ends the segment of a mode at its present weight.
void Directivity::end_way(Ear& ear, std::size_t m) noexcept {
  Mode& mode = ear.modes[m];
  mode.left = 0;
  set_weight(ear.step, m, {});
  --ear.plans[static_cast<std::uint8_t>(mode.ahead)].modes;
  --ear.ramping;
  if (!mode.bends) return;
  set_weight(ear.bend, m, {});
  mode.bends = false;
  --ear.bending;
}

/// Advances all segments by a block.
void Directivity::finish_block(Ear& ear) noexcept {
  if (ear.ramping == 0) return;
  for (std::size_t m = 0; m < ear.modes.size(); ++m) {
    Mode& mode = ear.modes[m];
    if (mode.left == 0) continue;
    if (--mode.left > 0) {
      set_weight(ear.weight, m, get_weight(ear.weight, m) + get_weight(ear.step, m));
      if (mode.bends) set_weight(ear.step, m, get_weight(ear.step, m) + get_weight(ear.bend, m));
      continue;
    }
    set_weight(ear.weight, m, mode.target);
    mode.ended = block_;
    end_way(ear, m);
  }
}

/// Begins a segment to a weight, 2^ahead blocks long, with the common curvature of the last segment and this one.
void Directivity::set_out(Ear& ear, std::size_t m, Complex target, int ahead) noexcept {
  Mode& mode = ear.modes[m];
  const int blocks = 1 << ahead;
  const float share = 1.0F / static_cast<float>(blocks);
  const Complex way = target - get_weight(ear.weight, m);
  const Complex slope(share * way.real(), share * way.imag());
  Complex step = slope;
  if (ear.steady && mode.ended == block_ && bends_[orders_[m][is_far_]]) {
    const float between = 2.0F / static_cast<float>(blocks + (1 << mode.ahead));  // between the centres of both segments
    const Complex change = slope - mode.slope, bend(between * change.real(), between * change.imag());
    const float half = 0.5F * static_cast<float>(blocks - 1);
    step -= Complex(half * bend.real(), half * bend.imag());
    set_weight(ear.bend, m, bend);
    mode.bends = true;
    ++ear.bending;
  }
  set_weight(ear.step, m, step);
  mode.target = target;
  mode.slope = slope;
  mode.left = static_cast<std::int16_t>(blocks);
  mode.ahead = static_cast<std::int8_t>(ahead);
  ++ear.ramping;
  ++ear.plans[ahead].modes;
}

/// Looks up the weights of modes at the places of one or two ears and begins segments of 2^ahead blocks to them; -1: sets them at once.
void Directivity::look_up(std::span<Ear> ears, std::span<const int> modes, const std::array<Vec3, 2>& places_m, int ahead) noexcept {
  if (modes.empty()) return;
  bank_modes_.clear();
  for (const int m : modes) bank_modes_.push_back(model_->get_bank_mode(m));
  const radiation::Transfers& transfers = *radiation_->transfers;
  const Vec3& centre_m = transfers.get_centre_m();
  const std::array<std::span<Complex>, 2> found{std::span(transfers_[0]).first(modes.size()), std::span(transfers_[1]).first(modes.size())};
  if (ears.size() == 2)
    transfers.evaluate({places_m[0] + centre_m, places_m[1] + centre_m}, bank_modes_, found);
  else
    transfers.evaluate(places_m[0] + centre_m, bank_modes_, found[0]);
  evaluations_ += static_cast<std::int64_t>(modes.size() * ears.size());
  for (std::size_t e = 0; e < ears.size(); ++e) {
    for (std::size_t i = 0; i < modes.size(); ++i) {
      const std::size_t m = modes[i];
      const float re = found[e][i].real(), im = -found[e][i].imag(), tilt = radiation_->tilt[m], level = radiation_->level[m];
      Complex weight(level * (re - tilt * im), level * (im + tilt * re));
      if (!(std::abs(weight.real()) + std::abs(weight.imag()) <= std::numeric_limits<float>::max())) weight = {};
      ears[e].modes[m].place_m = places_m[e];
      if (ahead < 0)
        set_weight(ears[e].weight, m, weight);
      else
        set_out(ears[e], m, weight, ahead);
    }
  }
}

/// Sets all weights with at most `left` look-ups; returns the number of look-ups.
int Directivity::begin_again(Ear& ear, int left) noexcept {
  for (std::size_t m = 0; m < ear.modes.size(); ++m) {
    if (ear.modes[m].left > 0) end_way(ear, m);
    ear.modes[m].ended = -1;
  }
  ear.settled = false;
  first_.clear();
  const int modes = static_cast<int>(ear.modes.size()), count = std::min(modes, left);
  for (int m = 0; m < count; ++m) first_.push_back(m);
  look_up(std::span(&ear, 1), first_, {ear.place_m[0], {}}, -1);
  for (auto m = static_cast<std::size_t>(count); m < ear.modes.size(); ++m) {
    const double rms = radiation_->transfers->get_rms(model_->get_bank_mode(static_cast<int>(m))) * ear.spreading;
    const float re = radiation_->level[m] * static_cast<float>(rms);
    set_weight(ear.weight, m, {re, re * radiation_->tilt[m]});
    ear.modes[m].place_m = {kUnsetM, kUnsetM, kUnsetM};
  }
  return count;
}

/// Ends segments whose movement deviates from the prediction.
void Directivity::drop_plans(Ear& ear) noexcept {
  for (std::size_t c = 1; c < ear.plans.size(); ++c) {
    Plan& plan = ear.plans[c];
    if (plan.modes == 0) continue;
    const double share = static_cast<double>(block_ + 1 - plan.begin) / static_cast<double>(1 << c);
    const Vec3 way = plan.to_m - plan.from_m, astray = ear.place_m[1] - plan.from_m - share * way;
    if (norm(astray) <= kPredictionError * norm(way) + kSettledShare * kTurn * norm(ear.place_m[1]) / std::max(1, highest_)) continue;
    for (std::size_t m = 0; m < ear.modes.size(); ++m) {
      Mode& mode = ear.modes[m];
      if (mode.left == 0 || mode.ahead != static_cast<int>(c)) continue;
      end_way(ear, m);
      mode.place_m = {kUnsetM, kUnsetM, kUnsetM};  // the weight is between two places
    }
  }
}

/// Lists due modes, at most `left`, at least 2^least blocks ahead; returns their number.
int Directivity::find_due(Ear& ear, int left, int least, const std::array<std::uint8_t, bank::kMaxOrder + 1>& by_order) noexcept {
  for (auto& list : ear.due) list.clear();
  const double r = norm(ear.place_m[0]);
  const std::size_t count = ear.modes.size();
  int found = 0;
  bool waits = false;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t m = ear.cursor + i < count ? ear.cursor + i : ear.cursor + i - count;
    const Mode& mode = ear.modes[m];
    if (mode.left > 0) continue;
    // The first segment after a change is straight and half as long.
    const bool is_first = !ear.steady || mode.ended != block_;
    const int wanted = by_order[orders_[m][is_far_]];
    const std::size_t c = std::max(wanted - static_cast<int>(is_first && wanted > least), 0);
    const Vec3 moved = ear.to_m[c] - mode.place_m;
    const double still = kSettledShare * kTurn * r / std::max(1, orders_[m][0]);
    if (dot(moved, moved) <= still * still) continue;
    ++demand_;
    if (found == left) {
      if (!waits) ear.cursor = m;
      waits = true;
      continue;
    }
    ear.due[c].push_back(static_cast<int>(m));
    ++found;
  }
  if (!waits) ear.cursor = 0;
  ear.settled = !waits && found == 0 && ear.ramping == 0;
  return found;
}

/// Looks up due modes of one or two ears, together if possible, at least 2^least blocks ahead.
int Directivity::refresh(std::span<Ear> ears, int left, int least, const BlockPoses& poses) noexcept {
  // Classes begin in blocks of their own rhythm, so that all modes of a class share one prediction.
  const std::int64_t rhythm = block_ + phase_;
  int most = 0, found = 0;
  while (most < kLongest && rhythm % (1 << (most + 1)) == 0) ++most;
  const double radius = radiation_->transfers->get_radius_m();
  std::array<std::uint8_t, bank::kMaxOrder + 1> by_order{};
  bends_.fill(true);
  is_far_ = std::all_of(ears.begin(), ears.end(), [&](const Ear& ear) {
    return std::min(norm(ear.place_m[0]), norm(ear.place_m[1])) >= radiation::kTurnRadii * radius;
  });
  for (Ear& ear : ears) {
    const Vec3 &now = ear.place_m[0], &next = ear.place_m[1];
    const double r = norm(now), turned = norm(cross(now, next)) / (r * norm(next)), nearer = std::abs(std::log(norm(next) / r));
    const double angle = std::asin(std::min(1.0, turned));
    for (int c = 0; c <= most; ++c) ear.to_m[c] = find_place(ear, poses, 1 << c);
    for (int order = 0; order <= highest_; ++order) {
      const double change = std::max(1, order) * angle + (1.0 + order * radius / r) * nearer;
      int c = 0;
      while (c < most && (change * (2 << c) <= kTurn || c < least)) ++c;
      std::uint8_t& both = by_order[order];
      both = &ear == &ears.front() ? static_cast<std::uint8_t>(c) : std::min(both, static_cast<std::uint8_t>(c));
      bends_[order] = bends_[order] && change * (1 << c) <= kMaxBendRad;
    }
  }
  for (std::size_t e = 0; e < ears.size(); ++e)
    found += find_due(ears[e], (left - found) / static_cast<int>(ears.size() - e), least, by_order);
  for (std::size_t c = 0; c < ears[0].due.size(); ++c) {
    for (Ear& ear : ears) {
      if (ear.due[c].empty()) continue;
      ear.plans[c].begin = block_;
      ear.plans[c].from_m = ear.place_m[0];
      ear.plans[c].to_m = ear.to_m[c];
    }
    if (ears.size() == 2 && ears[0].due[c] == ears[1].due[c]) {
      look_up(ears, ears[0].due[c], {ears[0].to_m[c], ears[1].to_m[c]}, static_cast<int>(c));
      continue;
    }
    for (Ear& ear : ears) look_up(std::span(&ear, 1), ear.due[c], {ear.to_m[c], {}}, static_cast<int>(c));
  }
  return found;
}

void Directivity::begin_block(std::int64_t block, const BlockPoses& poses) noexcept {
  const bool follows = block == block_ + 1;
  block_ = block;
  demand_ = 0;
  const int all = std::max(share_, static_cast<int>(ears_.size()));
  int left = all, least = 0;
  // If all together exceed a block, look farther ahead.
  while (static_cast<std::size_t>(all) << least < ears_.size() * orders_.size() && least < kLongest) ++least;
  for (std::size_t first = 0; first < ears_.size(); first += 2) {
    const std::span<Ear> ears = std::span(ears_).subspan(first, std::min<std::size_t>(2, ears_.size() - first));
    // Later ears have their share, too.
    int share = left * static_cast<int>(ears.size()) / static_cast<int>(ears_.size() - first);
    left -= share;
    bool rests = true;
    for (Ear& ear : ears) {
      if (follows) finish_block(ear);
      const Vec3 before = ear.place_m[1], way = before - ear.place_m[0];
      ear.place_m = {find_place(ear, poses, 0), find_place(ear, poses, 1)};
      const Vec3 now = ear.place_m[1] - ear.place_m[0];
      ear.steady = follows && norm(now - way) <= kPredictionError * norm(now);
      ear.spreading = 1.0 / norm(ear.place_m[0]);
      ear.spreading_step = 1.0 / norm(ear.place_m[1]) - ear.spreading;
      if (!follows) share -= begin_again(ear, share / static_cast<int>(&ears.back() - &ear + 1));
      if (follows && ear.settled && ear.place_m[1] == before && ear.place_m[0] == before) continue;
      drop_plans(ear);
      rests = false;
    }
    if (!rests) share -= refresh(ears, share, least, poses);
    left += share;
  }
}

void Directivity::take_over(Directivity& other, std::span<const int> from) noexcept {
  for (Ear& ear : other.ears_) other.finish_block(ear);
  block_ = other.block_;
  evaluations_ = other.evaluations_;
  for (std::size_t e = 0; e < ears_.size() && e < other.ears_.size(); ++e) {
    Ear& ear = ears_[e];
    const Ear& old = other.ears_[e];
    ear.world_m = old.world_m;
    ear.place_m = old.place_m;
    ear.spreading = old.spreading + old.spreading_step;
    ear.spreading_step = 0.0;
    for (std::size_t m = 0; m < ear.modes.size(); ++m) {
      ear.modes[m].place_m = {kUnsetM, kUnsetM, kUnsetM};
      if (m >= from.size() || from[m] < 0 || from[m] >= std::ssize(old.modes)) continue;
      set_weight(ear.weight, m, get_weight(old.weight, static_cast<std::size_t>(from[m])));
    }
  }
}

void Directivity::clear(int samples) noexcept {
  for (Ear& ear : ears_) std::fill_n(ear.sound.begin(), samples, 0.0F);
}

void Directivity::silence(int from) noexcept {
  for (Ear& ear : ears_) std::fill(ear.sound.begin() + from, ear.sound.end(), 0.0F);
}

/// Adds the sound of an ear over sub-blocks, by groups from `group` on, the first of `table` and `starts`.
void Directivity::sound(const Ear& ear, const Kernels& kernels, const SoundTable* table, const ColumnStates* starts, int group, int groups,
                        int first, int sub_blocks, float* out) const noexcept {
  kernels.emit_weighted(table, starts, ear.weight.data() + group, groups, first, sub_blocks, out);
  const float begin = find_share(first);
  const auto add = [&](const std::vector<ModeWeight>& weights, auto&& part) {
    alignas(64) std::array<float, kBlock> change{};
    kernels.emit_weighted(table, starts, weights.data() + group, groups, first, sub_blocks, change.data());
    for (int n = 0; n < sub_blocks * kSubBlock; ++n) out[n] += part(begin + static_cast<float>(n) / kBlock) * change[n];
  };
  if (ear.ramping > 0) add(ear.step, [](float u) { return u; });
  if (ear.bending > 0) add(ear.bend, find_bend_share);
}

void Directivity::emit(const Kernels& kernels, const ColumnStates* starts, int groups, int first, int sub_blocks, int offset) noexcept {
  for (Ear& ear : ears_) sound(ear, kernels, radiation_->sound.data(), starts, 0, groups, first, sub_blocks, ear.sound.data() + offset);
}

void Directivity::weigh(const Kernels& kernels, const SampleStates* kept, int groups, int sub_block, int offset) noexcept {
  for (Ear& ear : ears_) {
    float* out = ear.sound.data() + offset;
    kernels.weigh(ear.weight.data(), kept, groups, out);
    const float begin = find_share(sub_block);
    const auto add = [&](const std::vector<ModeWeight>& weights, auto&& part) {
      alignas(64) std::array<float, kSubBlock> change{};
      kernels.weigh(weights.data(), kept, groups, change.data());
      for (int n = 0; n < kSubBlock; ++n) out[n] += part(begin + static_cast<float>(n) / kBlock) * change[n];
    };
    if (ear.ramping > 0) add(ear.step, [](float u) { return u; });
    if (ear.bending > 0) add(ear.bend, find_bend_share);
  }
}

void Directivity::add_damped(const float* pressure_pa, int sub_block, int offset) noexcept {
  for (Ear& ear : ears_) {
    float* out = ear.sound.data() + offset;
    const auto from = static_cast<float>(ear.spreading), step = static_cast<float>(ear.spreading_step);
    const float begin = find_share(sub_block);
    for (int n = 0; n < kSubBlock; ++n) out[n] += (from + (begin + static_cast<float>(n) / kBlock) * step) * pressure_pa[n];
  }
}

void Directivity::add_fade(int sub_block, int offset) noexcept {
  for (Ear& ear : ears_)
    for (int n = 0; n < kSubBlock; ++n) ear.sound[offset + n] += ear.fade[sub_block * kSubBlock + n];
}

void Directivity::clear_fade() noexcept {
  for (Ear& ear : ears_) ear.fade.fill(0.0F);
}

void Directivity::add_to_fade(const Kernels& kernels, const Directivity& weights, const ColumnStates* starts, int group, int groups,
                              float sign, bool falls) noexcept {
  for (std::size_t e = 0; e < ears_.size() && e < weights.ears_.size(); ++e) {
    const Ear& from = weights.ears_[e];
    alignas(64) std::array<float, kBlock> whole{};
    weights.sound(from, kernels, weights.radiation_->sound.data() + group, starts, group, groups, 0, kSubBlocks, whole.data());
    for (std::size_t n = 0; n < kBlock; ++n) ears_[e].fade[n] += sign * (falls ? 1.0F - static_cast<float>(n) / kBlock : 1.0F) * whole[n];
  }
}

void Directivity::add_damped_to_fade(const Directivity& weights, const float* pressure_pa, float sign) noexcept {
  for (std::size_t e = 0; e < ears_.size() && e < weights.ears_.size(); ++e)
    for (std::size_t n = 0; n < kBlock; ++n) ears_[e].fade[n] += sign * static_cast<float>(weights.ears_[e].spreading) * pressure_pa[n];
}

void Directivity::let_fade_fall() noexcept {
  for (Ear& ear : ears_)
    for (std::size_t n = 0; n < kBlock; ++n) ear.fade[n] *= 1.0F - static_cast<float>(n) / kBlock;
}

}  // namespace carillon::synth
