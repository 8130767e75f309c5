// Method:     The search is a fixed function of what its factorisations and iterations come to. Only these are kept, in their order, and
//             the modes with them: the search is done again with the answers at hand, which costs nothing, and comes to stand where it
//             was. An iteration in the middle goes on from its basis and its projected matrix.
// Source:     Elnozahy, Alvisi, Wang, Johnson, A survey of rollback-recovery protocols, ACM Computing Surveys 34(3), 2002, section 3.1
//             (replay of what is deterministic).
// Deviations: none.
#include "precompute/eigen/search_keeper.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "precompute/eigen/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr std::int64_t kSearch = 1, kModes = 2;    // what a state is of
constexpr std::int64_t kMostSteps = 100'000;       // Bounds for numbers that come from a file.
constexpr std::int64_t kMost = 1'000'000'000'000;  // counts and operations

Wish vote(MPI_Comm comm, const Checkpoint& checkpoint) {
  const Wish mine = checkpoint.ask();
  std::array<int, 2> any{mine.stop ? 1 : 0, mine.save ? 1 : 0};
  MPI_Allreduce(MPI_IN_PLACE, any.data(), 2, MPI_INT, MPI_MAX, comm);
  return {any[0] != 0, any[1] != 0};
}

void write(NumberWriter& to, const LanczosState& state) {
  for (const std::int64_t value : state.sizes) to.add(value);
  to.add(state.t);
}

LanczosState read_lanczos(NumberReader& from, std::int64_t rows) {
  LanczosState state;
  for (std::int64_t& value : state.sizes) value = from.get_count(0, kMost);
  const std::int64_t size = state.size();
  if (size > rows || size > 46'000) throw InputError("its basis is too large");
  state.t = from.get_doubles(size * size);
  if (static_cast<std::int64_t>(state.t.size()) != size * size) throw InputError("its projected matrix has another size");
  return state;
}

}  // namespace

void SearchKeeper::start(std::int64_t rows, std::array<std::int64_t, 2> powers) {
  if (checkpoint_ == nullptr) return;
  powers_ = powers;
  if (checkpoint_->numbers.empty()) return;
  try {
    unpack(rows);
  } catch (const InputError& error) {  // The numbers are the same on every rank, and so is this.
    steps_.clear();
    kept_lambda_.clear();
    has_round_ = false;
    uses_mumps_ = 0;
    backward_error_ = 0;
    checkpoint_->reject(error.what());
  }
}

void SearchKeeper::unpack(std::int64_t rows) {
  NumberReader from(checkpoint_->numbers);
  (void)from.get_count(kSearch, kSearch);
  for (const std::int64_t power : powers_) {
    if (from.get_count(-4096, 4096) != power) throw InputError("it is of a problem in other units");
  }
  steps_.resize(static_cast<std::size_t>(from.get_count(0, kMostSteps)));
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
  if (checkpoint_->column_count != kept + (has_round_ ? round_state_.size() : 0)) throw InputError("it has columns too many or too few");
  uses_mumps_ = from.get_count(0, 1);
  backward_error_ = from.get_double();
  FactorStatistics factor;
  factor.solver = from.get_text();
  factor.ordering = from.get_text();
  factor.entries = from.get_count(0, kMost);
  factor.flops = from.get_double();
  from.end();
  *sources_.factor = factor;
}

std::string SearchKeeper::pack(const LanczosState* lanczos) const {
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

void SearchKeeper::set_counter(InertiaCounter* counter) {
  sources_.counter = counter;
  if (counter != nullptr) counter->go_on(uses_mumps_ == 1, backward_error_);
}

// What comes now is not what came the last time.
void SearchKeeper::forget_rest() {
  steps_.resize(next_);
  has_round_ = false;
}

const SearchStep* SearchKeeper::recall(const SearchStep& step) {
  if (next_ == steps_.size()) return nullptr;
  if (steps_[next_].asks_as(step)) return &steps_[next_++];
  forget_rest();
  return nullptr;
}

void SearchKeeper::record(const SearchStep& step) {
  if (checkpoint_ == nullptr) return;
  if (step.kind == SearchStep::kCount && has_round_) forget_rest();  // The iteration under way came next.
  steps_.push_back(step);
  steps_.back().found = static_cast<std::int64_t>(sources_.found->lambda.size());
  next_ = steps_.size();
  checkpoint_->tell_news(true);
  settle(sources_.found->lambda.empty());  // A few counts are a few bytes, and each has cost a factorisation.
}

void SearchKeeper::settle(bool always) {
  const Wish wish = vote(comm_, *checkpoint_);
  if (wish.stop || wish.save || always) save(nullptr, nullptr);
  if (wish.stop) throw Stopped();
}

bool SearchKeeper::save(const LanczosState* lanczos, const Columns* basis) {
  std::vector<Columns> columns;
  std::optional<LocalColumns> found;
  const auto count = static_cast<int>(sources_.found->lambda.size());
  if (count > 0) {
    found.emplace(sources_.found->get_columns());
    columns.push_back(found->view().part(0, count));
  }
  if (basis != nullptr) columns.push_back(*basis);
  const bool is_saved = checkpoint_->save(pack(lanczos), columns);
  if (is_saved) checkpoint_->tell_news(false);
  return is_saved;
}

void SearchKeeper::load_found() {
  if (kept_lambda_.empty() || has_loaded_ || (next_ == steps_.size() && !has_round_)) return;
  has_loaded_ = true;
  sources_.found->make_room(petsc::to_petsc_int(static_cast<std::int64_t>(kept_lambda_.size())));
  const LocalColumns columns(sources_.found->get_columns());
  checkpoint_->read(0, columns.view().part(0, static_cast<int>(kept_lambda_.size())));
}

void SearchKeeper::show_found(const SearchStep& step) {
  std::vector<double>& lambda = sources_.found->lambda;
  while (static_cast<std::int64_t>(lambda.size()) < step.found) lambda.push_back(kept_lambda_[lambda.size()]);
}

LanczosKeeper* SearchKeeper::begin_round(const SearchStep& step) {
  if (checkpoint_ == nullptr) return nullptr;
  const bool goes_on = has_round_ && next_ == steps_.size() && round_.asks_as(step);
  if (!goes_on) forget_rest();
  round_ = step;
  lanczos_ = {};
  if (goes_on) lanczos_.start = &round_state_;
  lanczos_.read = [this](const Columns& basis) { checkpoint_->read(static_cast<std::int64_t>(kept_lambda_.size()), basis); };
  lanczos_.reject = checkpoint_->reject;
  lanczos_.ask = [this] {
    checkpoint_->tell_news(true);
    return checkpoint_->ask();
  };
  lanczos_.save = [this](const LanczosState& state, const Columns& basis) { save(&state, &basis); };
  return &lanczos_;
}

void SearchKeeper::end_round() {
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
  proof.counts.resize(static_cast<std::size_t>(from.get_count(0, kMostSteps)));
  for (Count& count : proof.counts) {
    count.freq_hz = from.get_double();
    count.below = from.get_count(0, kMost);
    count.margin = from.get_double();
    if (count.margin < 0) count.margin = std::numeric_limits<double>::infinity();
  }
  proof.rigid_per_component.resize(static_cast<std::size_t>(from.get_count(0, 100 * kMostSteps)));
  for (std::int64_t& rigid : proof.rigid_per_component) rigid = from.get_count(0, 6);
  proof.found = from.get_count(0, kMost);
  proof.method = from.get_text();
  proof.factor_backward_error = from.get_double();
  proof.clusters.resize(static_cast<std::size_t>(from.get_count(0, modes)));
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
  if (modes.residual.size() != modes.lambda.size()) throw InputError("it has residuals too many or too few");
  modes.above_tolerance_count = from.get_count(0, count);
  modes.orthonormality_error = from.get_double();
  for (std::int64_t* number : {&modes.rigid_count, &modes.count_below_low, &modes.band_count, &modes.mechanism_count})
    *number = from.get_count(-kMost, kMost);
  modes.proof = read_proof(from, count);
  modes.factor.solver = from.get_text();
  modes.factor.ordering = from.get_text();
  modes.factor.entries = from.get_count(0, kMost);
  modes.factor.flops = from.get_double();
  modes.factor.factorisations = from.get_count(0, kMost);
  modes.factor.solves = from.get_count(0, kMost);
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
  if (is_saved) checkpoint.tell_news(false);
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
    if (checkpoint.column_count != static_cast<std::int64_t>(modes.lambda.size())) throw InputError("it has columns too many or too few");
  } catch (const InputError& error) {
    checkpoint.reject(error.what());
    return std::nullopt;
  }
  if (modes.lambda.empty()) return modes;
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(stiffness), &comm));
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
