// What the modes of a body send towards each of several places: a complex weight for each mode and place, kept up while things move.
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

/// Where a body is and how it is turned, at the first sample of a block and at that of the next.
struct BlockPoses {
  std::array<Vec3, 2> position_m{};  // of its centre of mass
  std::array<events::Quaternion, 2> rotation{};
};

/// The directional sound of one body at several places ("ears"), for one Model. The sound that a mode sends to an ear is Re(W z), z its
/// state, W = conj(T) (1 + i d / omega_d), T the radiation::Transfers at the ear's place in the frame of the body. T is looked up at the
/// ear's place when the sound leaves, not when it arrives: the ear's own movement in the time between is left out (at 1 m/s and 3 m
/// that is 9 mm of its way). Modes near and above critical damping have no frequency: they are heard by their gain and 1 / r.
///
/// Weights go by parabolas, without steps. A mode's next one is looked up ahead of time, where body and ear will be by their movement in
/// this block, 1 to 16 blocks ahead, so that the place turns by kTurn / L' and comes nearer or farther by as little, L' being
/// radiation::Transfers::get_turn_order(), and L within kTurnRadii; its curvature is that of the way from the last weight to this one and
/// on to the next. With x = m angle, the angle being that of the way to the next weight, a lobe cos(m phi) then errs by x^3 / 16, and by
/// x^2 / 8, a line, where the movement has just begun or changed: so far a way is half as long. What moves in another way than was
/// predicted is looked up again. Where nothing moves nothing is looked up.
///
/// In a block as many transfers are looked up as set_share() says at most. Where all modes together are more, they are looked up farther
/// ahead, up to 16 blocks; beyond that the most audible ones come first and then all in turn, and those that wait stay as they are. In the
/// first block that sounds all are looked up at once; those for which there is no share begin with their root mean square over directions.
///
/// Invariant: in the block `get_block()` weights are those of that block; they depend on poses, shares and block numbers only, so
/// that the sizes of calls do not change a bit. Memory is taken in the constructor only. One thread at a time; nothing throws but the
/// constructor.
class Directivity {
 public:
  static constexpr int kEvaluations = 1024;  // transfers in a block as long as set_share() was not called
  static constexpr double kTurn = 0.6;       // rad

  /// Ways of 2, 4 .. 16 blocks begin in blocks whose number plus `phase` is a multiple of as many, so that bodies of different phases take
  /// turns. Throws InputError for a model without transfers. [main-thread]
  Directivity(std::shared_ptr<const Model> model, std::size_t ears, int phase = 0);

  /// Ears 0 and 1, 2 and 3 .. are looked up together: those of one head cost least. Where an ear is in the world at the first sample of a
  /// block and at that of the next; before begin_block().
  void set_ear(std::size_t ear, const Vec3& begin_m, const Vec3& end_m) noexcept { ears_[ear].world_m = {begin_m, end_m}; }

  /// Transfers that may be looked up in a block, from the next one on; one an ear at least.
  void set_share(int transfers) noexcept { share_ = transfers; }
  /// Transfers that were due in the last block, whether there was a share for them or not.
  int get_demand() const noexcept { return demand_; }

  /// Puts the weights of a block there. A block that does not follow the last begins again: nothing sounds that could click.
  void begin_block(std::int64_t block, const BlockPoses& poses) noexcept;
  std::int64_t get_block() const noexcept { return block_; }

  /// Weights, places and block of another one, whose mode from[m] is mode m here (-1: none), so that what sounds continues without a step.
  /// At the start of a block of the other, which is of no more use but for add_to_fade().
  void take_over(Directivity& other, std::span<const int> from) noexcept;

  /// All that follows is for Voice. Samples of an ear count from the first that was rendered last.

  /// Forgets the sound before `samples` new ones.
  void clear(int samples) noexcept;
  /// Silences the samples from one on.
  void silence(int from) noexcept;
  /// Adds what rings in sub-blocks `first` to `first` + `sub_blocks` of the block, at sample `offset`.
  void emit(const Kernels& kernels, const ColumnStates* starts, int groups, int first, int sub_blocks, int offset) noexcept;
  /// Adds what acts in a sub-block.
  void weigh(const Kernels& kernels, const SampleStates* kept, int groups, int sub_block, int offset) noexcept;
  /// Adds what modes near and above critical damping sound at 1 m.
  void add_damped(const float* pressure_pa, int sub_block, int offset) noexcept;
  /// Adds what fades out in this block.
  void add_fade(int sub_block, int offset) noexcept;
  void clear_fade() noexcept;
  /// Adds to what fades out what the groups from `group` on, which begin in `starts`, sound over the block by these weights, times a sign;
  /// with a fall from whole to nothing, or without.
  void add_to_fade(const Kernels& kernels, const Directivity& weights, const ColumnStates* starts, int group, int groups, float sign,
                   bool falls) noexcept;
  /// The same of damped modes: their pressure at 1 m over the block.
  void add_damped_to_fade(const Directivity& weights, const float* pressure_pa, float sign) noexcept;
  void let_fade_fall() noexcept;
  /// Room for the states of what acts in a sub-block: all groups of the model.
  std::span<SampleStates> get_kept() noexcept { return kept_; }

  std::size_t get_ear_count() const noexcept { return ears_.size(); }
  /// What an ear was sent in the samples that were rendered last.
  std::span<float> get_sound(std::size_t ear) noexcept { return ears_[ear].sound; }
  /// Transfers looked up so far.
  std::int64_t get_evaluations() const noexcept { return evaluations_; }

 private:
  static constexpr int kLongest = 4;  // classes of modes: next weights are 1, 2, 4 .. 2^kLongest blocks ahead
  using Complex = std::complex<float>;

  struct Mode {
    Complex target;
    Complex slope;            // of the way to it, straight on, a block
    Vec3 place_m{};           // where its last weight was looked up
    std::int64_t ended = -1;  // block that began where the last way ended
    std::int16_t left = 0;    // blocks until the target
    std::int8_t ahead = 0;    // its class
    bool bends = false;       // its way has a curvature
  };
  /// What was predicted for the modes of a class.
  struct Plan {
    std::int64_t begin = 0;  // block
    Vec3 from_m{}, to_m{};
    int modes = 0;  // under way
  };
  struct Ear {
    std::array<Vec3, 2> world_m{};
    std::array<Vec3, 2> place_m{};         // from the centre of the multipoles, axes of the mesh
    std::vector<ModeWeight> weight, step;  // at the first sample of the block, and what is added up to that of the next
    std::vector<ModeWeight> bend;          // what is added to step from a block to the next
    std::vector<Mode> modes;
    std::array<Plan, kLongest + 1> plans{};
    std::array<Vec3, kLongest + 1> to_m{};             // where it will be in as many blocks as a class has
    std::array<std::vector<int>, kLongest + 1> due{};  // modes by class
    int ramping = 0, bending = 0;                      // modes on their way; of them those with a curvature
    bool steady = false;                               // the place moves about as in the block before
    bool settled = false;                              // at place_m[1] nothing is to be done
    double spreading = 0.0, spreading_step = 0.0;      // 1 / r
    std::size_t cursor = 0;                            // mode that is next when there are too many
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
  std::vector<std::array<int, 2>> orders_;       // of the ringing modes: L, and what counts of it far away
  bool is_far_ = false;                          // of the ears that are looked up
  int highest_ = 0, phase_ = 0, share_ = kEvaluations, demand_ = 0;
  double nearest_m_ = 0.0;
  std::int64_t block_ = -2;
  std::vector<Ear> ears_;
  std::vector<SampleStates> kept_;
  std::array<bool, bank::kMaxOrder + 1> bends_{};  // orders of which a way that begins may have a curvature
  std::vector<int> first_;                         // room: modes
  std::vector<std::int32_t> bank_modes_;           // room
  std::array<std::vector<Complex>, 2> transfers_;  // room
  std::int64_t evaluations_ = 0;
};

}  // namespace carillon::synth
