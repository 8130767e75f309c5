// Record of a band search, from which it is resumed.
#pragma once

#include <mpi.h>

#include <array>
#include <cstdint>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/eigen/checkpoint.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/krylov.hpp"
#include "precompute/eigen/lanczos_checkpoint.hpp"
#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// A step of the search that costs a factorisation or an iteration: its arguments, bit for bit, and its result.
struct SearchStep {
  enum Kind : std::int64_t { kCount = 1, kRound = 2 };
  std::int64_t kind = kCount;
  std::array<double, 5> asked{};
  std::array<double, 2> answer{};
  std::int64_t found = 0;  // modes found after it

  bool asks_as(const SearchStep& other) const { return kind == other.kind && asked == other.asked; }
};

/// Records the steps of a search, the modes found and the basis of the current iteration, in order. Resume replays the search: recorded
/// steps return their stored result, later steps are computed. If the search requests a step other than the recorded one, the rest of the
/// record is dropped. All members are collective; without a checkpoint they do nothing.
class SearchCheckpoint {
 public:
  /// Data saved in addition to the steps.
  struct Sources {
    FoundModes* found = nullptr;
    FactorStatistics* factor = nullptr;
    InertiaCounter* counter = nullptr;  // may be null until there is one
  };

  SearchCheckpoint(const comm::Communicator& comm, Checkpoint* checkpoint, Sources sources)
      : comm_(comm), checkpoint_(checkpoint), sources_(sources) {}

  /// Takes the state of the checkpoint if it fits a problem of n rows with these scaling powers. Restores the other statistics as well.
  void load(std::int64_t rows, std::array<std::int64_t, 2> powers);
  void set_counter(InertiaCounter* counter);

  /// Recorded result of this step; null if it must be computed.
  const SearchStep* replay(const SearchStep& step);
  /// Records a computed step; a safe point. Throws Stopped.
  void record(const SearchStep& step);
  /// Reads the recorded modes into found. Call before the first step that finds modes.
  void load_found();
  /// Restores the modes found by a replayed step.
  void restore_found(const SearchStep& step);
  /// Hooks for the iteration of a step to be computed: state to resume from and save(). Null without a checkpoint.
  LanczosCheckpoint* begin_round(const SearchStep& step);
  /// After the iteration. Throws Stopped if it was stopped.
  void end_round();

 private:
  void save_if_requested(bool always);
  bool save(const LanczosState* lanczos, const Columns* basis);
  std::string pack(const LanczosState* lanczos) const;
  void unpack(std::int64_t rows);
  void drop_rest();

  comm::Communicator comm_;
  Checkpoint* checkpoint_;
  Sources sources_;
  std::array<std::int64_t, 2> powers_{};
  std::vector<SearchStep> steps_;
  std::size_t next_ = 0;             // index in steps_; earlier ones have been replayed or recorded
  std::vector<double> kept_lambda_;  // eigenvalues of the modes in the checkpoint
  bool has_loaded_ = false;
  bool has_round_ = false;  // the checkpoint holds the basis of round_
  SearchStep round_;
  LanczosState round_state_;
  std::int64_t uses_mumps_ = 0;
  double backward_error_ = 0;
  LanczosCheckpoint lanczos_;
};

/// Saves the result of a finished solve. Collective.
bool save_modes(const Modes& modes, Checkpoint& checkpoint);
/// Result of a finished solve in a checkpoint; nullopt if it holds another state. Collective.
std::optional<Modes> load_modes(Mat stiffness, Checkpoint& checkpoint);

}  // namespace carillon::eigen
