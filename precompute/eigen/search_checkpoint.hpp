// The record of a search for the modes of a band, from which it is resumed.
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

/// A step of the search that costs a factorisation or an iteration: what was asked, to the last bit, and what came of it.
struct SearchStep {
  enum Kind : std::int64_t { kCount = 1, kRound = 2 };
  std::int64_t kind = kCount;
  std::array<double, 5> asked{};
  std::array<double, 2> answer{};
  std::int64_t found = 0;  // modes found after it

  bool asks_as(const SearchStep& other) const { return kind == other.kind && asked == other.asked; }
};

/// Keeps the steps of a search, the modes found and the basis of the iteration under way, in the order in which they came. Resume replays
/// the search: recorded steps return their stored result, later steps are computed. Where the search asks for another step than the one
/// recorded, the rest of the record is dropped. Everything is collective, and without a checkpoint nothing happens.
class SearchCheckpoint {
 public:
  /// What is saved in addition to the steps.
  struct Sources {
    FoundModes* found = nullptr;
    FactorStatistics* factor = nullptr;
    InertiaCounter* counter = nullptr;  // may be null until there is one
  };

  SearchCheckpoint(const comm::Communicator& comm, Checkpoint* checkpoint, Sources sources)
      : comm_(comm), checkpoint_(checkpoint), sources_(sources) {}

  /// Takes the state of the checkpoint, if it has one that fits a problem of n rows with these powers of its scaling. The rest of the
  /// statistics are taken over here.
  void load(std::int64_t rows, std::array<std::int64_t, 2> powers);
  void set_counter(InertiaCounter* counter);

  /// The recorded result of this step; null where it is to be computed.
  const SearchStep* replay(const SearchStep& step);
  /// A step was computed: a safe point. Throws Stopped.
  void record(const SearchStep& step);
  /// Puts the recorded modes into found. Call before the first step that finds some.
  void load_found();
  /// The modes that a replayed step found are in found again.
  void restore_found(const SearchStep& step);
  /// For the iteration of a step that is to be computed: what it resumes from, and what saves it. Null without a checkpoint.
  LanczosCheckpoint* begin_round(const SearchStep& step);
  /// After it. Throws Stopped where the iteration was stopped.
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
  std::size_t next_ = 0;             // of steps_: those before have been replayed or recorded
  std::vector<double> kept_lambda_;  // of the modes in the checkpoint
  bool has_loaded_ = false;
  bool has_round_ = false;  // the checkpoint holds a basis, and the step it belongs to
  SearchStep round_;
  LanczosState round_state_;
  std::int64_t uses_mumps_ = 0;
  double backward_error_ = 0;
  LanczosCheckpoint lanczos_;
};

/// The result of a solve as a state in which nothing is left to be computed. Collective.
bool save_modes(const Modes& modes, Checkpoint& checkpoint);
/// The result that a checkpoint holds, with the rows of K; none where it holds something else. Collective.
std::optional<Modes> load_modes(Mat stiffness, Checkpoint& checkpoint);

}  // namespace carillon::eigen
