// Method: augmented Lagrangian. With the residual r = w - J v of the active rows and a compliance eps,
//     (M + sum J^T J / eps) d = J^T r / eps,   lambda += (r - J d) / eps,   v = v_free + M^-1 J^T lambda,
// symmetric, positive definite and as sparse as the contact graph; iterated until r vanishes (3 to 5 times) with one factorisation. Rows
// are released and added by the signs of the solution. The cone is round; the direction of a sliding point follows by the secant method.
// Source: A. Enzenhoefer, N. Lefebvre, S. Andrews, "Efficient block pivoting for multibody simulations with contact" (2019): pivoting of
// blocks with a compliant system; factorisation by Eigen.
#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <type_traits>

#include "runtime/physics/rigid/solver.hpp"

namespace carillon::rigid {
namespace {

using Block = Eigen::Matrix<double, 6, 6>;
using Row6 = std::array<double, 6>;

constexpr double kComplianceRatio = 1e-3;       // relative to the mobility of a row: of one body,
constexpr double kMinComplianceRatio = 1e-5;    // lower bound,
constexpr double kPointComplianceRatio = 1e-6;  // of a single point, whose rows cannot conflict
constexpr double kSlidingRatio = 0.9999;        // fraction of the friction bound: slides
constexpr int kMaxCorrections = 12;             // iterations per guess,
constexpr double kResidualRatio = 1e-10;        // final residual relative to the wanted velocities,
constexpr double kStagnationRatio = 0.9;        // or ratio of consecutive residuals, if held points conflict
constexpr double kCoupleBoundRatio = 0.5;       // fraction of its bound: larger couples of the previous step are first guessed at the bound
constexpr double kMaxTurnRad = 0.5;             // rad; of the direction of sliding, per guess
constexpr int kMaxDenseBodies = 12;             // bodies; larger systems are factorised as sparse matrices

enum class Hold : char { kOpen, kSticks, kSlides };

Row6 make_row(const Vec3& linear, const Vec3& angular) { return {linear[0], linear[1], linear[2], angular[0], angular[1], angular[2]}; }

/// Normal velocity per normal impulse at a point [1/kg], of bodies without joints.
double calc_normal_mobility(const std::vector<Mover>& movers, const Point& p) {
  double mobility = 0.0;
  const auto add = [&](int body, const Vec3& arm) {
    if (body < 0) return;
    const Vec3 lever = cross(arm, p.normal);
    mobility += movers[body].inverse_mass + dot(lever, movers[body].inverse_inertia * lever);
  };
  add(p.a, p.arm_a);
  add(p.b, p.arm_b);
  return mobility;
}

/// Compliance of a row over its mobility. Soft enough for conflicts of 1e-9 m/s between rows (two touches of a rolling body), whose
/// impulses must stay in the cone; stiff enough for convergence of chains and unequal masses.
double choose_compliance(const std::vector<Mover>& movers, std::size_t points) {
  if (points == 1) return kPointComplianceRatio;
  const auto [least, most] =
      std::minmax_element(movers.begin(), movers.end(), [](const Mover& x, const Mover& y) { return x.inverse_mass < y.inverse_mass; });
  const auto count = static_cast<double>(movers.size());
  return std::max(kMinComplianceRatio, kComplianceRatio * least->inverse_mass / (most->inverse_mass * count * count));
}

/// Matrix of a guess: 6 x 6 blocks for touching bodies, lower triangle. Its pattern is the same for all guesses.
class System {
 public:
  System(int bodies, const std::vector<Point>& points) : bodies_(bodies) {
    if (is_dense()) {
      full_.resize(36 * bodies * bodies);
      return;
    }
    below_.resize(bodies);
    for (int i = 0; i < bodies; ++i) below_[i].push_back(i);
    for (const Point& p : points)
      if (p.a >= 0 && p.b >= 0 && p.a != p.b) below_[std::min(p.a, p.b)].push_back(std::max(p.a, p.b));
    std::vector<int> counts;
    for (std::vector<int>& rows : below_) {
      std::sort(rows.begin(), rows.end());
      rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
      counts.insert(counts.end(), 6, 6 * static_cast<int>(rows.size()));
    }
    sparse_.emplace();
    Eigen::SparseMatrix<double>& matrix = sparse_->matrix;
    matrix.resize(6 * bodies, 6 * bodies);
    matrix.reserve(counts);
    for (int column = 0; column < 6 * bodies; ++column)
      for (const int row : below_[column / 6])
        for (int i = 0; i < 6; ++i) matrix.insert(6 * row + i, column) = 0.0;
    matrix.makeCompressed();
    sparse_->solver.analyzePattern(matrix);
  }

  void clear() {
    if (is_dense())
      std::fill(full_.begin(), full_.end(), 0.0);
    else
      std::fill_n(sparse_->matrix.valuePtr(), sparse_->matrix.nonZeros(), 0.0);
  }
  void add_inertia(int body, double mass_kg, const Eigen::Matrix3d& inertia) {
    Block block = Block::Zero();
    block.topLeftCorner<3, 3>().diagonal().setConstant(mass_kg);
    block.bottomRightCorner<3, 3>() = inertia;
    at(body, body) += block;
  }
  /// Adds a row with the given stiffness.
  void add(int a, const Row6& ra, int b, const Row6& rb, double stiffness) {
    if (a >= 0) add_product(at(a, a), ra, ra, stiffness, true);
    if (b >= 0) add_product(at(b, b), rb, rb, stiffness, true);
    if (a < 0 || b < 0) return;
    if (a > b)
      add_product(at(a, b), ra, rb, stiffness, false);
    else
      add_product(at(b, a), rb, ra, stiffness, false);
  }

  bool factorise() {
    if (is_dense()) return factorise_dense();
    sparse_->solver.factorize(sparse_->matrix);
    return sparse_->solver.info() == Eigen::Success;
  }
  /// Replaces the right side by the solution.
  void solve(Eigen::VectorXd& right) const {
    if (is_dense())
      solve_dense(right.data());
    else
      right = sparse_->solver.solve(right);
  }

 private:
  using Place = Eigen::Map<Block, Eigen::Unaligned, Eigen::OuterStride<>>;

  bool is_dense() const { return bodies_ <= kMaxDenseBodies; }
  /// Adds stiffness x y^T to a block: its lower triangle, or all of it. By plain loops: Eigen takes twice as long for so few numbers.
  static void add_product(Place block, const Row6& x, const Row6& y, double stiffness, bool is_lower) {
    double* column = block.data();
    for (int j = 0; j < 6; ++j, column += block.outerStride())
      for (int i = is_lower ? j : 0; i < 6; ++i) column[i] += stiffness * x[i] * y[j];
  }
  /// The block (row, column), row >= column.
  Place at(int row, int column) {
    const int size = 6 * bodies_;
    if (is_dense()) return Place(&full_[6 * column * size + 6 * row], Eigen::OuterStride<>(size));
    const std::vector<int>& rows = below_[column];
    const auto slot = std::lower_bound(rows.begin(), rows.end(), row) - rows.begin();
    return Place(sparse_->matrix.valuePtr() + sparse_->matrix.outerIndexPtr()[6 * column] + 6 * slot,
                 Eigen::OuterStride<>(6 * static_cast<Eigen::Index>(rows.size())));
  }

  /// Passes the matrix size, as a compile-time constant for few bodies: several times as fast as a general library.
  template <typename Do>
  decltype(auto) with_size(Do&& act) const {
    if (bodies_ == 1) return act(std::integral_constant<int, 6>{});
    if (bodies_ == 2) return act(std::integral_constant<int, 12>{});
    return act(6 * bodies_);
  }

  /// L D L^T in place, by columns.
  bool factorise_dense() {
    return with_size([&](auto size) {
      for (int k = 0; k < size; ++k) {
        double* from = &full_[k * size];
        if (!(from[k] > 0.0)) return false;
        const double part = 1.0 / from[k];
        for (int j = k + 1; j < size; ++j) {
          const double factor = from[j] * part;
          double* to = &full_[j * size];
          for (int i = j; i < size; ++i) to[i] -= factor * from[i];
        }
        for (int i = k + 1; i < size; ++i) from[i] *= part;
      }
      return true;
    });
  }
  void solve_dense(double* x) const {
    with_size([&](auto size) {
      for (int k = 0; k < size; ++k)
        for (int i = k + 1; i < size; ++i) x[i] -= full_[k * size + i] * x[k];
      for (int k = size - 1; k >= 0; --k) {
        x[k] /= full_[k * size + k];
        for (int i = k + 1; i < size; ++i) x[k] -= full_[k * size + i] * x[i];
      }
    });
  }

  int bodies_;
  std::vector<std::vector<int>> below_;  // row indices of the blocks of each column
  std::vector<double> full_;
  struct Sparse {
    Eigen::SparseMatrix<double> matrix;
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver;
  };
  std::optional<Sparse> sparse_;  // none where dense: its construction costs as much as a small solution
};

/// Guess of the load-bearing, sticking and rolling points, and the resulting impulses.
class Guess {
 public:
  Guess(const std::vector<Mover>& free, const std::vector<Point>& points)
      : free_(free),
        points_(points),
        compliance_(choose_compliance(free, points.size())),
        system_(static_cast<int>(free.size()), points),
        right_(6 * static_cast<int>(free.size())) {
    held_.reserve(points.size());
    for (const Point& p : points) scale_ = std::max(scale_, norm(p.wanted - calc_relative_velocity(free, p)));
  }
  /// Adds the next point. Masses: impulse per velocity along the normal, couple per spin (0: none). `is_swept`: its impulse is a solution.
  void add(double normal_mass, double turning_mass, bool is_swept);
  /// Impulses under which all points move as guessed, and the resulting velocities. False if the system is singular.
  bool solve(std::vector<Mover>& movers);
  /// Corrects the guess from its solution; true if the solution confirms it. `may_stick`: sliding or rolling points may stick again.
  bool correct(const std::vector<Mover>& movers, bool may_stick);
  /// Writes the impulses to the points, and the velocities due to them alone.
  void read(std::vector<Mover>& movers, std::vector<Point>& points) const;

 private:
  struct Held {
    Hold hold = Hold::kOpen;
    bool rolls = false, twists = false;  // couple at its bound, perpendicular to the normal and about it
    double stiffness = 0.0, turning_mass = 0.0;
    std::array<Vec3, 3> axes{};
    Vec3 sliding{}, impulse{}, couple{};
    Vec3 left{}, left_spin{};                  // missing velocity and spin
    double last_angle = 0.0, last_turn = 0.0;  // of the sliding impulse in the preceding guess; turn 0: none
    /// Held part of a spin or couple.
    Vec3 hold_turning(const Vec3& turning) const {
      if (rolls && twists) return {};
      const Vec3 twist = dot(turning, axes[0]) * axes[0];
      return rolls ? twist : twists ? turning - twist : turning;
    }
    Vec3 free_turning(const Vec3& turning) const { return turning - hold_turning(turning); }
    double calc_angle(const Vec3& across) const { return std::atan2(dot(across, axes[2]), dot(across, axes[1])); }
    /// Turn of the sliding impulse towards the direction against its slip, by the secant method: halving alone diverges at small slip.
    double choose_turn(const Vec3& against_slip) {
      const double angle = calc_angle(sliding), left = std::remainder(calc_angle(against_slip) - angle, 2.0 * std::numbers::pi);
      const double moved = std::remainder(angle - last_angle, 2.0 * std::numbers::pi), change = left - last_turn;
      const bool has_secant = last_turn != 0.0 && moved != 0.0 && change != 0.0;
      last_angle = angle;
      last_turn = left;
      return has_secant ? std::clamp(-left * moved / change, -kMaxTurnRad, kMaxTurnRad) : 0.5 * left;
    }
    bool holds_turning(int axis) const { return turning_mass > 0.0 && !(axis == 0 ? twists : rolls); }
  };

  void assemble();
  bool factorise();
  void move(std::vector<Mover>& movers) const;
  double iterate(std::vector<Mover>& movers);
  Hold correct_hold(const std::vector<Mover>& movers, const Point& p, Held& held, bool may_stick, bool& confirmed);
  static Vec3 calc_rest_of_bound(const std::vector<Mover>& movers, const Point& p, const Held& held);
  bool correct_couple(const std::vector<Mover>& movers, const Point& p, Held& held, double push, bool may_stick);

  const std::vector<Mover>& free_;
  const std::vector<Point>& points_;
  double compliance_;
  std::vector<Held> held_;      // of the points
  bool is_factorised_ = false;  // for the current holds
  System system_;
  Eigen::VectorXd right_;  // work memory
  double scale_ = 0.0;     // m/s
};

void Guess::add(double normal_mass, double turning_mass, bool is_swept) {
  const Point& p = points_[held_.size()];
  Held& held = held_.emplace_back();
  held.stiffness = normal_mass / compliance_;
  held.turning_mass = turning_mass;
  const Vec3 tangent = find_across(p.normal);
  held.axes = {p.normal, tangent, cross(p.normal, tangent)};
  const double push = dot(p.impulse, p.normal);
  const Vec3 across = p.impulse - push * p.normal;
  const bool slides = is_swept && push > 0.0 && norm(across) >= kSlidingRatio * p.friction * push;
  if (slides) held.sliding = across;
  // A new open touch stays open unless it would close without impulses.
  const double wanted = dot(p.wanted, p.normal);
  const bool is_open = wanted < 0.0 && wanted <= dot(calc_relative_velocity(free_, p), p.normal);
  held.hold = slides ? Hold::kSlides : push > 0.0 || (p.impulse == Vec3{} && !is_open) ? Hold::kSticks : Hold::kOpen;
  if (turning_mass > 0.0 && push > 0.0) {  // as in the previous step, with the current bounds
    const double twist = dot(p.couple, p.normal), most = p.twisting_m * push;
    const Vec3 roll = p.couple - twist * p.normal;
    const double size = norm(roll), limit = p.rolling_m * push;
    held.twists = std::abs(twist) >= kCoupleBoundRatio * most;
    held.rolls = size >= kCoupleBoundRatio * limit;
    if (held.twists) held.couple = std::copysign(most, twist) * p.normal;
    if (held.rolls && size > 0.0) held.couple = held.couple + (limit / size) * roll;
  }
}

/// Assembles the matrix of the held points.
void Guess::assemble() {
  system_.clear();
  for (int i = 0; const Mover& m : free_) {
    Eigen::Matrix3d inverse;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) inverse(r, c) = m.inverse_inertia[r][c];
    system_.add_inertia(i++, 1.0 / m.inverse_mass, inverse.inverse());
  }
  for (int i = 0; const Held& held : held_) {
    const Point& p = points_[i++];
    if (held.hold == Hold::kOpen) continue;
    for (int k = 0; k < (held.hold == Hold::kSticks ? 3 : 1); ++k)
      system_.add(p.a, make_row(held.axes[k], cross(p.arm_a, held.axes[k])), p.b,
                  make_row(-1.0 * held.axes[k], cross(held.axes[k], p.arm_b)), held.stiffness);
    for (int k = 0; k < 3; ++k)
      if (held.holds_turning(k))
        system_.add(p.a, make_row({}, held.axes[k]), p.b, make_row({}, -1.0 * held.axes[k]), held.turning_mass / compliance_);
  }
}

/// New system for the current holds, from zero impulses.
bool Guess::factorise() {
  if (is_factorised_) return true;
  assemble();
  for (Held& held : held_) {
    held.impulse = held.hold == Hold::kSlides ? held.sliding : Vec3{};
    held.couple = held.hold == Hold::kOpen ? Vec3{} : held.free_turning(held.couple);
  }
  is_factorised_ = system_.factorise();
  return is_factorised_;
}

bool Guess::solve(std::vector<Mover>& movers) {
  if (!factorise()) return false;
  move(movers);
  double before = 0.0;
  for (int again = 0; again < kMaxCorrections; ++again) {
    const double left = iterate(movers), rate = before > 0.0 ? left / before : 0.0;
    if (left <= kResidualRatio * scale_ || (rate > 0.0 && rate * left <= kResidualRatio * scale_) || rate > kStagnationRatio) break;
    before = left;
  }
  return true;
}

/// Velocities due to all impulses.
void Guess::move(std::vector<Mover>& movers) const {
  movers = free_;
  for (int i = 0; const Held& held : held_) {
    const Point& p = points_[i++];
    if (held.impulse != Vec3{}) apply(movers, p, held.impulse);
    if (held.couple != Vec3{}) turn(movers, p, held.couple);
  }
}

/// One correction of the impulses; returns the preceding residual [m/s].
double Guess::iterate(std::vector<Mover>& movers) {
  right_.setZero();
  const auto add = [&](int body, int from, const Vec3& pull) {
    for (int k = 0; k < 3 && body >= 0; ++k) right_[6 * body + from + k] += pull[k];
  };
  double largest = 0.0;
  for (int i = 0; Held & held : held_) {
    const Point& p = points_[i++];
    if (held.hold == Hold::kOpen) continue;
    held.left = p.wanted - calc_relative_velocity(movers, p);
    if (held.hold == Hold::kSlides) held.left = dot(held.left, p.normal) * p.normal;
    largest = std::max(largest, norm(held.left));
    const Vec3 pull = held.stiffness * held.left;
    add(p.a, 0, pull);
    add(p.a, 3, cross(p.arm_a, pull));
    add(p.b, 0, -1.0 * pull);
    add(p.b, 3, cross(pull, p.arm_b));
    if (!(held.turning_mass > 0.0)) continue;
    held.left_spin = -1.0 * held.hold_turning(calc_relative_spin(movers, p));
    const Vec3 couple = (held.turning_mass / compliance_) * held.left_spin;
    add(p.a, 3, couple);
    add(p.b, 3, -1.0 * couple);
  }
  if (largest <= kResidualRatio * scale_) return largest;
  system_.solve(right_);
  const auto get = [&](int body, int from) {
    const double* x = right_.data() + 6 * body + from;
    return Vec3{x[0], x[1], x[2]};
  };
  for (int i = 0; Held & held : held_) {
    const Point& p = points_[i++];
    if (held.hold == Hold::kOpen) continue;
    Vec3 moved{}, turned{};
    if (p.a >= 0) moved = get(p.a, 0) + cross(get(p.a, 3), p.arm_a), turned = get(p.a, 3);
    if (p.b >= 0) moved = moved - get(p.b, 0) - cross(get(p.b, 3), p.arm_b), turned = turned - get(p.b, 3);
    if (held.hold == Hold::kSlides) moved = dot(moved, p.normal) * p.normal;
    const Vec3 more = held.stiffness * (held.left - moved);
    held.impulse = held.impulse + more;
    apply(movers, p, more);
    if (!(held.turning_mass > 0.0)) continue;
    const Vec3 couple =
        (held.turning_mass / compliance_) * (held.left_spin - held.hold_turning(turned)) + calc_rest_of_bound(movers, p, held);
    held.couple = held.couple + couple;
    turn(movers, p, couple);
  }
  return largest;
}

bool Guess::correct(const std::vector<Mover>& movers, bool may_stick) {
  bool confirmed = true;
  for (int i = 0; Held & held : held_) {
    const Point& p = points_[i++];
    const double push = dot(held.impulse, p.normal);
    const Hold now = correct_hold(movers, p, held, may_stick, confirmed);
    const bool carries = held.hold != Hold::kOpen || now != Hold::kOpen;
    if (carries && held.turning_mass > 0.0 && !correct_couple(movers, p, held, std::max(push, 0.0), may_stick)) confirmed = false;
    if (now != held.hold) confirmed = is_factorised_ = false;
    held.hold = now;
  }
  return confirmed;
}

/// Hold state required by the solution; impulses are projected onto the cone.
Hold Guess::correct_hold(const std::vector<Mover>& movers, const Point& p, Held& held, bool may_stick, bool& confirmed) {
  const double push = dot(held.impulse, p.normal), limit = p.friction * push;
  if (held.hold == Hold::kOpen)
    return dot(p.wanted - calc_relative_velocity(movers, p), p.normal) > 1e-9 * scale_ ? Hold::kSticks : Hold::kOpen;
  if (!(push > 0.0)) {
    held.impulse = {};
    return Hold::kOpen;
  }
  if (held.hold == Hold::kSticks) {
    const Vec3 across = held.impulse - push * p.normal;
    const double size = norm(across);
    if (!(size > limit)) return Hold::kSticks;
    held.sliding = (limit / size) * across;
    held.impulse = push * p.normal + held.sliding;
    held.last_turn = 0.0;
    return Hold::kSlides;
  }
  // Continues to slide against its velocity; sticks if that would no longer brake.
  const Vec3 short_of = p.wanted - calc_relative_velocity(movers, p);
  const Vec3 across = short_of - dot(short_of, p.normal) * p.normal;
  const double size = norm(across);
  if (dot(across, held.sliding) < 0.0 && may_stick) return Hold::kSticks;
  const double angle = held.calc_angle(held.sliding) + held.choose_turn(size > 0.0 ? across : held.sliding);
  const Vec3 turned = limit * (std::cos(angle) * held.axes[1] + std::sin(angle) * held.axes[2]);
  if (norm(turned - held.sliding) > 1e-3 * p.friction * push) confirmed = false;
  held.sliding = turned;
  held.impulse = push * p.normal + turned;
  return Hold::kSlides;
}

/// Remaining part of a couple at its bounds, for the current normal impulse and rolling direction.
Vec3 Guess::calc_rest_of_bound(const std::vector<Mover>& movers, const Point& p, const Held& held) {
  if (!held.rolls && !held.twists) return {};
  const double push = std::max(dot(held.impulse, p.normal), 0.0);
  const Vec3 next = held.couple - held.turning_mass * calc_relative_spin(movers, p);
  const Vec3 roll = next - dot(next, p.normal) * p.normal;
  const double size = norm(roll);
  const Vec3 bound =
      std::copysign(p.twisting_m * push, dot(held.couple, p.normal)) * p.normal + (size > 0.0 ? p.rolling_m * push / size : 0.0) * roll;
  return held.free_turning(bound - held.couple);
}

/// Releases a couple above its bounds, about the normal and perpendicular to it, and sets it to its bound against the current spin; holds
/// it again if a smaller couple stops the spin. True if nothing changed.
bool Guess::correct_couple(const std::vector<Mover>& movers, const Point& p, Held& held, double push, bool may_stick) {
  const Vec3 free_couple = held.couple - held.turning_mass * held.free_turning(calc_relative_spin(movers, p));
  double twist = dot(free_couple, p.normal);
  Vec3 roll = free_couple - twist * p.normal;
  bool stays = true;
  const auto correct = [&](bool& turns, double size, double limit) {
    const bool is_bound = size >= limit;
    if (turns != is_bound && (is_bound || may_stick)) turns = is_bound, stays = is_factorised_ = false;
    return is_bound && size > 0.0 ? limit / size : 1.0;
  };
  twist *= correct(held.twists, std::abs(twist), p.twisting_m * push);
  roll = correct(held.rolls, norm(roll), p.rolling_m * push) * roll;
  const Vec3 bounded = twist * p.normal + roll;
  if (norm(bounded - held.couple) > 1e-3 * (p.rolling_m + p.twisting_m) * push) stays = false;
  held.couple = bounded;
  return stays;
}

void Guess::read(std::vector<Mover>& movers, std::vector<Point>& points) const {
  move(movers);
  for (int i = 0; const Held& held : held_) {
    Point& p = points[i++];
    p.impulse = held.impulse;
    p.couple = held.couple;
  }
}

}  // namespace

bool Solver::solve_directly(std::vector<Mover>& movers, std::vector<Point>& points, int max_guesses, bool are_swept) {
  if (std::any_of(movers.begin(), movers.end(), [](const Mover& m) { return m.linkage != nullptr; })) return false;
  const std::vector<Mover> free = movers;
  Guess guess(free, points);
  for (const Point& p : points) guess.add(1.0 / calc_normal_mobility(movers, p), calc_turning_mass(movers, p), are_swept);
  bool confirmed = false;
  for (int n = 0; n < max_guesses && !confirmed; ++n) {
    if (!guess.solve(movers)) return false;
    confirmed = guess.correct(movers, n < max_guesses / 2);
  }
  guess.read(movers, points);
  return confirmed;
}

}  // namespace carillon::rigid
