// Method: V_{j+1} R_j = A^-1 M V_j - V_j alpha_j - V_{j-1} R_{j-1}^T in the M inner product, A = K - sigma M, blocks of b columns. The
// projected matrix is block tridiagonal; a Ritz step is made when the wanted pairs are predicted to have converged. A full basis is
// restarted with its best Ritz vectors. Ritz vectors pass through the operator once more by the recurrence, and are orthogonalised against
// the pairs nearest to the shift.
// Source: Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994. Wu, Simon, Thick-restart
// Lanczos, SIAM J. Matrix Anal. Appl. 22(2), 2000.
#include "precompute/eigen/block_lanczos.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>
#include <vector>

#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

constexpr int kPurifiedAgainst =
    32;  // Number of converged pairs nearest to the shift that the others are orthogonalised against at the end.
constexpr int kColumnsCleared = 128;        // Locked modes that the others are orthogonalised against at a time.
constexpr double kLockedRemainder = 1e-12;  // Smaller remainders of a locked mode are ignored.
constexpr double kOrthonormal = 1e-6;       // Maximum orthonormality error of a saved block.

std::vector<double> calc_theta(const LockedModes& locked, double sigma) {
  std::vector<double> theta = locked.lambda;
  for (double& x : theta) x = 1 / (x - sigma);
  return theta;
}

void copy(const Columns& from, const Columns& to) {
  for (int j = 0; j < from.count; ++j) std::copy_n(from.column(j), from.rows, to.column(j));
}

}  // namespace

BlockLanczos::BlockLanczos(const LanczosProblem& problem, RitzGoal goal, int max_steps, LanczosCheckpoint* checkpoint)
    : inverse_(problem.inverse),
      inner_(problem.inner),
      basis_(problem.basis),
      locked_(problem.locked),
      goal_(std::move(goal)),
      max_steps_(max_steps),
      checkpoint_(checkpoint),
      orthogonaliser_(inner_, basis_, locked_, calc_theta(locked_, inverse_.get_sigma()), problem.n, problem.first_row, checkpoint) {}

// w = A^-1 z, z: M times the current block; w is at column `to` of the basis afterwards.
void BlockLanczos::invert(int to) {
  inner_.place(basis_.columns(to, basis_.block()));
  inverse_.apply(inner_.z(), inner_.w());
}

// The starting block passes through the operator once, which damps components far from the shift.
bool BlockLanczos::start() {
  inner_.place(basis_.columns(0, basis_.block()));
  inner_.multiply();
  invert(0);
  basis_.start(orthogonaliser_.start());
  next_check_ = std::min(2 * static_cast<int>(goal_.wanted) + 2 * basis_.block(), basis_.room());
  return basis_.width() > 0;
}

bool BlockLanczos::step() {
  invert(basis_.size());
  orthogonaliser_.step();
  ++steps_;
  return basis_.next_width() > 0;
}

BlockLanczos::End BlockLanczos::run(const Monitor& monitor) {
  if (!resume() && !start()) return End::kExhausted;  // the space is spanned by locked modes
  while (true) {
    const bool is_exhausted = !step();
    if (is_exhausted || basis_.is_full() || basis_.size() >= next_check_ || steps_ >= max_steps_) {
      RitzPairs pairs = calc_ritz_pairs(inner_.comm(), basis_);
      RitzSelection selection = select(pairs, goal_);
      if (is_exhausted) selection.is_complete = true;
      converged_ = std::min<std::int64_t>(selection.converged, pairs.theta.size());
      if (monitor(pairs, selection, steps_)) {
        finish(pairs, selection);
        return End::kStopped;
      }
      if (basis_.is_full()) restart(pairs, selection);
      plan_check(selection);
    }
    basis_.append();
    if (save_if_requested()) return End::kCheckpointed;
  }
}

// Schedules the next Ritz step by the convergence rate so far.
void BlockLanczos::plan_check(const RitzSelection& selection) {
  const auto wanted = static_cast<double>(goal_.wanted);
  const auto converged = static_cast<double>(selection.converged);
  double ahead = 4.0 * basis_.block();
  if (selection.converged > last_converged_) {
    const double rate = (converged - static_cast<double>(last_converged_)) / (basis_.size() - last_size_);
    ahead = std::min(ahead, (wanted - converged) / rate * 0.7);
  }
  last_converged_ = selection.converged;
  last_size_ = basis_.size();
  const int least = wanted - converged <= basis_.block() ? basis_.block() : 2 * basis_.block();
  next_check_ = basis_.size() + std::max(least, static_cast<int>(ahead));
}

void BlockLanczos::restart(RitzPairs& pairs, const RitzSelection& selection) {
  share_vectors(inner_.comm(), pairs);
  const int size = basis_.size(), block = basis_.block();
  const int max = std::max(size - 2 * block, 1);
  const int kept = std::clamp(std::max(static_cast<int>(selection.converged) + block, (static_cast<int>(goal_.wanted) + size) / 2), 1, max);
  la::Vector theta(kept);
  for (int j = 0; j < kept; ++j) theta[j] = pairs.theta[selection.order[j]];
  basis_.restart(theta, pick_vectors(pairs, selection, kept));
  last_size_ = basis_.size();
  orthogonaliser_.reset();
}

// ---- final Ritz vectors

// Passes the vectors through the operator once, y + V_next R s / theta, at almost no cost as V_next is available: removes remainders of
// frequencies far above the shift, which are small in the M norm and large in the residual of K. (size + next_width, count)
la::Matrix BlockLanczos::calc_purified(const RitzPairs& pairs, const RitzSelection& selection, int count) const {
  const la::Matrix picked = pick_vectors(pairs, selection, count);
  const la::Matrix& r = basis_.coupling();
  const int n = basis_.size(), width = basis_.width();
  la::Matrix purified = la::Matrix::Zero(n + r.rows(), count);
  purified.topRows(n) = picked;
  for (int j = 0; j < count; ++j) {
    const double theta = pairs.theta[selection.order[j]];
    for (int k = 0; k < r.rows(); ++k) {
      for (int i = 0; i < width; ++i) purified(n + k, j) += r(k, i) * picked(n - width + i, j) / theta;
    }
  }
  return purified;
}

void BlockLanczos::finish(RitzPairs& pairs, const RitzSelection& selection) {
  share_vectors(inner_.comm(), pairs);
  const auto count = static_cast<int>(converged_);
  const la::Matrix purified = calc_purified(pairs, selection, count);
  la::combine_columns(basis_.columns(0, static_cast<int>(purified.rows())), purified.data(), count);
  inner_.place(basis_.columns(count, basis_.block()));  // workspace
  clear_nearest(pairs, selection, count);
  clear_locked(count);
  // Free memory behind the result, before that is copied.
  const Columns room = basis_.columns(count, basis_.room() + basis_.block() - count);
  if (room.rows > 0) petsc::give_back_pages(room.values, room.column(room.count));
}

// Skipped projections leave rounding along the pairs nearest to the shift, due to their large theta. These pairs are the most accurate, so
// the others are orthogonalised against them, block by block.
void BlockLanczos::clear_nearest(const RitzPairs& pairs, const RitzSelection& selection, int count) {
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  const auto theta = [&](int j) { return std::abs(pairs.theta[selection.order[j]]); };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return theta(a) > theta(b); });
  const Columns found = basis_.columns(0, count);
  const Columns w = inner_.w();
  for (int first = 0; first < std::min(count, kPurifiedAgainst); first += basis_.block()) {
    const int width = std::min(basis_.block(), count - first);
    const Columns nearest = w.part(0, width);
    for (int j = 0; j < width; ++j) std::copy_n(found.column(order[first + j]), w.rows, nearest.column(j));
    inner_.multiply();
    la::Matrix products = inner_.calc_products(inner_.z().part(0, width), found);
    for (int place = 0; place < std::min(first + width, count); ++place) {  // Nearer pairs stay unchanged.
      const int from = std::max(place - first, 0);
      products.col(order[place]).segment(from, width - from).setZero();
    }
    la::subtract_product(nearest, products.data(), width, found);
  }
}

// Removes remainders of locked modes. M times these is computed behind w, where the columns are free.
void BlockLanczos::clear_locked(int count) {
  const std::vector<double>& remaining = orthogonaliser_.get_remaining();
  const auto is_left = [](double x) { return x > kLockedRemainder; };
  const auto first = std::find_if(remaining.begin(), remaining.end(), is_left);
  const auto last = std::find_if(remaining.rbegin(), std::make_reverse_iterator(first), is_left).base();
  const LockedRange range{static_cast<int>(first - remaining.begin()), static_cast<int>(last - first)};
  const int block = basis_.block();
  const int wide = std::min(basis_.room() - count, kColumnsCleared);
  const Columns found = basis_.columns(0, count);
  for (const Columns& part : locked_.find_parts(range)) {
    const int step = std::max(wide, block);
    for (int at = 0; at < part.count; at += step) {
      const Columns some = part.part(at, std::min(step, part.count - at));
      const Columns images = wide < block ? inner_.z().part(0, some.count) : basis_.columns(count + block, some.count);
      for (int from = 0; from < some.count; from += block) {
        const int width = std::min(block, some.count - from);
        copy(some.part(from, width), inner_.w());
        inner_.multiply();
        if (wide >= block) copy(inner_.z().part(0, width), images.part(from, width));
      }
      la::subtract_product(some, inner_.calc_products(images, found).data(), some.count, found);
    }
  }
}

// ---- checkpoints

// Resumes the iteration of the checkpoint. False if there is none or it does not fit; then it has no effect.
bool BlockLanczos::resume() {
  if (checkpoint_ == nullptr || checkpoint_->start == nullptr) return false;
  const LanczosState& state = *checkpoint_->start;
  const auto& [block, room, size, width, previous, next_check, last_size, last_converged, steps, random_columns] = state.sizes;
  const bool fits = block == basis_.block() && room == basis_.room() && size <= room && width >= 1 && width <= block && width <= size &&
                    previous <= size - width && last_size <= size && last_converged <= size && next_check <= room + 4 * block &&
                    steps < max_steps_ && static_cast<std::int64_t>(state.t.size()) == size * size;
  if (!fits) {
    checkpoint_->reject("its iteration is a different one");
    return false;
  }
  const Columns initial = basis_.columns(0, basis_.block());
  const std::vector<double> starting_block(initial.values, initial.values + initial.rows * initial.count);
  checkpoint_->read(basis_.columns(0, static_cast<int>(size)));
  if (!is_orthonormal(static_cast<int>(size - width), static_cast<int>(width))) {
    std::copy(starting_block.begin(), starting_block.end(), initial.values);
    checkpoint_->reject("its basis is not orthonormal");
    return false;
  }
  basis_.resume(static_cast<int>(size), static_cast<int>(width), static_cast<int>(previous),
                Eigen::Map<const la::Matrix>(state.t.data(), size, size));
  next_check_ = static_cast<int>(next_check);
  last_size_ = static_cast<int>(last_size);
  last_converged_ = last_converged;
  steps_ = static_cast<int>(steps);
  orthogonaliser_.set_random_columns(static_cast<std::uint64_t>(random_columns));
  return true;
}

// True if `width` columns from `first` on are M-orthonormal; afterwards Z is M times them.
bool BlockLanczos::is_orthonormal(int first, int width) {
  inner_.place(basis_.columns(first, basis_.block()));
  for (int j = width; j < basis_.block(); ++j) std::fill_n(inner_.w().column(j), inner_.w().rows, 0.0);
  inner_.multiply();
  const la::Matrix gram = inner_.calc_products(inner_.w().part(0, width), inner_.z().part(0, width));
  double error = 0;
  for (int j = 0; j < width; ++j) {
    for (int i = 0; i < width; ++i) error = std::max(error, std::abs(gram(i, j) - (i == j ? 1 : 0)));
  }
  return error < kOrthonormal;
}

// Between two steps: saves if a rank requested it. True on a stop request.
bool BlockLanczos::save_if_requested() {
  const CheckpointRequest request = orthogonaliser_.request();
  if (checkpoint_ == nullptr || !(request.stop || request.save)) return false;
  const int size = basis_.size();
  LanczosState state;
  state.sizes = {basis_.block(),
                 basis_.room(),
                 size,
                 basis_.width(),
                 basis_.previous(),
                 next_check_,
                 last_size_,
                 last_converged_,
                 steps_,
                 static_cast<std::int64_t>(orthogonaliser_.get_random_columns())};
  const la::Matrix t = basis_.t().topLeftCorner(size, size);
  state.t.assign(t.data(), t.data() + t.size());
  checkpoint_->save(state, basis_.columns(0, size));
  checkpoint_->was_stopped = request.stop;
  orthogonaliser_.clear_request();
  return request.stop;
}

}  // namespace carillon::eigen
