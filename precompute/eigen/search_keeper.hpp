// What a search for the modes of a band has found out, kept so that it can be resumed.
#pragma once

#include <mpi.h>

#include <array>
#include <cstdint>
#include <vector>

#include "precompute/eigen/block_lanczos.hpp"
#include "precompute/eigen/checkpoint.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/krylov.hpp"
#include "precompute/eigen/solve_modes.hpp"

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

/// Keeps the steps of a search, the modes found and the basis of the iteration that is under way, and gives them back: a search that is
/// resumed goes its way once more from the start, is told what its steps came to, and does by itself what it was not told. Where it
/// asks for something else than it did before, the rest of what was kept is forgotten. Everything is collective but the get_ functions, and
/// without a checkpoint nothing happens.
class SearchKeeper {
 public:
  /// What the steps alone do not say.
  struct Sources {
    FoundModes* found = nullptr;
    FactorStatistics* factor = nullptr;
    InertiaCounter* counter = nullptr;  // may be null until there is one
  };

  SearchKeeper(MPI_Comm comm, Checkpoint* checkpoint, Sources sources) : comm_(comm), checkpoint_(checkpoint), sources_(sources) {}

  /// Takes the state of the checkpoint, if it has one that fits a problem of n rows with these powers of its scaling. The rest of the
  /// statistics are taken over here.
  void start(std::int64_t rows, std::array<std::int64_t, 2> powers);
  void set_counter(InertiaCounter* counter);

  /// What this step came to the last time; null where it is to be done.
  const SearchStep* recall(const SearchStep& step);
  /// A step was done: a safe point. Throws Stopped.
  void record(const SearchStep& step);
  /// Puts the modes kept into found. Call before the first step that finds some.
  void load_found();
  /// The modes that a recalled step found are there again.
  void show_found(const SearchStep& step);
  /// For the iteration of a step that is to be done: where it goes on, and where it is saved. Null without a checkpoint.
  LanczosKeeper* begin_round(const SearchStep& step);
  /// After it. Throws Stopped where the iteration was stopped.
  void end_round();

 private:
  void settle(bool always);
  bool save(const LanczosState* lanczos, const Columns* basis);
  std::string pack(const LanczosState* lanczos) const;
  void unpack(std::int64_t rows);
  void forget_rest();

  MPI_Comm comm_;
  Checkpoint* checkpoint_;
  Sources sources_;
  std::array<std::int64_t, 2> powers_{};
  std::vector<SearchStep> steps_;
  std::size_t next_ = 0;             // of steps_: those before have been recalled or recorded
  std::vector<double> kept_lambda_;  // of the modes in the checkpoint
  bool has_loaded_ = false;
  bool has_round_ = false;  // the checkpoint holds a basis, and the step it belongs to
  SearchStep round_;
  LanczosState round_state_;
  std::int64_t uses_mumps_ = 0;
  double backward_error_ = 0;
  LanczosKeeper lanczos_;
};

/// The result of a solve as a state to go on from, in which nothing is left to be found. Collective.
bool save_modes(const Modes& modes, Checkpoint& checkpoint);
/// The result that a checkpoint holds, with the rows of K; none where it holds something else. Collective.
std::optional<Modes> load_modes(Mat stiffness, Checkpoint& checkpoint);

}  // namespace carillon::eigen
