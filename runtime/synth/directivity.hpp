// Directional radiation of modes: a complex weight per mode and ear, updated while body and ears move.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"

namespace carillon::synth {

/// Position and rotation of a body at the first sample of a block and of the next.
struct BlockPoses {
  std::array<Vec3, 2> position_m{};  // centre of mass
  std::array<events::Quaternion, 2> rotation{};
};

/// Directional sound of one body at several places ("ears"), for one Model. A mode of state z sends Re(W z) to an ear, W = conj(T) (1 + i d
/// / omega_d), T the radiation::Transfers at the ear's place in the frame of the body. T is evaluated at the ear's place at emission, not
/// at arrival: the ear's own movement in between is left out (9 mm at 1 m/s and 3 m). Modes near and above critical damping have no
/// frequency: they use their gain and 1 / r.
///
/// Weights follow parabolas, without steps. A mode's next weight is evaluated in advance, where body and ear will be by their present
/// movement, 1 to 16 blocks ahead, so that the direction rotates by kTurn / L' and the distance changes by as little, L' =
/// radiation::Transfers::get_turn_order(), and L within kTurnRadii; the curvature is that through the last, the present and the next
/// weight. With x = m angle, angle to the next weight, a lobe cos(m phi) then errs by x^3 / 16, and by x^2 / 8, a line, where the movement
/// has just begun or changed: such steps are half as long. Weights of movements that deviate from the prediction are evaluated again.
/// Nothing is evaluated at rest.
///
/// set_share() limits the transfer look-ups per block. If all modes together need more, weights are looked up farther ahead, up to 16
/// blocks; beyond that the most audible modes come first, then all in turn, and waiting ones keep their weights. In the first sounding
/// block all are looked up at once; those without a share begin with their root mean square over directions.
///
/// Invariant: in block get_block() the weights are those of that block; they depend on poses, shares and block numbers only, so the bits do
/// not depend on the block sizes. Allocates in the constructor only. One thread at a time; only the constructor throws.
class Directivity {
 public:
  static constexpr int kEvaluations = 1024;  // transfers per block before set_share()
  static constexpr double kTurn = 0.6;       // rad

  /// Segments of 2, 4 .. 16 blocks begin in blocks whose number plus `phase` is a multiple of as many, so that bodies of different phases
  /// alternate. Throws InputError for a model without transfers. [main-thread]
  Directivity(std::shared_ptr<const Model> model, std::size_t ears, int phase = 0);

  /// Position of an ear in the world at the first sample of a block and of the next; before begin_block(). Ears 0 and 1, 2 and 3 .. are
  /// looked up together: those of one head cost least.
  void set_ear(std::size_t ear, const Vec3& begin_m, const Vec3& end_m) noexcept { ears_[ear].world_m = {begin_m, end_m}; }

  /// Transfer look-ups per block from the next one on; at least one per ear.
  void set_share(int transfers) noexcept { share_ = transfers; }
  /// Transfers due in the last block, with or without a share.
  int get_demand() const noexcept { return demand_; }

  /// Updates the weights to a block. A block that does not follow the last restarts: nothing sounds that could click.
  void begin_block(std::int64_t block, const BlockPoses& poses) noexcept;
  std::int64_t get_block() const noexcept { return block_; }

  /// Takes over weights, places and block of another object, whose mode from[m] is mode m here (-1: none), so that the sound continues
  /// without a step. At the start of a block of the other, which is then used only by add_to_fade().
  void take_over(Directivity& other, std::span<const int> from) noexcept;

  /// The rest is for ResonatorBank. Samples of an ear count from the first one rendered last.

  /// Clears the sound for `samples` new ones.
  void clear(int samples) noexcept;
  /// Zeroes the samples from one on.
  void silence(int from) noexcept;
  /// Adds the ringing modes of sub-blocks `first` to `first` + `sub_blocks` of the block, at sample `offset`.
  void emit(const Kernels& kernels, const ColumnStates* starts, int groups, int first, int sub_blocks, int offset) noexcept;
  /// Adds the responses to forces of a sub-block.
  void weigh(const Kernels& kernels, const SampleStates* kept, int groups, int sub_block, int offset) noexcept;
  /// Adds damped modes: their pressure at 1 m.
  void add_damped(const float* pressure_pa, int sub_block, int offset) noexcept;
  /// Adds the fade-out of this block.
  void add_fade(int sub_block, int offset) noexcept;
  void clear_fade() noexcept;
  /// Adds groups to the fade-out: `groups` groups from `group` on, which begin in `starts`, over the block by these weights, times a sign;
  /// with a linear fall to zero, or without.
  void add_to_fade(const Kernels& kernels, const Directivity& weights, const ColumnStates* starts, int group, int groups, float sign,
                   bool falls) noexcept;
  /// Damped modes: their pressure at 1 m over the block.
  void add_damped_to_fade(const Directivity& weights, const float* pressure_pa, float sign) noexcept;
  void let_fade_fall() noexcept;
  /// Buffer for the responses to forces in a sub-block: all groups of the model.
  std::span<SampleStates> get_kept() noexcept { return kept_; }

  std::size_t get_ear_count() const noexcept { return ears_.size(); }
  /// Samples of an ear rendered last.
  std::span<float> get_sound(std::size_t ear) noexcept { return ears_[ear].sound; }
  /// Transfer look-ups so far.
  std::int64_t get_evaluations() const noexcept { return evaluations_; }

 private:
  static constexpr int kLongest = 4;  // classes of modes: next weights are 1, 2, 4 .. 2^kLongest blocks ahead
  using Complex = std::complex<float>;

  struct Mode {
    Complex target;
    Complex slope;            // of the segment to the target, per block
    Vec3 place_m{};           // place of its last weight
    std::int64_t ended = -1;  // block at the end of the last segment
    std::int16_t left = 0;    // blocks until the target
    std::int8_t ahead = 0;    // class
    bool bends = false;       // segment with curvature
  };
  /// Prediction for the modes of a class.
  struct Plan {
    std::int64_t begin = 0;  // block
    Vec3 from_m{}, to_m{};
    int modes = 0;  // modes on a segment
  };
  struct Ear {
    std::array<Vec3, 2> world_m{};
    std::array<Vec3, 2> place_m{};         // from the centre of the multipoles, mesh axes
    std::vector<ModeWeight> weight, step;  // at the first sample of the block, and increment to the next
    std::vector<ModeWeight> bend;          // increment of step per block
    std::vector<Mode> modes;
    std::array<Plan, kLongest + 1> plans{};
    std::array<Vec3, kLongest + 1> to_m{};             // predicted place after the blocks of each class
    std::array<std::vector<int>, kLongest + 1> due{};  // due modes by class
    int ramping = 0, bending = 0;                      // modes on a segment; of them those with curvature
    bool steady = false;                               // moves about as in the previous block
    bool settled = false;                              // no work at place_m[1]
    double spreading = 0.0, spreading_step = 0.0;      // 1 / r
    std::size_t cursor = 0;                            // next mode when there are too many
    alignas(64) std::array<float, kBlock> sound{}, fade{};
  };

  void finish_block(Ear& ear) noexcept;
  void look_up(std::span<Ear> ears, std::span<const int> modes, const std::array<Vec3, 2>& places_m, int ahead) noexcept;
  void set_out(Ear& ear, std::size_t mode, Complex target, int ahead) noexcept;
  void end_way(Ear& ear, std::size_t mode) noexcept;
  int begin_again(Ear& ear, int left) noexcept;
  void drop_plans(Ear& ear) noexcept;
  int find_due(Ear& ear, int left, int least, const std::array<std::uint8_t, bank::kMaxOrder + 1>& by_order) noexcept;
  int refresh(std::span<Ear> ears, int left, int least, const BlockPoses& poses) noexcept;
  void sound(const Ear& ear, const Kernels& kernels, const SoundTable* table, const ColumnStates* starts, int group, int groups, int first,
             int sub_blocks, float* out) const noexcept;
  Vec3 find_place(const Ear& ear, const BlockPoses& poses, int blocks) const noexcept;
  void set_weight(std::vector<ModeWeight>& weights, std::size_t mode, Complex x) noexcept {
    weights[mode / kGroup].re[mode % kGroup] = x.real();
    weights[mode / kGroup].im[mode % kGroup] = x.imag();
  }
  Complex get_weight(const std::vector<ModeWeight>& weights, std::size_t mode) const noexcept {
    return {weights[mode / kGroup].re[mode % kGroup], weights[mode / kGroup].im[mode % kGroup]};
  }

  std::shared_ptr<const Model> model_;
  const ModelDirectivity* radiation_ = nullptr;  // of the model
  std::vector<std::array<int, 2>> orders_;       // ringing modes: L, and the part of it that counts far away
  bool is_far_ = false;                          // for the ears being looked up
  int highest_ = 0, phase_ = 0, share_ = kEvaluations, demand_ = 0;
  double nearest_m_ = 0.0;
  std::int64_t block_ = -2;
  std::vector<Ear> ears_;
  std::vector<SampleStates> kept_;
  std::array<bool, bank::kMaxOrder + 1> bends_{};  // orders whose new segments may have a curvature
  std::vector<int> first_;                         // buffer: modes
  std::vector<std::int32_t> bank_modes_;           // room
  std::array<std::vector<Complex>, 2> transfers_;  // room
  std::int64_t evaluations_ = 0;
};

}  // namespace carillon::synth
