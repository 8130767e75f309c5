// One iteration and what SLEPc needs to call it: longer than most files, as every part works on the same basis.
// Method:     V_{j+1} R_j = A^-1 M V_j - V_j alpha_j - V_{j-1} R_{j-1}^T in the M inner product, A = K - sigma M, blocks of b columns. The
//             recurrence is followed by one projection, against the whole basis only where orthogonality is about to be lost
//             (orthogonality.cpp); the block is orthonormalised by Cholesky QR, twice if it is badly conditioned, and column by column,
//             with random columns for dependent ones, if it is singular. The projected matrix is block tridiagonal; ||R_j s_i||, s_i the
//             last block row of its eigenvector, is the residual of a Ritz pair. A full basis is restarted with its best Ritz vectors.
// Source:     Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994. Wu, Simon, Thick-restart
//             Lanczos, SIAM J. Matrix Anal. Appl. 22(2), 2000. Yamamoto et al., Roundoff error analysis of the CholeskyQR2 algorithm, ETNA
//             44, 2015.
// Deviations: Ritz vectors go through the operator once more by the recurrence, and are cleared of the pairs nearest the shift.
#include "precompute/eigen/block_lanczos.hpp"

#include <petscblaslapack.h>
#include <slepc/private/epsimpl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <numeric>
#include <vector>

#include "precompute/eigen/block_kernels.hpp"
#include "precompute/eigen/local_columns.hpp"
#include "precompute/eigen/orthogonality.hpp"
#include "precompute/petsc/guard.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/noise.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"

// What petscblaslapack.h leaves out.
extern "C" {
void dtrtri_(const char* half, const char* diagonal, const int* n, double* a, const int* lda, int* info);
void dsyevd_(const char* job, const char* half, const int* n, double* a, const int* lda, double* w, double* work, const int* lwork,
             int* iwork, const int* liwork, int* info);
}

namespace carillon::eigen {
namespace {

using petsc::check;
using petsc::guard;

constexpr PetscInt kDefaultBlock = 16;
constexpr double kWellConditioned = 1e-2;  // Smallest pivot of the scaled Gram matrix that needs no second Cholesky QR,
constexpr double kDependent = 1e-11;       // and smallest that Cholesky QR is trusted with.
constexpr double kTaken = 1e-2;            // A projection that takes more of a column's square is done once more.
constexpr double kAngle = 1e-7;            // Ritz vectors must be separated from their neighbours to this angle,
constexpr double kSmallest = 1e-14;        // as far as residuals, relative to theta, can say.
constexpr double kEigenFlops = 9;          // of n^3: a symmetric eigenproblem with its vectors (Golub, Van Loan, 8.3)
constexpr int kNearest = 32;               // Converged pairs that the others are cleared of at the end.
constexpr int kWide = 128;                 // Columns that are cleared at a time.
constexpr double kLeft = 1e-12;            // Less of a locked mode may stay in the others.
constexpr double kSame = 1e-9;             // Closer Ritz values are one.
constexpr double kOrthonormal = 1e-6;      // An orthonormal block that was kept is no farther from being one.
constexpr double kSeen = 1e-3;             // A Ritz value with this error is no phantom.

// What the type keeps in eps->data.
struct Settings {
  PetscInt block = PETSC_DEFAULT;
  PetscBool knows_count = PETSC_TRUE;
  const LockedModes* locked = nullptr;
  LanczosKeeper* keeper = nullptr;
};

Settings& get_settings(EPS eps) { return *static_cast<Settings*>(eps->data); }

using Small = std::vector<double>;  // column-major

class Iteration {
 public:
  explicit Iteration(EPS eps);
  void run();

 private:
  struct Ritz {
    Small theta;                // (basis), ascending
    Small vectors;              // (basis, basis); on other ranks than the first only after share_vectors
    std::vector<double> error;  // (basis) what the convergence test says, <= tol: converged
    std::vector<int> order;     // the wanted ones first
    std::size_t converged = 0;  // leading ones of order
    bool done = false;
  };

  void open_basis();
  void close_basis();
  void start();
  bool go_on();
  bool keep();
  bool step();
  void multiply_mass();
  void invert(int to);
  void project(bool is_first, Small& alpha);
  bool agree(bool opinion) const;
  void agree(bool& is_spared, LockedRange& lossy) const;
  void place(int first);
  Small clear_of_locked(LockedRange range, const Columns& block, const Columns& block_mass) const;
  Orthogonality::State get_state() const { return {t_.data(), room_, size_, width_, previous_}; }
  int orthonormalise(Small& r);
  bool orthonormalise_by_cholesky(Small& r);
  void project_after_all();
  int orthonormalise_by_columns(Small& r);
  Small sum_products(const Columns& a, const Columns& b) const;
  Small sum_products_and_wishes(const Columns& a, const Columns& b);
  double orthogonalise_column(int i, double* coefficients);
  Ritz calc_ritz();
  void calc_errors(Ritz& ritz) const;
  void choose_wanted(Ritz& ritz, const Small& lambda) const;
  void share_vectors(Ritz& ritz) const;
  Small pick_vectors(const Ritz& ritz, std::size_t count) const;
  bool is_due() const;
  void plan_check(const Ritz& ritz);
  bool report(const Ritz& ritz);
  void restart(Ritz& ritz);
  void finish(Ritz& ritz);
  void clear_nearest(const Ritz& ritz, int count);
  void clear_locked(int count);
  double& t(int i, int j) { return t_[static_cast<std::size_t>(j) * static_cast<std::size_t>(room_) + static_cast<std::size_t>(i)]; }

  EPS eps_;
  MPI_Comm comm_ = MPI_COMM_NULL;
  int block_ = 1;
  int room_ = 0;         // columns the basis may have
  PC direct_ = nullptr;  // A^-1 itself, where it is a shell: KSPMatSolve would write zeros over the block first
  Columns fixed_;        // deflation space; the basis follows it in memory
  Columns basis_;        // the first `size_` columns are in use
  Columns everything_;   // both
  LockedModes locked_;
  int size_ = 0;
  int width_ = 0;     // of the current block, the last columns of the basis
  int previous_ = 0;  // first column of what the current block is coupled to
  int next_width_ = 0;
  Small t_;         // projected operator, (room, room)
  Small coupling_;  // R of the next block, (next_width, width)
  petsc::MatHandle w_mat_, z_mat_, mass_;
  Columns w_;  // the next block, behind the basis in its memory,
  bool is_placed_ = false;
  Columns z_;  // and M times it; after a step they are the current block's
  int next_check_ = 0;
  int last_size_ = 0;
  std::size_t last_converged_ = 0;
  std::uint64_t noise_ = 0;
  Orthogonality orthogonality_;
  LanczosKeeper* keeper_ = nullptr;  // may be null
  Wish wish_;                        // of all ranks, since the last save
  bool is_spared_ = false;           // the step did without the projection against the whole basis,
  LockedRange lossy_;                // what is locked that the step was cleared of
  LockedOrthogonality locked_orthogonality_;
};

Columns view(Mat dense) {
  const LocalColumns access(dense);
  return access.view();
}

// The preconditioner of a transformation that does nothing but apply it, if it is a shell; null otherwise, and where the user has set any
// option of the KSP, which may want to report.
PC find_direct(ST st) {
  KSP ksp = nullptr;
  PC pc = nullptr;
  const char* prefix = nullptr;
  char* options = nullptr;
  PetscBool applies = PETSC_FALSE;
  PetscBool is_shell = PETSC_FALSE;
  check(STGetKSP(st, &ksp));
  check(KSPGetPC(ksp, &pc));
  check(KSPGetOptionsPrefix(ksp, &prefix));
  check(PetscOptionsGetAll(nullptr, &options));
  const std::string of_ksp = std::string("-") + (prefix != nullptr ? prefix : "") + "ksp_";
  const bool is_set = std::string(options).find(of_ksp) != std::string::npos;
  check(PetscFree(options));
  if (is_set) return nullptr;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(ksp), KSPPREONLY, &applies));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCSHELL, &is_shell));
  return applies == PETSC_TRUE && is_shell == PETSC_TRUE ? pc : nullptr;
}

Iteration::Iteration(EPS eps) : eps_(eps) {
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(eps), &comm_));
  const Settings& settings = get_settings(eps);
  PetscInt fixed = 0;
  check(BVGetNumConstraints(eps->V, &fixed));
  if (settings.locked != nullptr) locked_ = *settings.locked;
  room_ = static_cast<int>(std::min(eps->ncv, eps->n - fixed - locked_.count()));
  keeper_ = settings.keeper;
  block_ = static_cast<int>(std::min<PetscInt>(settings.block, std::max<PetscInt>(room_, 1)));
  t_.assign(static_cast<std::size_t>(room_) * static_cast<std::size_t>(room_), 0.0);

  direct_ = find_direct(eps->st);
  PetscScalar sigma = 0;
  check(STGetShift(eps->st, &sigma));
  std::vector<double> theta = locked_.lambda;
  for (double& x : theta) x = 1 / (x - sigma);
  locked_orthogonality_ = LockedOrthogonality(theta);
  Mat mass = nullptr;
  check(BVGetMatrix(eps->V, &mass, nullptr));
  check(MatCreateDense(comm_, eps->nloc, PETSC_DECIDE, eps->n, block_, nullptr, w_mat_.out()));
  check(MatAssemblyBegin(w_mat_, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(w_mat_, MAT_FINAL_ASSEMBLY));
  if (mass != nullptr) {
    check(PetscObjectReference(reinterpret_cast<PetscObject>(mass)));
    mass_ = petsc::MatHandle(mass);
    check(MatMatMult(mass, w_mat_, MAT_INITIAL_MATRIX, PETSC_DEFAULT, z_mat_.out()));
  } else {
    check(MatDuplicate(w_mat_, MAT_COPY_VALUES, z_mat_.out()));
  }
  z_ = view(z_mat_);
}

Small Iteration::sum_products(const Columns& a, const Columns& b) const {
  Small products(static_cast<std::size_t>(a.count) * static_cast<std::size_t>(b.count), 0.0);
  multiply_transposed(a, b, products.data(), a.count);
  MPI_Allreduce(MPI_IN_PLACE, products.data(), static_cast<int>(products.size()), MPI_DOUBLE, MPI_SUM, comm_);
  return products;
}

// A^T B, and what the ranks want of the keeper, which goes along: no message of its own.
Small Iteration::sum_products_and_wishes(const Columns& a, const Columns& b) {
  if (keeper_ == nullptr) return sum_products(a, b);
  const std::size_t count = static_cast<std::size_t>(a.count) * static_cast<std::size_t>(b.count);
  Small products(count + 2, 0.0);
  multiply_transposed(a, b, products.data(), a.count);
  const Wish wish = keeper_->ask();
  products[count] = wish.stop ? 1 : 0;
  products[count + 1] = wish.save ? 1 : 0;
  MPI_Allreduce(MPI_IN_PLACE, products.data(), static_cast<int>(products.size()), MPI_DOUBLE, MPI_SUM, comm_);
  wish_.stop = wish_.stop || products[count] > 0;
  wish_.save = wish_.save || products[count + 1] > 0;
  products.resize(count);
  return products;
}

// From here on w is what stands in the basis from column `first` on.
void Iteration::place(int first) {
  if (is_placed_) check(MatDenseResetArray(w_mat_));
  check(MatDensePlaceArray(w_mat_, basis_.column(first)));
  is_placed_ = true;
  w_ = basis_.part(first, block_);
}

// z = M w.
void Iteration::multiply_mass() {
  if (mass_.get() != nullptr) {
    check(PetscObjectStateIncrease(reinterpret_cast<PetscObject>(w_mat_.get())));
    Mat z = z_mat_;
    check(MatMatMult(mass_, w_mat_, MAT_REUSE_MATRIX, PETSC_DEFAULT, &z));
  } else {
    for (int j = 0; j < w_.count; ++j) std::copy_n(w_.column(j), w_.rows, z_.column(j));
  }
}

// w = A^-1 z, z being M times the current block; w stands at column `to` of the basis then.
void Iteration::invert(int to) {
  place(to);
  check(PetscObjectStateIncrease(reinterpret_cast<PetscObject>(w_mat_.get())));
  check(PetscObjectStateIncrease(reinterpret_cast<PetscObject>(z_mat_.get())));
  if (direct_ != nullptr) return check(PCMatApply(direct_, z_mat_, w_mat_));
  check(STMatMatSolve(eps_->st, z_mat_, w_mat_));
}

void Iteration::open_basis() {
  PetscScalar* array = nullptr;
  PetscInt fixed = 0;
  check(BVGetNumConstraints(eps_->V, &fixed));
  check(BVGetArray(eps_->V, &array));
  const auto rows = static_cast<std::ptrdiff_t>(eps_->nloc);
  fixed_ = {array, rows, rows, static_cast<int>(fixed)};
  basis_ = {array + fixed * rows, rows, rows, room_ + block_};
  everything_ = {array, rows, rows, static_cast<int>(fixed) + room_ + block_};
}

void Iteration::close_basis() {
  if (is_placed_) check(MatDenseResetArray(w_mat_));
  is_placed_ = false;
  w_ = {};
  PetscScalar* array = everything_.values;
  check(BVRestoreArray(eps_->V, &array));
}

// From where the keeper's iteration stood. False where it does not fit this one: what is read has no effect then.
bool Iteration::go_on() {
  const LanczosState& state = *keeper_->start;
  const auto& [block, room, size, width, previous, next_check, last_size, last_converged, iterations, noise] = state.sizes;
  const bool fits = block == block_ && room == room_ && size <= room && width >= 1 && width <= block && width <= size &&
                    previous <= size - width && last_size <= size && last_converged <= size && next_check <= room + 4 * block &&
                    iterations < eps_->max_it && static_cast<std::int64_t>(state.t.size()) == size * size;
  if (!fits) {
    keeper_->reject("its iteration is not this one");
    return false;
  }
  const Columns initial = basis_.part(0, static_cast<int>(eps_->nini));
  Small initial_space(static_cast<std::size_t>(initial.rows) * static_cast<std::size_t>(initial.count));
  std::copy_n(initial.values, initial_space.size(), initial_space.data());
  keeper_->read(basis_.part(0, static_cast<int>(size)));
  width_ = static_cast<int>(width);
  place(static_cast<int>(size - width));
  for (int j = width_; j < block_; ++j) std::fill_n(w_.column(j), w_.rows, 0.0);
  multiply_mass();
  const Small gram = sum_products(w_.part(0, width_), z_.part(0, width_));
  double error = 0;
  for (int j = 0; j < width_; ++j) {
    for (int i = 0; i < width_; ++i) error = std::max(error, std::abs(gram[static_cast<std::size_t>(j * width_ + i)] - (i == j ? 1 : 0)));
  }
  if (!(error < kOrthonormal)) {
    std::copy_n(initial_space.data(), initial_space.size(), initial.values);
    keeper_->reject("its basis is not orthonormal");
    return false;
  }
  size_ = static_cast<int>(size);
  for (int j = 0; j < size_; ++j) std::copy_n(state.t.data() + static_cast<std::ptrdiff_t>(j) * size_, size_, &t(0, j));
  previous_ = static_cast<int>(previous);
  next_check_ = static_cast<int>(next_check);
  last_size_ = static_cast<int>(last_size);
  last_converged_ = static_cast<std::size_t>(last_converged);
  eps_->its = static_cast<PetscInt>(iterations);
  noise_ = static_cast<std::uint64_t>(noise);
  return true;
}

// Between two steps: saves where a rank wished it. True if one wants to stop.
bool Iteration::keep() {
  if (keeper_ == nullptr || !(wish_.stop || wish_.save)) return false;
  LanczosState state;
  state.sizes = {block_,     room_,
                 size_,      width_,
                 previous_,  next_check_,
                 last_size_, static_cast<std::int64_t>(last_converged_),
                 eps_->its,  static_cast<std::int64_t>(noise_)};
  for (int j = 0; j < size_; ++j) state.t.insert(state.t.end(), &t(0, j), &t(0, j) + size_);
  keeper_->save(state, basis_.part(0, size_));
  keeper_->was_stopped = wish_.stop;
  wish_ = {};
  return keeper_->was_stopped;
}

// The first block: the initial space and random vectors, once through the operator, which damps what is far from the shift.
void Iteration::start() {
  for (PetscInt j = eps_->nini; j < block_; ++j) check(BVSetRandomColumn(eps_->V, j));
  open_basis();
  place(0);
  multiply_mass();
  invert(0);
  size_ = width_ = previous_ = 0;
  Small alpha;
  project(true, alpha);
  Small r;
  next_width_ = orthonormalise(r);
  size_ = width_ = next_width_;
  previous_ = 0;
}

// w -= (everything so far) (everything so far)^T M w, after the recurrence has taken the bulk away; where little is predicted to be left,
// only the blocks that the recurrence couples to. alpha: (width, width) the diagonal block.
void Iteration::project(bool is_first, Small& alpha) {
  const Columns next = w_.part(0, is_first ? block_ : width_);
  const Columns next_mass = z_.part(0, next.count);
  if (!is_first) {
    // z still is M times the current block.
    alpha = sum_products(next_mass, next);
    const int coupled = size_ - previous_;
    Small local(static_cast<std::size_t>(coupled) * static_cast<std::size_t>(width_));
    for (int j = 0; j < width_; ++j) {
      double* column = local.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(coupled);
      for (int i = 0; i < coupled - width_; ++i) column[i] = t(previous_ + i, size_ - width_ + j);
      std::copy_n(alpha.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(width_), width_, column + coupled - width_);
    }
    subtract_product(basis_.part(previous_, coupled), local.data(), coupled, next);
  }
  is_spared_ = false;
  lossy_ = locked_orthogonality_.get_all();
  if (!is_first) {
    is_spared_ = orthogonality_.is_good(get_state(), alpha.data());
    lossy_ = locked_orthogonality_.find_lossy(get_state(), alpha.data());
    agree(is_spared_, lossy_);
  }
  const Columns against = is_spared_ ? basis_.part(previous_, size_ - previous_) : everything_.part(0, fixed_.count + size_);
  const int stride = against.count + next.count;  // w follows them in memory, and its squares come with the products
  for (int pass = 0; pass < 3; ++pass) {
    multiply_mass();
    const Small c = sum_products_and_wishes(against.part(0, stride), next_mass);
    const Small parts = clear_of_locked(lossy_, next, next_mass);
    if (pass == 0 && !is_first) locked_orthogonality_.learn(lossy_, parts.data(), next.count);
    if (is_spared_ && fixed_.count > 0) subtract_product(fixed_, sum_products(fixed_, next_mass).data(), fixed_.count, next);
    subtract_product(against, c.data(), stride, next);
    if (pass == 0 && !is_first && !is_spared_) orthogonality_.learn(get_state(), c.data() + fixed_.count, stride);
    double taken = 0;  // largest part of a column that this pass took away; its rounding is what it leaves behind
    double largest = 0;
    for (int j = 0; j < next.count; ++j) {
      const double* column = c.data() + static_cast<std::ptrdiff_t>(j) * stride;
      if (!is_first) {
        for (int i = 0; i < width_; ++i) alpha[static_cast<std::size_t>(j * width_ + i)] += column[against.count - width_ + i];
      }
      const double part = std::inner_product(column, column + against.count, column, 0.0);
      taken = std::max(taken, part / column[against.count + j]);
      largest = std::max(largest, part);
    }
    if (!is_spared_) orthogonality_.clear(std::sqrt(largest));
    orthogonality_.put_back(locked_orthogonality_.calc_returned(lossy_, parts, next.count));
    if (taken < kTaken) break;
  }
}

// The first rank's opinion.
bool Iteration::agree(bool opinion) const {
  int value = opinion ? 1 : 0;
  MPI_Bcast(&value, 1, MPI_INT, 0, comm_);
  return value != 0;
}

void Iteration::agree(bool& is_spared, LockedRange& lossy) const {
  std::array<int, 3> opinion{is_spared ? 1 : 0, lossy.first, lossy.count};
  MPI_Bcast(opinion.data(), 3, MPI_INT, 0, comm_);
  is_spared = opinion[0] != 0;
  lossy = {opinion[1], opinion[2]};
}

// block <- block - L (L^T M block) for a range of L; returns what was in the brackets.
Small Iteration::clear_of_locked(LockedRange range, const Columns& block, const Columns& block_mass) const {
  if (range.count == 0) return {};
  Small parts = locked_.multiply_transposed(comm_, range, block_mass);
  locked_.subtract_product(range, parts, block);
  return parts;
}

// Makes the columns of w M-orthonormal: w <- w R^-1, z <- M w. Returns how many are left; fewer than there were when the space is
// exhausted. r: (returned, as many as there were).
int Iteration::orthonormalise(Small& r) {
  const int count = size_ == 0 ? block_ : width_;
  multiply_mass();
  r.assign(static_cast<std::size_t>(count) * static_cast<std::size_t>(count), 0.0);
  for (int i = 0; i < count; ++i) r[static_cast<std::size_t>(i * count + i)] = 1;
  if (size_ + count <= eps_->n - fixed_.count - locked_.count() && orthonormalise_by_cholesky(r)) return count;
  return orthonormalise_by_columns(r);
}

bool Iteration::orthonormalise_by_cholesky(Small& r) {
  const int count = size_ == 0 ? block_ : width_;
  const auto n = static_cast<std::size_t>(count);
  const Columns w = w_.part(0, count);
  const Columns z = z_.part(0, count);
  Small total = r;
  for (int pass = 0; pass < 3; ++pass) {
    Small gram = sum_products(w, z);
    std::vector<double> scale(n);
    for (std::size_t i = 0; i < n; ++i) {
      scale[i] = std::sqrt(gram[i * n + i]);
      if (!(scale[i] > 0) || !std::isfinite(scale[i])) return false;
    }
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t i = 0; i < n; ++i) gram[j * n + i] /= scale[i] * scale[j];
    }
    PetscBLASInt size = count;
    PetscBLASInt info = 0;
    LAPACKpotrf_("U", &size, gram.data(), &size, &info);
    if (info != 0) return false;
    double smallest = 1;
    for (std::size_t i = 0; i < n; ++i) smallest = std::min(smallest, gram[i * n + i] * gram[i * n + i]);
    if (pass == 0 && smallest < kDependent) return false;
    Small inverse(n * n, 0.0);
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t i = 0; i <= j; ++i) inverse[j * n + i] = gram[j * n + i] *= scale[j];
      for (std::size_t i = j + 1; i < n; ++i) gram[j * n + i] = 0;
    }
    dtrtri_("U", "N", &size, inverse.data(), &size, &info);
    if (info != 0) return false;
    combine_columns(w, inverse.data(), count);
    combine_columns(z, inverse.data(), count);
    Small product(n * n, 0.0);
    double one = 1;
    double zero = 0;
    BLASgemm_("N", "N", &size, &size, &size, &one, gram.data(), &size, total.data(), &size, &zero, product.data(), &size);
    total = product;
    if (smallest > kWellConditioned) break;
  }
  r = total;
  return true;
}

// Column i of w against the basis, the deflated vectors and the columns before it, twice; coefficients (i) of the last. Its M-norm, zero if
// next to nothing is left.
double Iteration::orthogonalise_column(int i, double* coefficients) {
  const Columns all = everything_.part(0, fixed_.count + size_);
  const Columns column = w_.part(i, 1);
  const Columns image = z_.part(i, 1);
  multiply_mass();
  const double before = std::sqrt(sum_products(column, image)[0]);
  for (int pass = 0; pass < 2; ++pass) {
    if (pass > 0) multiply_mass();
    (void)clear_of_locked(locked_orthogonality_.get_all(), column, image);
    subtract_product(all, sum_products(all, image).data(), all.count, column);
    if (i > 0) {
      const Small c = sum_products(w_.part(0, i), image);
      subtract_product(w_.part(0, i), c.data(), i, column);
      for (int k = 0; k < i; ++k) coefficients[k] += c[static_cast<std::size_t>(k)];
    }
  }
  multiply_mass();
  const double after = std::sqrt(std::max(sum_products(column, image)[0], 0.0));
  if (!(after > kDependent * before)) return 0;
  for (std::ptrdiff_t row = 0; row < column.rows; ++row) column.values[row] /= after;
  return after;
}

int Iteration::orthonormalise_by_columns(Small& r) {
  const int count = size_ == 0 ? block_ : width_;
  const auto left = static_cast<int>(std::min<PetscInt>(count, eps_->n - fixed_.count - locked_.count() - size_));
  PetscInt first_row = 0;
  check(MatGetOwnershipRange(w_mat_, &first_row, nullptr));
  double scale = 0;  // of the operator on the block: what is small beside it is rounding
  for (int j = 0; j < count; ++j) scale = std::max(scale, std::sqrt(std::max(sum_products(w_.part(j, 1), z_.part(j, 1))[0], 0.0)));
  Small full(static_cast<std::size_t>(count) * static_cast<std::size_t>(count), 0.0);
  int kept = 0;
  for (int j = 0; j < count && kept < left; ++j) {
    if (kept != j) std::copy_n(w_.column(j), w_.rows, w_.column(kept));
    double* column = full.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(count);
    const double norm = orthogonalise_column(kept, column);
    if (norm > kDependent * scale) {
      column[kept++] = norm;
      continue;
    }
    for (int attempt = 0; attempt < 3; ++attempt) {
      ++noise_;
      for (std::ptrdiff_t row = 0; row < w_.rows; ++row)
        w_.column(kept)[row] = petsc::make_noise(noise_, static_cast<std::uint64_t>(first_row + row));
      Small ignored(static_cast<std::size_t>(count), 0.0);
      if (orthogonalise_column(kept, ignored.data()) > 0) {
        ++kept;
        break;
      }
    }
  }
  multiply_mass();
  r.assign(static_cast<std::size_t>(kept) * static_cast<std::size_t>(count), 0.0);
  for (int j = 0; j < count; ++j) {
    for (int i = 0; i < kept; ++i) r[static_cast<std::size_t>(j * kept + i)] = full[static_cast<std::size_t>(j * count + i)];
  }
  return kept;
}

// The projection that a step was spared, or another two passes, of the block that came of it. What they take away is rounding beside the
// operator.
void Iteration::project_after_all() {
  is_spared_ = false;
  orthogonality_.clear(0);
  orthogonality_.put_back(0);
  lossy_ = locked_orthogonality_.get_all();
  const Columns next = w_.part(0, width_);
  const Columns next_mass = z_.part(0, width_);
  const Columns all = everything_.part(0, fixed_.count + size_);
  for (int pass = 0; pass < 2; ++pass) {
    multiply_mass();
    (void)clear_of_locked(lossy_, next, next_mass);
    subtract_product(all, sum_products(all, next_mass).data(), all.count, next);
  }
  const Small before = coupling_;  // (width, width)
  Small r;
  next_width_ = orthonormalise(r);
  const auto n = static_cast<std::size_t>(width_);
  const auto kept = static_cast<std::size_t>(next_width_);
  coupling_.assign(kept * n, 0.0);
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t i = 0; i < kept; ++i) coupling_[j * kept + i] += r[k * kept + i] * before[j * n + k];
    }
  }
}

// One block more. False when the space is exhausted.
bool Iteration::step() {
  invert(size_);
  Small alpha;
  project(false, alpha);
  for (int j = 0; j < width_; ++j) {
    for (int i = 0; i < width_; ++i) {
      t(size_ - width_ + i, size_ - width_ + j) =
          0.5 * (alpha[static_cast<std::size_t>(j * width_ + i)] + alpha[static_cast<std::size_t>(i * width_ + j)]);
    }
  }
  next_width_ = orthonormalise(coupling_);
  if (next_width_ == width_) {
    const bool is_good = orthogonality_.is_still_good(get_state(), coupling_, next_width_, is_spared_) &&
                         locked_orthogonality_.is_still_good(get_state(), coupling_, next_width_);
    if (!agree(is_good)) project_after_all();
  }
  orthogonality_.advance(get_state(), coupling_, next_width_, is_spared_);
  locked_orthogonality_.advance(get_state(), coupling_, next_width_, lossy_);
  for (int j = next_width_; j < block_; ++j) {
    std::fill_n(w_.column(j), w_.rows, 0.0);
    std::fill_n(z_.column(j), z_.rows, 0.0);
  }
  return next_width_ > 0;
}

Iteration::Ritz Iteration::calc_ritz() {
  Ritz ritz;
  const auto n = static_cast<std::size_t>(size_);
  ritz.theta.assign(n, 0.0);
  int rank = 0;
  MPI_Comm_rank(comm_, &rank);
  Small last(static_cast<std::size_t>(width_) * n, 0.0);
  int failed = 0;
  if (rank == 0) {  // One rank calculates and the others take its bits: decisions must be the same everywhere.
    ritz.vectors.resize(n * n);
    for (int j = 0; j < size_; ++j) {
      for (int i = 0; i < size_; ++i) ritz.vectors[static_cast<std::size_t>(j) * n + static_cast<std::size_t>(i)] = t(i, j);
    }
    PetscBLASInt size = size_;
    PetscBLASInt info = 0;
    PetscBLASInt work_size = 1 + 6 * size + 2 * size * size;
    PetscBLASInt integers = 3 + 5 * size;
    Small work(static_cast<std::size_t>(work_size));
    std::vector<PetscBLASInt> integer_work(static_cast<std::size_t>(integers));
    dsyevd_("V", "L", &size, ritz.vectors.data(), &size, ritz.theta.data(), work.data(), &work_size, integer_work.data(), &integers, &info);
    failed = info;
    petsc::add_flops(kEigenFlops * static_cast<double>(size) * size * size);
    for (std::size_t i = 0; i < n; ++i)
      std::copy_n(ritz.vectors.data() + i * n + n - static_cast<std::size_t>(width_), width_,
                  last.data() + i * static_cast<std::size_t>(width_));
  }
  MPI_Bcast(&failed, 1, MPI_INT, 0, comm_);
  if (failed != 0) check(PETSC_ERR_LIB);
  MPI_Bcast(ritz.theta.data(), size_, MPI_DOUBLE, 0, comm_);
  MPI_Bcast(last.data(), static_cast<int>(last.size()), MPI_DOUBLE, 0, comm_);
  ritz.error.assign(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    double square = 0;
    for (int k = 0; k < next_width_; ++k) {
      double sum = 0;
      for (int j = 0; j < width_; ++j)
        sum += coupling_[static_cast<std::size_t>(j * next_width_ + k)] *
               last[i * static_cast<std::size_t>(width_) + static_cast<std::size_t>(j)];
      square += sum * sum;
    }
    ritz.error[i] = std::sqrt(square);  // so far the residual
  }
  calc_errors(ritz);
  return ritz;
}

// From residuals to what the convergence test makes of them, the order of the wanted ones, and whether they are all there.
void Iteration::calc_errors(Ritz& ritz) const {
  const std::size_t n = ritz.theta.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double theta = ritz.theta[i];
    const double residual = ritz.error[i];
    PetscReal error = 0;
    check((*eps_->converged)(eps_, theta, 0, residual, &error, eps_->convergedctx));
    double gap = std::numeric_limits<double>::infinity();
    for (std::size_t k = i; k > 0; --k) {
      gap = theta - ritz.theta[k - 1];
      if (gap > kSame * std::abs(theta)) break;
    }
    for (std::size_t k = i + 1; k < n; ++k) {
      if (ritz.theta[k] - theta <= kSame * std::abs(theta)) continue;
      gap = std::min(gap, ritz.theta[k] - theta);
      break;
    }
    const double allowed = std::max(kAngle * gap, kSmallest * std::abs(theta));
    ritz.error[i] = std::max(error, residual / allowed * eps_->tol);
  }
  Small lambda = ritz.theta;
  Small imaginary(n, 0.0);
  check(STBackTransform(eps_->st, static_cast<PetscInt>(n), lambda.data(), imaginary.data()));
  choose_wanted(ritz, lambda);
}

void Iteration::choose_wanted(Ritz& ritz, const Small& lambda) const {
  const std::size_t n = lambda.size();
  ritz.order.resize(n);
  std::iota(ritz.order.begin(), ritz.order.end(), 0);
  const auto is_converged = [&](int i) { return ritz.error[static_cast<std::size_t>(i)] <= eps_->tol; };
  const auto wanted = static_cast<std::size_t>(eps_->nev);
  if (eps_->which != EPS_ALL) {
    std::stable_sort(ritz.order.begin(), ritz.order.end(), [&](int a, int b) {
      PetscInt result = 0;
      check((*eps_->sc->comparison)(lambda[static_cast<std::size_t>(a)], 0, lambda[static_cast<std::size_t>(b)], 0, &result,
                                    eps_->sc->comparisonctx));
      return result < 0;
    });
    ritz.converged = static_cast<std::size_t>(std::find_if_not(ritz.order.begin(), ritz.order.end(), is_converged) - ritz.order.begin());
    ritz.done = ritz.converged >= wanted;
    return;
  }
  const auto is_inside = [&](int i) {
    const double x = lambda[static_cast<std::size_t>(i)];
    return x >= eps_->inta && x <= eps_->intb;
  };
  // Converged ones of the interval, the others of the interval, those beyond it by their nearness to the shift.
  const auto rank = [&](int i) { return is_inside(i) ? (is_converged(i) ? 0 : 1) : 2; };
  std::stable_sort(ritz.order.begin(), ritz.order.end(), [&](int a, int b) {
    if (rank(a) != rank(b)) return rank(a) < rank(b);
    return rank(a) == 2 && std::abs(ritz.theta[static_cast<std::size_t>(a)]) > std::abs(ritz.theta[static_cast<std::size_t>(b)]);
  });
  ritz.converged = static_cast<std::size_t>(std::count_if(ritz.order.begin(), ritz.order.end(), [&](int i) { return rank(i) == 0; }));
  const auto inside = static_cast<std::size_t>(std::count_if(ritz.order.begin(), ritz.order.end(), is_inside));
  // The iteration has seen past the interval when something beyond its farther end has settled.
  PetscScalar sigma = 0;
  check(STGetShift(eps_->st, &sigma));
  const double reach = std::max(eps_->intb - sigma, sigma - eps_->inta);
  const bool sees_past = std::any_of(ritz.order.begin(), ritz.order.end(), [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    return !is_inside(i) && std::abs(lambda[at] - sigma) > reach && ritz.error[at] <= kSeen;
  });
  const bool has_all = get_settings(eps_).knows_count == PETSC_TRUE && ritz.converged >= wanted;
  ritz.done = has_all || (inside == ritz.converged && sees_past);
}

void Iteration::share_vectors(Ritz& ritz) const {
  ritz.vectors.resize(ritz.theta.size() * ritz.theta.size());
  MPI_Bcast(ritz.vectors.data(), static_cast<int>(ritz.vectors.size()), MPI_DOUBLE, 0, comm_);
}

Small Iteration::pick_vectors(const Ritz& ritz, std::size_t count) const {
  const std::size_t n = ritz.theta.size();
  Small picked(n * count);
  for (std::size_t j = 0; j < count; ++j)
    std::copy_n(ritz.vectors.data() + static_cast<std::size_t>(ritz.order[j]) * n, n, picked.data() + j * n);
  return picked;
}

// The next look at the Ritz pairs: when the wanted ones should be there, going by how they came so far.
void Iteration::plan_check(const Ritz& ritz) {
  const auto wanted = static_cast<double>(eps_->nev);
  const auto converged = static_cast<double>(ritz.converged);
  double ahead = 4.0 * block_;
  if (ritz.converged > last_converged_) {
    const double rate = (converged - static_cast<double>(last_converged_)) / (size_ - last_size_);
    ahead = std::min(ahead, (wanted - converged) / rate * 0.7);
  }
  last_converged_ = ritz.converged;
  last_size_ = size_;
  next_check_ = size_ + std::max(2 * block_, static_cast<int>(ahead));
}

bool Iteration::report(const Ritz& ritz) {
  const std::size_t n = ritz.theta.size();
  eps_->nconv = static_cast<PetscInt>(std::min(ritz.converged, n));
  for (std::size_t j = 0; j < n; ++j) {
    eps_->eigr[j] = ritz.theta[static_cast<std::size_t>(ritz.order[j])];
    eps_->eigi[j] = 0;
    eps_->errest[j] = ritz.error[static_cast<std::size_t>(ritz.order[j])];
  }
  const PetscInt nev = eps_->which == EPS_ALL && !ritz.done ? std::max(eps_->nev, eps_->nconv + 1) : eps_->nev;
  check((*eps_->stopping)(eps_, eps_->its, eps_->max_it, eps_->nconv, nev, &eps_->reason, eps_->stoppingctx));
  if (eps_->reason == EPS_CONVERGED_ITERATING && ritz.done) eps_->reason = EPS_CONVERGED_TOL;
  check(EPSMonitor(eps_, eps_->its, eps_->nconv, eps_->eigr, eps_->eigi, eps_->errest, static_cast<PetscInt>(n)));
  return eps_->reason != EPS_CONVERGED_ITERATING;
}

// Keeps the best Ritz vectors; the next block follows them.
void Iteration::restart(Ritz& ritz) {
  share_vectors(ritz);
  const int most = size_ - 2 * block_;
  const int kept =
      std::clamp(std::max(static_cast<int>(ritz.converged) + block_, (static_cast<int>(eps_->nev) + size_) / 2), 1, std::max(most, 1));
  const auto n = static_cast<std::size_t>(size_);
  const Small picked = pick_vectors(ritz, static_cast<std::size_t>(kept));
  combine_columns(basis_.part(0, size_), picked.data(), kept);
  Small coupling(static_cast<std::size_t>(next_width_) * static_cast<std::size_t>(kept), 0.0);
  for (int j = 0; j < kept; ++j) {
    const double* last = picked.data() + static_cast<std::size_t>(j) * n + n - static_cast<std::size_t>(width_);
    for (int k = 0; k < next_width_; ++k) {
      for (int i = 0; i < width_; ++i)
        coupling[static_cast<std::size_t>(j * next_width_ + k)] += coupling_[static_cast<std::size_t>(i * next_width_ + k)] * last[i];
    }
  }
  std::fill(t_.begin(), t_.end(), 0.0);
  for (int j = 0; j < kept; ++j) t(j, j) = ritz.theta[static_cast<std::size_t>(ritz.order[static_cast<std::size_t>(j)])];
  coupling_ = coupling;
  for (int j = 0; j < next_width_; ++j) std::copy_n(w_.column(j), w_.rows, basis_.column(kept + j));
  size_ = width_ = kept;
  last_size_ = size_;
  orthogonality_.forget();
  locked_orthogonality_.forget();
}

// The Ritz vectors once through the operator, y + V_next R s / theta, which costs next to nothing as V_next is at hand: what is left of
// frequencies far above the shift, small in the M norm and large in the residual of K, is gone.
void Iteration::finish(Ritz& ritz) {
  share_vectors(ritz);
  const auto count = static_cast<std::size_t>(eps_->nconv);
  const Small picked = pick_vectors(ritz, count);
  const int extra = next_width_;
  const auto n = static_cast<std::size_t>(size_);
  const std::size_t all = n + static_cast<std::size_t>(extra);
  Small purified(all * count, 0.0);
  for (std::size_t j = 0; j < count; ++j) {
    const double* from = picked.data() + j * n;
    double* to = purified.data() + j * all;
    std::copy_n(from, n, to);
    const double theta = ritz.theta[static_cast<std::size_t>(ritz.order[j])];
    for (int k = 0; k < extra; ++k) {
      for (int i = 0; i < width_; ++i)
        to[n + static_cast<std::size_t>(k)] +=
            coupling_[static_cast<std::size_t>(i * next_width_ + k)] * from[n - static_cast<std::size_t>(width_ - i)] / theta;
    }
  }
  combine_columns(basis_.part(0, static_cast<int>(all)), purified.data(), static_cast<int>(count));
  place(static_cast<int>(count));  // to work in
  clear_nearest(ritz, static_cast<int>(count));
  clear_locked(static_cast<int>(count));
  // The room behind what was found, before that is copied.
  if (basis_.rows > 0) petsc::give_back_pages(basis_.column(static_cast<int>(count)), basis_.column(room_ + block_));
  close_basis();
}

// What a spared projection leaves standing is rounding along the pairs nearest the shift, by their large theta. These are the most exact
// ones, so it is the others that are made orthogonal to them, block by block.
void Iteration::clear_nearest(const Ritz& ritz, int count) {
  std::vector<int> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  const auto theta = [&](int j) { return std::abs(ritz.theta[static_cast<std::size_t>(ritz.order[static_cast<std::size_t>(j)])]); };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return theta(a) > theta(b); });
  const Columns found = basis_.part(0, count);
  for (int first = 0; first < std::min(count, kNearest); first += block_) {
    const int width = std::min(block_, count - first);
    const Columns nearest = w_.part(0, width);
    for (int j = 0; j < width; ++j) std::copy_n(found.column(order[static_cast<std::size_t>(first + j)]), w_.rows, nearest.column(j));
    multiply_mass();
    Small products = sum_products(z_.part(0, width), found);
    for (int place = 0; place < std::min(first + width, count); ++place) {  // Nearer ones stay as they are.
      double* column = products.data() + static_cast<std::ptrdiff_t>(order[static_cast<std::size_t>(place)]) * width;
      std::fill(column + std::max(place - first, 0), column + width, 0.0);
    }
    subtract_product(nearest, products.data(), width, found);
  }
}

// What remained of locked modes.
void Iteration::clear_locked(int count) {
  const std::vector<double>& left = locked_orthogonality_.get_left();
  const auto is_left = [](double x) { return x > kLeft; };
  const auto first = std::find_if(left.begin(), left.end(), is_left);
  const auto last = std::find_if(left.rbegin(), std::make_reverse_iterator(first), is_left).base();
  const LockedRange range{static_cast<int>(first - left.begin()), static_cast<int>(last - first)};
  if (range.count == 0) return;
  const int wide = std::min(room_ - count, kWide);  // of the columns behind w, which are free now
  const int step = std::max(wide, block_);
  for (int at = 0; at < count; at += step) {
    const Columns some = basis_.part(at, std::min(step, count - at));
    const Columns images = wide < block_ ? z_.part(0, some.count) : basis_.part(count + block_, some.count);
    for (int from = 0; from < some.count; from += block_) {
      const int width = std::min(block_, some.count - from);
      for (int j = 0; j < width; ++j) std::copy_n(some.column(from + j), some.rows, w_.column(j));
      multiply_mass();
      if (wide < block_) continue;
      for (int j = 0; j < width; ++j) std::copy_n(z_.column(j), some.rows, images.column(from + j));
    }
    (void)clear_of_locked(range, some, images);
  }
}

void Iteration::run() {
  bool is_resumed = false;
  if (keeper_ != nullptr && keeper_->start != nullptr) {
    open_basis();
    is_resumed = go_on();
    if (!is_resumed) close_basis();
  }
  if (!is_resumed) start();
  if (width_ == 0) {  // nothing beside what is deflated
    eps_->nconv = 0;
    eps_->reason = EPS_CONVERGED_TOL;
    return close_basis();
  }
  if (!is_resumed) next_check_ = std::min(2 * static_cast<int>(eps_->nev) + 2 * block_, room_);
  while (true) {
    const bool goes_on = step();
    ++eps_->its;
    const bool is_full = size_ + next_width_ > room_;
    if (!goes_on || is_full || size_ >= next_check_ || eps_->its >= eps_->max_it) {
      Ritz ritz = calc_ritz();
      if (!goes_on) ritz.done = true;
      if (report(ritz)) return finish(ritz);
      if (is_full) restart(ritz);
      plan_check(ritz);
    }
    for (int j = 0; j < width_; ++j) {
      for (int i = 0; i < next_width_; ++i) {
        t(size_ + i, size_ - width_ + j) = t(size_ - width_ + j, size_ + i) = coupling_[static_cast<std::size_t>(j * next_width_ + i)];
      }
    }
    previous_ = size_ - width_;
    size_ += next_width_;
    width_ = next_width_;
    if (keep()) {
      eps_->nconv = 0;
      eps_->reason = EPS_CONVERGED_USER;
      return close_basis();
    }
  }
}

// ---- what SLEPc calls.

PetscErrorCode set_up(EPS eps) {
  EPSCheckHermitianDefinite(eps);
  EPSCheckSinvert(eps);
  EPSCheckUnsupported(eps,
                      EPS_FEATURE_ARBITRARY | EPS_FEATURE_REGION | EPS_FEATURE_EXTRACTION | EPS_FEATURE_TWOSIDED | EPS_FEATURE_BALANCE);
  return guard([&] {
    Settings& settings = get_settings(eps);
    if (settings.block == PETSC_DEFAULT) settings.block = kDefaultBlock;
    if (eps->which == 0) eps->which = EPS_TARGET_MAGNITUDE;
    if (eps->ncv == PETSC_DEFAULT) eps->ncv = std::min(eps->n, 2 * eps->nev + 8 * settings.block);
    eps->ncv = std::min(eps->n, std::max(eps->ncv, std::min(eps->n, eps->nev + 3 * settings.block)));
    if (eps->mpd == PETSC_DEFAULT) eps->mpd = eps->ncv;
    if (eps->max_it == PETSC_DEFAULT) eps->max_it = std::max<PetscInt>(200, 20 * eps->ncv / settings.block);
    check(EPSAllocateSolution(eps, settings.block));  // One block more: the residuals', for the purification.
    check(EPS_SetInnerProduct(eps));
  });
}

PetscErrorCode set_up_sort(EPS eps) {
  switch (eps->which) {
    case EPS_LARGEST_MAGNITUDE:
      eps->sc->comparison = SlepcCompareLargestMagnitude;
      break;
    case EPS_SMALLEST_MAGNITUDE:
      eps->sc->comparison = SlepcCompareSmallestMagnitude;
      break;
    case EPS_LARGEST_REAL:
      eps->sc->comparison = SlepcCompareLargestReal;
      break;
    case EPS_TARGET_MAGNITUDE:
      eps->sc->comparison = SlepcCompareTargetMagnitude;
      break;
    case EPS_TARGET_REAL:
      eps->sc->comparison = SlepcCompareTargetReal;
      break;
    default:
      eps->sc->comparison = SlepcCompareSmallestReal;
  }
  eps->sc->comparisonctx = &eps->target;
  eps->sc->map = nullptr;
  eps->sc->mapobj = nullptr;
  return 0;
}

PetscErrorCode solve(EPS eps) {
  return guard([&] { Iteration(eps).run(); });
}

PetscErrorCode transform_back(EPS eps) { return STBackTransform(eps->st, eps->nconv, eps->eigr, eps->eigi); }

PetscErrorCode set_from_options(EPS eps, PetscOptionItems* PetscOptionsObject) {
  PetscOptionsHeadBegin(PetscOptionsObject, "EPS block Lanczos options");
  Settings& settings = get_settings(eps);
  PetscInt block = settings.block;
  PetscCall(PetscOptionsInt("-eps_blocklanczos_block_size", "Columns per block", "set_block_size", block, &block, nullptr));
  PetscOptionsHeadEnd();
  return set_block_size(eps, block);
}

PetscErrorCode view_settings(EPS eps, PetscViewer viewer) {
  return PetscViewerASCIIPrintf(viewer, "  block Lanczos: blocks of %d columns, basis of %d\n", static_cast<int>(get_settings(eps).block),
                                static_cast<int>(eps->ncv));
}

PetscErrorCode destroy(EPS eps) {
  delete static_cast<Settings*>(eps->data);
  eps->data = nullptr;
  return 0;
}

PetscErrorCode set_default_transformation(EPS eps) {
  const char* type = nullptr;
  PetscCall(STGetType(eps->st, &type));
  if (type == nullptr) PetscCall(STSetType(eps->st, STSINVERT));
  return 0;
}

PetscErrorCode create(EPS eps) {
  eps->data = new Settings;
  eps->useds = PETSC_FALSE;
  eps->categ = EPS_CATEGORY_KRYLOV;
  eps->ops->solve = solve;
  eps->ops->setup = set_up;
  eps->ops->setupsort = set_up_sort;
  eps->ops->setfromoptions = set_from_options;
  eps->ops->destroy = destroy;
  eps->ops->view = view_settings;
  eps->ops->backtransform = transform_back;
  eps->ops->setdefaultst = set_default_transformation;
  return 0;
}

}  // namespace

std::vector<double> LockedModes::multiply_transposed(MPI_Comm comm, LockedRange range, const Columns& b) const {
  std::vector<double> products(static_cast<std::size_t>(range.count) * static_cast<std::size_t>(b.count), 0.0);
  for_parts(range, [&](const Columns& part, int at) { eigen::multiply_transposed(part, b, products.data() + at, range.count); });
  MPI_Allreduce(MPI_IN_PLACE, products.data(), static_cast<int>(products.size()), MPI_DOUBLE, MPI_SUM, comm);
  return products;
}

void LockedModes::subtract_product(LockedRange range, const std::vector<double>& s, const Columns& b) const {
  for_parts(range, [&](const Columns& part, int at) { eigen::subtract_product(part, s.data() + at, range.count, b); });
}

// visit(columns, where they are in the range) for every set that has some.
template <class Visit>
void LockedModes::for_parts(LockedRange range, const Visit& visit) const {
  int at = 0;  // first column of the set
  for (const Columns& set : sets) {
    const int from = std::max(range.first, at);
    const int to = std::min(range.first + range.count, at + set.count);
    if (from < to) visit(set.part(from - at, to - from), from - range.first);
    at += set.count;
  }
}

PetscErrorCode register_block_lanczos() { return EPSRegister(kBlockLanczosType, create); }

PetscErrorCode set_block_size(EPS eps, PetscInt columns) {
  PetscBool is_ours = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), kBlockLanczosType, &is_ours));
  if (is_ours == PETSC_FALSE) return 0;
  if (columns != PETSC_DEFAULT && columns < 1)
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "blocks of %d columns", static_cast<int>(columns));
  get_settings(eps).block = columns;
  eps->state = EPS_STATE_INITIAL;
  return 0;
}

PetscErrorCode set_count_known(EPS eps, PetscBool known) {
  PetscBool is_ours = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), kBlockLanczosType, &is_ours));
  if (is_ours == PETSC_TRUE) get_settings(eps).knows_count = known;
  return 0;
}

PetscErrorCode set_locked(EPS eps, const LockedModes* locked) {
  PetscBool is_ours = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), kBlockLanczosType, &is_ours));
  if (is_ours == PETSC_TRUE) get_settings(eps).locked = locked;
  return 0;
}

PetscErrorCode set_keeper(EPS eps, LanczosKeeper* keeper) {
  PetscBool is_ours = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), kBlockLanczosType, &is_ours));
  if (is_ours == PETSC_TRUE) get_settings(eps).keeper = keeper;
  return 0;
}

}  // namespace carillon::eigen
