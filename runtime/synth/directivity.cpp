// Method:     p at an ear is Re(conj(T) v), v = (1 + i d / omega_d) z the analytic velocity of a mode: the state z is multiplied by a
//             weight, then sounded by the table of a mode whose sound is the real part of its state. A weight that goes linearly from W
//             to W + D over a block gives A + u B, A the sound by W and B that by D, u from 0 to 1: what is heard has no steps. Next
//             weights are looked up at a place that is predicted; the line between two of them errs by (L angle)^2 / 8 at most.
// Source:     docs/equations.md E4, E10.
// Deviations: T is that of a mode that rings for ever at its frequency: a strike's first cycles and a decay within few cycles are not.
#include "runtime/synth/directivity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/base/error.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/radiation/transfers.hpp"
#include "runtime/synth/receiver.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::synth {
namespace {

constexpr double kStill = 1e-3;      // of kTurn / L: what moves less since a weight was looked up needs no other
constexpr double kPredicted = 0.15;  // of the way of a plan: what goes further astray was not predicted
constexpr double kNowhere = 1e30;    // a place that was never looked up

events::Quaternion turn_back(const events::Quaternion& q) noexcept { return {q[0], -q[1], -q[2], -q[3]}; }

events::Quaternion multiply(const events::Quaternion& a, const events::Quaternion& b) noexcept {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// A turn done `times` times.
events::Quaternion repeat(const events::Quaternion& q, int times) noexcept {
  const double sine = std::sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(sine > 0.0)) return {1.0, 0.0, 0.0, 0.0};
  const double half = std::atan2(sine, std::abs(q[0])) * times, scale = std::sin(half) / sine * (q[0] < 0.0 ? -1.0 : 1.0);
  return {std::cos(half), scale * q[1], scale * q[2], scale * q[3]};
}

/// Share of a block at the first sample of a sub-block.
float find_share(int sub_block) noexcept { return static_cast<float>(sub_block * kSubBlock) / kBlock; }

}  // namespace

Directivity::Directivity(std::shared_ptr<const Model> model, std::size_t ears)
    : model_(std::move(model)), radiation_(model_->get_directivity()), ears_(ears) {
  if (radiation_ == nullptr)
    throw InputError("directivity needs a bank with multipoles; make it with \"radiation\" in its job, or leave the effect out");
  const auto modes = static_cast<std::size_t>(model_->get_ringing_mode_count());
  const std::size_t groups = radiation_->sound.size();
  orders_.reserve(modes);
  for (std::size_t m = 0; m < modes; ++m) {
    orders_.push_back(radiation_->transfers->get_order(model_->get_bank_mode(static_cast<int>(m))));
    highest_ = std::max(highest_, orders_.back());
  }
  nearest_m_ = std::max(radiation::kNearestRadii * radiation_->transfers->get_radius_m(), kNearestM);
  for (Ear& ear : ears_) {
    ear.weight.assign(groups, ModeWeight{});
    ear.step.assign(groups, ModeWeight{});
    ear.modes.resize(modes);
  }
  kept_.resize(groups);
  for (auto& list : due_) list.reserve(modes);
  bank_modes_.reserve(modes);
  transfers_.resize(modes);
}

/// From the centre of the multipoles, `blocks` blocks after the first sample of this one: as body and ear move in it, on and on.
Vec3 Directivity::find_place(const Ear& ear, const BlockPoses& poses, int blocks) const noexcept {
  const auto along = [=](const std::array<Vec3, 2>& x) { return x[0] + static_cast<double>(blocks) * (x[1] - x[0]); };
  const auto predict = [&] {
    return multiply(poses.rotation[0], repeat(multiply(turn_back(poses.rotation[0]), poses.rotation[1]), blocks));
  };
  const events::Quaternion rotation = blocks == 0 ? poses.rotation[0] : blocks == 1 ? poses.rotation[1] : predict();
  Vec3 place = turn(turn_back(rotation), along(ear.world_m) - along(poses.position_m)) - radiation_->offset_m;
  const double distance = norm(place);
  if (distance >= nearest_m_) return place;
  return distance > 0.0 ? (nearest_m_ / distance) * place : Vec3{0.0, 0.0, nearest_m_};
}

/// What was under way in the block before is a block further.
void Directivity::finish_block(Ear& ear) noexcept {
  if (ear.ramping == 0) return;
  for (std::size_t m = 0; m < ear.modes.size(); ++m) {
    Mode& mode = ear.modes[m];
    if (mode.left == 0) continue;
    if (--mode.left > 0) {
      set_weight(ear.weight, m, get_weight(ear.weight, m) + get_weight(ear.step, m));
      continue;
    }
    set_weight(ear.weight, m, mode.target);
    set_weight(ear.step, m, {});
    --ear.plans[static_cast<std::size_t>(mode.ahead)].modes;
    --ear.ramping;
  }
}

/// Looks up the weights of modes at a place and sends them on their way there, 2^ahead blocks; -1: puts them there.
void Directivity::look_up(Ear& ear, std::span<const int> modes, const Vec3& place_m, int ahead) noexcept {
  if (modes.empty()) return;
  bank_modes_.clear();
  for (const int m : modes) bank_modes_.push_back(model_->get_bank_mode(m));
  const std::span<Complex> transfers = std::span(transfers_).first(modes.size());
  radiation_->transfers->evaluate(place_m + radiation_->transfers->get_centre_m(), bank_modes_, transfers);
  evaluations_ += static_cast<std::int64_t>(modes.size());
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const auto m = static_cast<std::size_t>(modes[i]);
    const float re = transfers[i].real(), im = -transfers[i].imag(), tilt = radiation_->tilt[m], level = radiation_->level[m];
    Complex weight(level * (re - tilt * im), level * (im + tilt * re));
    if (!(std::abs(weight.real()) + std::abs(weight.imag()) <= std::numeric_limits<float>::max())) weight = {};
    Mode& mode = ear.modes[m];
    mode.place_m = place_m;
    if (ahead < 0) {
      set_weight(ear.weight, m, weight);
      continue;
    }
    mode.target = weight;
    mode.left = static_cast<std::int16_t>(1 << ahead);
    mode.ahead = static_cast<std::int16_t>(ahead);
    const Complex way = weight - get_weight(ear.weight, m);
    const float share = 1.0F / static_cast<float>(1 << ahead);
    set_weight(ear.step, m, {share * way.real(), share * way.imag()});
    ++ear.ramping;
    ++ear.plans[static_cast<std::size_t>(ahead)].modes;
  }
}

void Directivity::begin_again(Ear& ear) noexcept {
  for (auto& step : ear.step) step = ModeWeight{};
  for (Mode& mode : ear.modes) mode.left = 0;
  for (Plan& plan : ear.plans) plan.modes = 0;
  ear.ramping = 0;
  ear.settled = false;
  std::vector<int>& all = due_[0];
  all.clear();
  for (int m = 0; m < static_cast<int>(ear.modes.size()); ++m) all.push_back(m);
  look_up(ear, all, ear.place_m[0], -1);
}

/// Ends what is under way in another direction than was predicted.
void Directivity::drop_plans(Ear& ear) noexcept {
  for (std::size_t c = 1; c < ear.plans.size(); ++c) {
    Plan& plan = ear.plans[c];
    if (plan.modes == 0) continue;
    const double share = static_cast<double>(block_ + 1 - plan.begin) / static_cast<double>(1 << c);
    const Vec3 way = plan.to_m - plan.from_m, astray = ear.place_m[1] - plan.from_m - share * way;
    if (norm(astray) <= kPredicted * norm(way) + kStill * kTurn * norm(ear.place_m[1]) / std::max(1, highest_)) continue;
    for (std::size_t m = 0; m < ear.modes.size(); ++m) {
      Mode& mode = ear.modes[m];
      if (mode.left == 0 || mode.ahead != static_cast<int>(c)) continue;
      mode.left = 0;
      mode.place_m = {kNowhere, kNowhere, kNowhere};  // the weight is on its way between two
      set_weight(ear.step, m, {});
      --ear.ramping;
    }
    plan.modes = 0;
  }
}

/// Looks up what has to be, at most `left`, at least 2^least blocks ahead; how many it has.
int Directivity::refresh(Ear& ear, int left, int least, const BlockPoses& poses) noexcept {
  const Vec3 &now = ear.place_m[0], &next = ear.place_m[1];
  const double r = norm(now), turned = norm(cross(now, next)) / (r * norm(next)), nearer = std::abs(std::log(norm(next) / r));
  const double angle = std::asin(std::min(1.0, turned)), radius = radiation_->transfers->get_radius_m();
  // A class begins in blocks of its own rhythm, so that all its modes are predicted together.
  int most = 0;
  while (most < kLongest && block_ % (1 << (most + 1)) == 0) ++most;
  std::array<Vec3, kLongest + 1> to;
  for (int c = 0; c <= most; ++c) to[static_cast<std::size_t>(c)] = find_place(ear, poses, 1 << c);
  std::array<std::uint8_t, bank::kMaxOrder + 1> by_order;
  for (int order = 0; order <= highest_; ++order) {
    const double change = std::max(1, order) * angle + (1.0 + order * radius / r) * nearer;
    int c = 0;
    while (c < most && (change * (2 << c) <= kTurn || c < least)) ++c;
    by_order[static_cast<std::size_t>(order)] = static_cast<std::uint8_t>(c);
  }
  for (auto& list : due_) list.clear();
  const std::size_t count = ear.modes.size();
  int found = 0;
  bool waits = false;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t m = ear.cursor + i < count ? ear.cursor + i : ear.cursor + i - count;
    const Mode& mode = ear.modes[m];
    if (mode.left > 0) continue;
    const std::size_t c = by_order[static_cast<std::size_t>(orders_[m])];
    const Vec3 moved = to[c] - mode.place_m;
    const double still = kStill * kTurn * r / std::max(1, orders_[m]);
    if (dot(moved, moved) <= still * still) continue;
    if (found == left) {
      ear.cursor = m;
      waits = true;
      break;
    }
    due_[c].push_back(static_cast<int>(m));
    ++found;
  }
  if (!waits) ear.cursor = 0;
  for (std::size_t c = 0; c < due_.size(); ++c) {
    if (due_[c].empty()) continue;
    ear.plans[c].begin = block_;
    ear.plans[c].from_m = now;
    ear.plans[c].to_m = to[c];
    look_up(ear, due_[c], to[c], static_cast<int>(c));
  }
  ear.settled = !waits && found == 0 && ear.ramping == 0;
  return found;
}

void Directivity::begin_block(std::int64_t block, const BlockPoses& poses) noexcept {
  const bool follows = block == block_ + 1;
  block_ = block;
  int left = kEvaluations, least = 0;
  // Where all together are too many for a block, weights are looked up further ahead.
  while (static_cast<std::size_t>(kEvaluations << least) < ears_.size() * orders_.size() && least < kLongest) ++least;
  for (std::size_t e = 0; e < ears_.size(); ++e) {
    Ear& ear = ears_[e];
    if (follows) finish_block(ear);
    const Vec3 before = ear.place_m[1];
    ear.place_m = {find_place(ear, poses, 0), find_place(ear, poses, 1)};
    ear.spreading = 1.0 / norm(ear.place_m[0]);
    ear.spreading_step = 1.0 / norm(ear.place_m[1]) - ear.spreading;
    if (!follows) begin_again(ear);
    if (follows && ear.settled && ear.place_m[1] == before && ear.place_m[0] == before) continue;
    drop_plans(ear);
    // The ears that come later have their share, too.
    const int share = left / static_cast<int>(ears_.size() - e);
    left -= refresh(ear, share, least, poses);
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
      ear.modes[m].place_m = {kNowhere, kNowhere, kNowhere};
      if (m >= from.size() || from[m] < 0 || static_cast<std::size_t>(from[m]) >= old.modes.size()) continue;
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

void Directivity::emit(const Kernels& kernels, const ColumnStates* starts, int groups, int first, int sub_blocks, int offset) noexcept {
  for (Ear& ear : ears_) {
    float* out = ear.sound.data() + offset;
    kernels.emit_weighted(radiation_->sound.data(), starts, ear.weight.data(), groups, first, sub_blocks, out);
    if (ear.ramping == 0) continue;
    alignas(64) std::array<float, kBlock> change{};
    kernels.emit_weighted(radiation_->sound.data(), starts, ear.step.data(), groups, first, sub_blocks, change.data());
    const float begin = find_share(first);
    for (int n = 0; n < sub_blocks * kSubBlock; ++n)
      out[n] += (begin + static_cast<float>(n) / kBlock) * change[static_cast<std::size_t>(n)];
  }
}

void Directivity::weigh(const Kernels& kernels, const SampleStates* kept, int groups, int sub_block, int offset) noexcept {
  for (Ear& ear : ears_) {
    float* out = ear.sound.data() + offset;
    kernels.weigh(ear.weight.data(), kept, groups, out);
    if (ear.ramping == 0) continue;
    alignas(64) std::array<float, kSubBlock> change{};
    kernels.weigh(ear.step.data(), kept, groups, change.data());
    const float begin = find_share(sub_block);
    for (int n = 0; n < kSubBlock; ++n) out[n] += (begin + static_cast<float>(n) / kBlock) * change[static_cast<std::size_t>(n)];
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
    for (int n = 0; n < kSubBlock; ++n)
      ear.sound[static_cast<std::size_t>(offset + n)] += ear.fade[static_cast<std::size_t>(sub_block * kSubBlock + n)];
}

void Directivity::clear_fade() noexcept {
  for (Ear& ear : ears_) ear.fade.fill(0.0F);
}

void Directivity::add_to_fade(const Kernels& kernels, const Directivity& weights, const ColumnStates* starts, int group, int groups,
                              float sign, bool falls) noexcept {
  for (std::size_t e = 0; e < ears_.size() && e < weights.ears_.size(); ++e) {
    const Ear& from = weights.ears_[e];
    alignas(64) std::array<float, kBlock> sound{}, change{};
    const SoundTable* table = weights.radiation_->sound.data() + group;
    kernels.emit_weighted(table, starts, from.weight.data() + group, groups, 0, kSubBlocks, sound.data());
    if (from.ramping > 0) kernels.emit_weighted(table, starts, from.step.data() + group, groups, 0, kSubBlocks, change.data());
    for (std::size_t n = 0; n < kBlock; ++n) {
      const float u = static_cast<float>(n) / kBlock;
      ears_[e].fade[n] += sign * (falls ? 1.0F - u : 1.0F) * (sound[n] + u * change[n]);
    }
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

std::size_t Directivity::calc_bytes() const noexcept {
  std::size_t bytes = sizeof(Directivity) + ears_.capacity() * sizeof(Ear) + kept_.capacity() * sizeof(SampleStates) +
                      orders_.capacity() * sizeof(int) + transfers_.capacity() * sizeof(Complex) +
                      bank_modes_.capacity() * sizeof(std::int32_t);
  for (const auto& list : due_) bytes += list.capacity() * sizeof(int);
  for (const Ear& ear : ears_)
    bytes += (ear.weight.capacity() + ear.step.capacity()) * sizeof(ModeWeight) + ear.modes.capacity() * sizeof(Mode);
  return bytes;
}

}  // namespace carillon::synth
