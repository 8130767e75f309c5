// Method: The search is a deterministic function of the results of its factorisations and iterations. Only these and the modes are
// recorded, in order: a replay with the recorded results costs almost nothing and ends at the last recorded step. An interrupted iteration
// is resumed from its basis and projected matrix.
// Source: Elnozahy, Alvisi, Wang, Johnson, A survey of rollback-recovery protocols, ACM Computing Surveys 34(3), 2002, section 3.1 (replay
// of deterministic processes).
#include "precompute/eigen/search_checkpoint.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using la::LocalColumns;
using petsc::check;

constexpr std::int64_t kSearch = 1, kModes = 2;   // kind of a state
constexpr std::int64_t kMaxSteps = 100'000;       // Limits for numbers read from a file.
constexpr std::int64_t kMax = 1'000'000'000'000;  // counts and operations

void write(NumberWriter& to, const LanczosState& state) {
  for (const std::int64_t value : state.sizes) to.add(value);
  to.add(state.t);
}

LanczosState read_lanczos(NumberReader& from, std::int64_t rows) {
  LanczosState state;
  for (std::int64_t& value : state.sizes) value = from.get_count(0, kMax);
  const std::int64_t size = state.size();
  if (size > rows || size > 46'000) throw InputError("its basis is too large");
  state.t = from.get_doubles(size * size);
  if (static_cast<std::int64_t>(state.t.size()) != size * size) throw InputError("its projected matrix has another size");
  return state;
}

}  // namespace

void SearchCheckpoint::load(std::int64_t rows, std::array<std::int64_t, 2> powers) {
  if (checkpoint_ == nullptr) return;
  powers_ = powers;
  if (checkpoint_->numbers.empty()) return;
  try {
    unpack(rows);
  } catch (const InputError& error) {  // The numbers are the same on all ranks, so all ranks throw.
    steps_.clear();
    kept_lambda_.clear();
    has_round_ = false;
    uses_mumps_ = 0;
    backward_error_ = 0;
    checkpoint_->reject(error.what());
  }
}

void SearchCheckpoint::unpack(std::int64_t rows) {
  NumberReader from(checkpoint_->numbers);
  (void)from.get_count(kSearch, kSearch);
  for (const std::int64_t power : powers_) {
    if (from.get_count(-4096, 4096) != power) throw InputError("it is of a problem in other units");
  }
  steps_.resize(from.get_count(0, kMaxSteps));
  for (SearchStep& step : steps_) {
    step.kind = from.get_count(SearchStep::kCount, SearchStep::kRound);
    for (double& value : step.asked) value = from.get_double();
    for (double& value : step.answer) value = from.get_double();
    step.found = from.get_count(0, rows);
  }
  kept_lambda_ = from.get_doubles(rows);
  const auto kept = static_cast<std::int64_t>(kept_lambda_.size());
  for (const SearchStep& step : steps_) {
    if (step.found > kept) throw InputError("a step in it found more modes than it holds");
  }
  has_round_ = from.get_count(0, 1) == 1;
  if (has_round_) {
    round_.kind = SearchStep::kRound;
    for (double& value : round_.asked) value = from.get_double();
    round_state_ = read_lanczos(from, rows);
  }
  if (checkpoint_->column_count != kept + (has_round_ ? round_state_.size() : 0)) throw InputError("it has the wrong number of columns");
  uses_mumps_ = from.get_count(0, 1);
  backward_error_ = from.get_double();
  FactorStatistics factor;
  factor.solver = from.get_text();
  factor.ordering = from.get_text();
  factor.entries = from.get_count(0, kMax);
  factor.flops = from.get_double();
  from.end();
  *sources_.factor = factor;
}

std::string SearchCheckpoint::pack(const LanczosState* lanczos) const {
  NumberWriter to;
  to.add(kSearch);
  for (const std::int64_t power : powers_) to.add(power);
  to.add(static_cast<std::int64_t>(steps_.size()));
  for (const SearchStep& step : steps_) {
    to.add(step.kind);
    for (const double value : step.asked) to.add(value);
    for (const double value : step.answer) to.add(value);
    to.add(step.found);
  }
  to.add(sources_.found->lambda);
  to.add(std::int64_t{lanczos != nullptr});
  if (lanczos != nullptr) {
    for (const double value : round_.asked) to.add(value);
    write(to, *lanczos);
  }
  to.add(std::int64_t{sources_.counter->uses_mumps()});
  to.add(sources_.counter->get_worst_backward_error());
  to.add(sources_.factor->solver);
  to.add(sources_.factor->ordering);
  to.add(sources_.factor->entries);
  to.add(sources_.factor->flops);
  return to.bytes;
}

void SearchCheckpoint::set_counter(InertiaCounter* counter) {
  sources_.counter = counter;
  if (counter != nullptr) counter->resume(uses_mumps_ == 1, backward_error_);
}

// The search deviates from the recorded one.
void SearchCheckpoint::drop_rest() {
  steps_.resize(next_);
  has_round_ = false;
}

const SearchStep* SearchCheckpoint::replay(const SearchStep& step) {
  if (next_ == steps_.size()) return nullptr;
  if (steps_[next_].asks_as(step)) return &steps_[next_++];
  drop_rest();
  return nullptr;
}

void SearchCheckpoint::record(const SearchStep& step) {
  if (checkpoint_ == nullptr) return;
  if (step.kind == SearchStep::kCount && has_round_) drop_rest();  // The interrupted iteration came next in the record.
  steps_.push_back(step);
  steps_.back().found = static_cast<std::int64_t>(sources_.found->lambda.size());
  next_ = steps_.size();
  checkpoint_->report_unsaved(true);
  save_if_requested(sources_.found->lambda.empty());  // A few counts are a few bytes, and each cost a factorisation.
}

void SearchCheckpoint::save_if_requested(bool always) {
  const CheckpointRequest request = vote(comm_, *checkpoint_);
  if (request.stop || request.save || always) save(nullptr, nullptr);
  if (request.stop) throw Stopped();
}

bool SearchCheckpoint::save(const LanczosState* lanczos, const Columns* basis) {
  std::vector<Columns> columns;
  std::optional<LocalColumns> found;
  const auto count = static_cast<int>(sources_.found->lambda.size());
  if (count > 0) {
    found.emplace(sources_.found->get_columns());
    columns.push_back(found->view().part(0, count));
  }
  if (basis != nullptr) columns.push_back(*basis);
  const bool is_saved = checkpoint_->save(pack(lanczos), columns);
  if (is_saved) checkpoint_->report_unsaved(false);
  return is_saved;
}

void SearchCheckpoint::load_found() {
  if (kept_lambda_.empty() || has_loaded_ || (next_ == steps_.size() && !has_round_)) return;
  has_loaded_ = true;
  sources_.found->make_room(petsc::to_petsc_int(static_cast<std::int64_t>(kept_lambda_.size())));
  const LocalColumns columns(sources_.found->get_columns());
  checkpoint_->read(0, columns.view().part(0, static_cast<int>(kept_lambda_.size())));
}

void SearchCheckpoint::restore_found(const SearchStep& step) {
  std::vector<double>& lambda = sources_.found->lambda;
  while (static_cast<std::int64_t>(lambda.size()) < step.found) lambda.push_back(kept_lambda_[lambda.size()]);
}

LanczosCheckpoint* SearchCheckpoint::begin_round(const SearchStep& step) {
  if (checkpoint_ == nullptr) return nullptr;
  const bool resumes = has_round_ && next_ == steps_.size() && round_.asks_as(step);
  if (!resumes) drop_rest();
  round_ = step;
  lanczos_ = {};
  if (resumes) lanczos_.start = &round_state_;
  lanczos_.read = [this](const Columns& basis) { checkpoint_->read(static_cast<std::int64_t>(kept_lambda_.size()), basis); };
  lanczos_.reject = checkpoint_->reject;
  lanczos_.ask = [this] {
    checkpoint_->report_unsaved(true);
    return checkpoint_->ask();
  };
  lanczos_.save = [this](const LanczosState& state, const Columns& basis) { save(&state, &basis); };
  return &lanczos_;
}

void SearchCheckpoint::end_round() {
  if (checkpoint_ == nullptr) return;
  has_round_ = false;
  round_state_ = {};
  if (lanczos_.was_stopped) throw Stopped();
}

// ---- a finished solve

namespace {

void write(NumberWriter& to, const Proof& proof) {
  to.add(static_cast<std::int64_t>(proof.counts.size()));
  for (const Count& count : proof.counts) {
    to.add(count.freq_hz);
    to.add(count.below);
    to.add(std::isfinite(count.margin) ? count.margin : -1.0);
  }
  to.add(static_cast<std::int64_t>(proof.rigid_per_component.size()));
  for (const std::int64_t rigid : proof.rigid_per_component) to.add(rigid);
  to.add(proof.found);
  to.add(proof.method);
  to.add(proof.factor_backward_error);
  to.add(static_cast<std::int64_t>(proof.clusters.size()));
  for (const Cluster& cluster : proof.clusters) {
    to.add(cluster.first);
    to.add(cluster.count);
  }
}

Proof read_proof(NumberReader& from, std::int64_t modes) {
  Proof proof;
  proof.counts.resize(from.get_count(0, kMaxSteps));
  for (Count& count : proof.counts) {
    count.freq_hz = from.get_double();
    count.below = from.get_count(0, kMax);
    count.margin = from.get_double();
    if (count.margin < 0) count.margin = std::numeric_limits<double>::infinity();
  }
  proof.rigid_per_component.resize(from.get_count(0, 100 * kMaxSteps));
  for (std::int64_t& rigid : proof.rigid_per_component) rigid = from.get_count(0, 6);
  proof.found = from.get_count(0, kMax);
  proof.method = from.get_text();
  proof.factor_backward_error = from.get_double();
  proof.clusters.resize(from.get_count(0, modes));
  for (Cluster& cluster : proof.clusters) {
    cluster.first = from.get_count(0, modes);
    cluster.count = from.get_count(0, modes - cluster.first);
  }
  return proof;
}

Modes read_modes(const std::string& numbers, std::int64_t rows) {
  NumberReader from(numbers);
  (void)from.get_count(kModes, kModes);
  Modes modes;
  modes.lambda = from.get_doubles(rows);
  const auto count = static_cast<std::int64_t>(modes.lambda.size());
  modes.residual = from.get_doubles(rows);
  if (modes.residual.size() != modes.lambda.size()) throw InputError("it has the wrong number of residuals");
  modes.above_tolerance_count = from.get_count(0, count);
  modes.orthonormality_error = from.get_double();
  for (std::int64_t* number : {&modes.rigid_count, &modes.count_below_low, &modes.band_count, &modes.mechanism_count})
    *number = from.get_count(-kMax, kMax);
  modes.proof = read_proof(from, count);
  modes.factor.solver = from.get_text();
  modes.factor.ordering = from.get_text();
  modes.factor.entries = from.get_count(0, kMax);
  modes.factor.flops = from.get_double();
  modes.factor.factorisations = from.get_count(0, kMax);
  modes.factor.solves = from.get_count(0, kMax);
  for (double* seconds : {&modes.seconds.rigid, &modes.seconds.analyse, &modes.seconds.factor, &modes.seconds.iterate, &modes.seconds.solve,
                          &modes.seconds.check, &modes.seconds.total})
    *seconds = from.get_double();
  from.end();
  return modes;
}

}  // namespace

bool save_modes(const Modes& modes, Checkpoint& checkpoint) {
  NumberWriter to;
  to.add(kModes);
  to.add(modes.lambda);
  to.add(modes.residual);
  to.add(modes.above_tolerance_count);
  to.add(modes.orthonormality_error);
  for (const std::int64_t number : {modes.rigid_count, modes.count_below_low, modes.band_count, modes.mechanism_count}) to.add(number);
  write(to, modes.proof);
  to.add(modes.factor.solver);
  to.add(modes.factor.ordering);
  to.add(modes.factor.entries);
  to.add(modes.factor.flops);
  to.add(modes.factor.factorisations);
  to.add(modes.factor.solves);
  for (const double seconds : {modes.seconds.rigid, modes.seconds.analyse, modes.seconds.factor, modes.seconds.iterate, modes.seconds.solve,
                               modes.seconds.check, modes.seconds.total})
    to.add(seconds);
  std::vector<Columns> columns;
  std::optional<LocalColumns> shapes;
  if (modes.shapes.get() != nullptr) {
    shapes.emplace(modes.shapes);
    columns.push_back(shapes->view());
  }
  const bool is_saved = checkpoint.save(to.bytes, columns);
  if (is_saved) checkpoint.report_unsaved(false);
  return is_saved;
}

std::optional<Modes> load_modes(Mat stiffness, Checkpoint& checkpoint) {
  const std::string& numbers = checkpoint.numbers;
  std::int64_t kind = 0;
  if (numbers.size() < sizeof kind) return std::nullopt;
  std::copy_n(numbers.data(), sizeof kind, reinterpret_cast<char*>(&kind));
  if (kind != kModes) return std::nullopt;
  PetscInt rows = 0, all = 0;
  check(MatGetLocalSize(stiffness, &rows, nullptr));
  check(MatGetSize(stiffness, &all, nullptr));
  Modes modes;
  try {
    modes = read_modes(numbers, all);
    if (checkpoint.column_count != static_cast<std::int64_t>(modes.lambda.size())) throw InputError("it has the wrong number of columns");
  } catch (const InputError& error) {
    checkpoint.reject(error.what());
    return std::nullopt;
  }
  if (modes.lambda.empty()) return modes;
  const comm::Communicator comm = petsc::get_communicator(stiffness);
  check(MatCreateDense(comm, rows, PETSC_DECIDE, all, petsc::to_petsc_int(checkpoint.column_count), nullptr, modes.shapes.out()));
  {
    const LocalColumns columns(modes.shapes);
    checkpoint.read(0, columns.view());
  }
  check(MatAssemblyBegin(modes.shapes, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(modes.shapes, MAT_FINAL_ASSEMBLY));
  return modes;
}

}  // namespace carillon::eigen
