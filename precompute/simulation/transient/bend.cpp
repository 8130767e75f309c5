// Method: tangent stiffness by five-point force differences (exact for solids), perturbing many nodes without common neighbours at once
//   (Curtis, Powell and Reid); Newton's method for equilibrium, with load steps if it does not converge; subspace iteration with a negative
//   shift for modes; sparse L D L^T.
// Source: Curtis, Powell and Reid 1974; Bathe 1996, 8.4 and 11.6; docs/equations.md E11.
#include "precompute/simulation/transient/bend.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <limits>

#include "precompute/simulation/transient/vectors.hpp"
#include "runtime/base/chance.hpp"
#include "runtime/base/error.hpp"

namespace carillon::transient {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Vector = Eigen::VectorXd;

constexpr double kDifferenceRatio = 1e-3;  // over the shortest edge, or rad
constexpr int kNewtonSteps = 25;
constexpr double kConvergedRatio = 1e-9, kRounding = 1e-5;  // correction over displacement: convergence, and rounding level
constexpr double kMinLoadStep = 1e-3;                       // smallest load step over the load
// Relative to the highest stiffness over mass: first shift of modes, and rounding error of rigid modes.
constexpr double kFirstShift = 1e-6, kRigidShare = 1e-12;
constexpr double kShiftOfMode = 0.3;  // over a mode's eigenvalue: limits the rounding errors of rigid modes

double& get_component(Quad& q, int axis) { return axis == 0 ? q.x : axis == 1 ? q.y : q.z; }

/// Degrees of freedom, and the tangent stiffness about any shape.
class Tangent {
 public:
  Tangent(Domain& domain, const std::vector<HeldNode>& held) : domain_(domain) {
    const Assembly& assembly = domain.get_assembly();
    const std::size_t nodes = assembly.node_count();
    held_.assign(nodes, 0);
    for (const HeldNode& one : held) held_[one.node] = 1;
    first_.assign(nodes, -1);
    axes_.assign(nodes, 0);
    for (std::size_t n = 0; n < nodes; ++n) {
      const auto node = static_cast<std::int32_t>(n);
      const Assembly::Body& body = assembly.bodies[assembly.find_body_of_node(node)];
      const bool is_angle = body.is_sheet && node - body.first_node < body.sheet.vertices + body.sheet.edges;
      axes_[n] = assembly.is_point(node) ? 3 : is_angle ? 1 : 0;
      if (axes_[n] == 0 || held_[n] != 0) continue;
      first_[n] = freedoms_;
      freedoms_ += axes_[n];
    }
    std::vector<std::vector<std::int32_t>> elements(nodes);
    near_.resize(nodes);
    for (std::int32_t e = 0; e < assembly.element_count(); ++e)
      for (const std::int32_t node : assembly.find_nodes(e))
        if (node >= 0) elements[node].push_back(e);
    for (std::size_t n = 0; n < nodes; ++n) {
      for (const std::int32_t e : elements[n])
        for (const std::int32_t other : assembly.find_nodes(e)) {
          if (other < 0) continue;
          near_[n].push_back(other);
          const double length = norm(assembly.nodes_m[n] - assembly.nodes_m[other]);
          if (length > 0.0 && axes_[n] == 3 && axes_[other] == 3) edge_m_ = std::min(edge_m_, length);
        }
      std::sort(near_[n].begin(), near_[n].end());
      near_[n].erase(std::unique(near_[n].begin(), near_[n].end()), near_[n].end());
    }
    colour();
  }

  int count_freedoms() const { return freedoms_; }
  bool is_held(std::size_t node) const { return held_[node] != 0; }

  /// (free) elastic forces at u.
  Vector calc_forces(const std::vector<Quad>& u) {
    force_.resize(domain_.force_count());
    domain_.set_elastic_forces(u.data(), force_.data());
    return gather(force_);
  }
  Vector gather(std::vector<Quad>& values) const {
    Vector all(freedoms_);
    for_each_free([&](std::size_t n, int axis, int freedom) { all[freedom] = get_component(values[n], axis); });
    return all;
  }
  void add(const Vector& by, std::vector<Quad>& u) const {
    for_each_free([&](std::size_t n, int axis, int freedom) { get_component(u[n], axis) += by[freedom]; });
  }

  /// K about u [N/m], and K times the displacements `moved` of the held nodes.
  Sparse calc(const std::vector<Quad>& u, const std::vector<Quad>& moved, Vector& pull) {
    std::vector<Eigen::Triplet<double>> entries;
    pull = Vector::Zero(freedoms_);
    std::vector<Quad> trial = u;
    std::vector<Vec3> slope(u.size());
    force_.resize(domain_.force_count());
    for (const std::vector<std::int32_t>& together : colours_)
      for (int axis = 0; axis < axes_[together[0]]; ++axis) {
        const double by = axes_[together[0]] == 3 ? kDifferenceRatio * edge_m_ : kDifferenceRatio;
        std::fill(slope.begin(), slope.end(), Vec3{});
        for (const auto& [places, weight] : {std::pair{1.0, 8.0}, {-1.0, -8.0}, {2.0, -1.0}, {-2.0, 1.0}}) {
          for (const std::int32_t node : together)
            get_component(trial[node], axis) = get_component(const_cast<Quad&>(u[node]), axis) + places * by;
          domain_.set_elastic_forces(trial.data(), force_.data());
          for (std::size_t n = 0; n < slope.size(); ++n) slope[n] = slope[n] + (weight / (12.0 * by)) * to_vector(force_[n]);
        }
        for (const std::int32_t node : together) {
          const std::size_t column = node;
          trial[column] = u[column];
          for (const std::int32_t other : near_[column]) {
            const std::size_t row = other;
            if (first_[row] < 0) continue;
            for (int k = 0; k < axes_[row]; ++k) {
              const double stiffness = -slope[row][k];
              if (first_[column] >= 0)
                entries.emplace_back(first_[row] + k, first_[column] + axis, stiffness);
              else
                pull[first_[row] + k] += stiffness * get_component(const_cast<Quad&>(moved[column]), axis);
            }
          }
        }
      }
    Sparse k(freedoms_, freedoms_);
    k.setFromTriplets(entries.begin(), entries.end());
    return 0.5 * (k + Sparse(k.transpose()));
  }

  template <typename Work>
  void for_each_free(Work&& work) const {
    for (std::size_t n = 0; n < first_.size(); ++n)
      for (int axis = 0; first_[n] >= 0 && axis < axes_[n]; ++axis) work(n, axis, first_[n] + axis);
  }

 private:
  /// Colours: nodes of one colour have no common neighbours, and equal numbers of axes.
  void colour() {
    std::vector<std::int32_t> of(near_.size(), -1), used;
    std::vector<int> axes_of;
    for (std::size_t n = 0; n < near_.size(); ++n) {
      if (axes_[n] == 0) continue;
      used.assign(colours_.size(), 0);
      for (const std::int32_t first : near_[n])
        for (const std::int32_t second : near_[first])
          if (const std::int32_t taken = of[second]; taken >= 0) used[taken] = 1;
      std::size_t own = 0;
      while (own < colours_.size() && (used[own] != 0 || axes_of[own] != axes_[n])) ++own;
      if (own == colours_.size()) {
        colours_.emplace_back();
        axes_of.push_back(axes_[n]);
      }
      of[n] = static_cast<std::int32_t>(own);
      colours_[own].push_back(static_cast<std::int32_t>(n));
    }
  }

  Domain& domain_;
  int freedoms_ = 0;
  double edge_m_ = std::numeric_limits<double>::infinity();
  std::vector<char> held_;
  std::vector<int> first_, axes_;
  std::vector<std::vector<std::int32_t>> near_, colours_;
  std::vector<Quad> force_;
};

double find_largest(const Domain& domain, const std::vector<Quad>& u) {
  double most = 0.0;
  for (std::size_t n = 0; n < u.size(); ++n)
    if (domain.is_point(static_cast<std::int32_t>(n))) most = std::max(most, std::hypot(u[n].x, u[n].y, u[n].z));
  return most;
}

/// Newton's method for the equilibrium under `load`, from u, with displacements `moved` of held nodes; false: no convergence.
bool find_balance(Domain& domain, Tangent& tangent, const Vector& load, std::vector<Quad> moved, std::vector<Quad>& u) {
  const double extent = [&] {
    Vec3 low = domain.get_rest_m()[0], high = low;
    for (const Vec3& x : domain.get_rest_m())
      for (std::size_t axis = 0; axis < 3; ++axis) low[axis] = std::min(low[axis], x[axis]), high[axis] = std::max(high[axis], x[axis]);
    return norm(high - low);
  }();
  if (tangent.count_freedoms() == 0) {
    for (std::size_t n = 0; n < u.size(); ++n) u[n] = {u[n].x + moved[n].x, u[n].y + moved[n].y, u[n].z + moved[n].z, 0.0};
    return true;
  }
  double last = std::numeric_limits<double>::infinity();
  for (int step = 0; step < kNewtonSteps; ++step) {
    Vector pull;
    const Sparse k = tangent.calc(u, moved, pull);
    const Eigen::SimplicialLDLT<Sparse> factor(k);
    if (factor.info() != Eigen::Success) return false;
    const Vector by = factor.solve(load + tangent.calc_forces(u) - pull);
    std::vector<Quad> change(u.size());
    tangent.add(by, change);
    tangent.add(by, u);
    for (std::size_t n = 0; n < u.size(); ++n) u[n] = {u[n].x + moved[n].x, u[n].y + moved[n].y, u[n].z + moved[n].z, 0.0};
    std::fill(moved.begin(), moved.end(), Quad{});
    const double corrected = find_largest(domain, change), all = find_largest(domain, u);
    if (!(corrected < 10.0 * extent)) return false;
    if (corrected <= kConvergedRatio * all || (corrected <= kRounding * all && corrected >= 0.5 * last)) {
      const Domain::State state = domain.calc_state(u.data());
      return std::all_of(state.least_det.begin(), state.least_det.end(), [](double det) { return det > 0.0; });
    }
    last = corrected;
  }
  return false;
}

}  // namespace

std::vector<Quad> calc_equilibrium(Domain& domain, const std::vector<HeldNode>& held, const std::vector<PulledNode>& pulled) {
  Tangent tangent(domain, held);
  std::vector<Quad> u(domain.node_count()), force(u.size());
  for (const PulledNode& one : pulled) {
    Quad& f = force[one.node];
    f = {f.x + one.force_n[0], f.y + one.force_n[1], f.z + one.force_n[2], 0.0};
  }
  const Vector load = tangent.gather(force);
  double done = 0.0, part = 1.0;
  while (done < 1.0) {
    const double target = std::min(1.0, done + part);
    std::vector<Quad> trial = u, moved(u.size());
    for (const HeldNode& one : held) {
      const Vec3 by = (target - done) * one.displacement_m;
      moved[one.node] = {by[0], by[1], by[2], 0.0};
    }
    if (find_balance(domain, tangent, target * load, moved, trial)) {
      u = std::move(trial);
      done = target;
      part *= 2.0;
      continue;
    }
    part *= 0.25;
    if (part < kMinLoadStep)
      throw InputError(
          fmt::format("the body finds no equilibrium beyond {:.3g} of its load: hold it, so that it cannot fly or turn away, or bend it "
                      "less",
                      done));
  }
  return u;
}

ElasticMode calc_mode(Domain& domain, const std::vector<HeldNode>& held, int number) {
  Tangent tangent(domain, held);
  std::vector<Quad> u(domain.node_count());
  Vector none;
  const Sparse k = tangent.calc(u, u, none);
  const int freedoms = tangent.count_freedoms();
  Vector mass(freedoms);
  tangent.for_each_free([&](std::size_t n, int, int freedom) { mass[freedom] = domain.get_masses_kg()[n]; });
  const double highest = freedoms > 0 ? k.diagonal().cwiseQuotient(mass).maxCoeff() : 0.0;
  double shift = kFirstShift * highest;
  constexpr int kRigid = 6, kMore = 6;
  const int width = std::min(freedoms, number + kRigid + kMore);
  const auto refuse = [&] {
    return InputError(fmt::format("the body has no mode {} that can be found; give a lower number, or a finer mesh", number));
  };
  if (width < 1) throw refuse();
  Eigen::SimplicialLDLT<Sparse> factor;
  const auto factorise = [&] {
    Sparse shifted = k;
    shifted.diagonal() += shift * mass;
    factor.compute(shifted);
    if (factor.info() != Eigen::Success) throw refuse();
  };
  factorise();
  Eigen::MatrixXd x(freedoms, width);
  std::uint64_t chance = 1;
  for (int j = 0; j < width; ++j)
    for (int i = 0; i < freedoms; ++i) x(i, j) = base::to_unit(base::draw(chance)) - 0.5;
  double last = -1.0;
  int settled = 0;
  constexpr int kRounds = 200;
  constexpr double kConverged = 1e-10, kRounded = 1e-14;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::MatrixXd force = mass.asDiagonal() * x;  // copied: solve() writes to x before reading all of it
    x = factor.solve(force);
    // Mass-orthonormalise the columns against rounding errors in their products.
    const Eigen::MatrixXd weighted = mass.cwiseSqrt().asDiagonal() * x;
    const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(weighted).householderQ() * Eigen::MatrixXd::Identity(freedoms, width);
    x = mass.cwiseSqrt().cwiseInverse().asDiagonal() * q;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> small(x.transpose() * (k * x));
    x = x * small.eigenvectors();
    int found = 0, elastic = 0;
    while (found < width && (elastic += small.eigenvalues()[found] > kRigidShare * highest ? 1 : 0) < number) ++found;
    if (found == width) throw refuse();
    const double value = small.eigenvalues()[found];
    if (shift > 2.0 * value) {
      shift = kShiftOfMode * value;
      factorise();
    } else if (std::abs(value - last) <= kConverged * value + kRounded * highest) {
      ++settled;
    } else {
      settled = 0;
    }
    last = value;
    if (settled < 2) continue;
    ElasticMode mode{std::sqrt(value), u};
    tangent.add(x.col(found), mode.shape);
    Vec3 far{};
    for (std::size_t n = 0; n < u.size(); ++n) {
      const Quad& at = mode.shape[n];
      if (domain.is_point(static_cast<std::int32_t>(n)) && std::hypot(at.x, at.y, at.z) > norm(far) * (1.0 + 1e-6))
        far = {at.x, at.y, at.z};
    }
    const double most = *std::max_element(far.begin(), far.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
    const double scale = (most < 0.0 ? -1.0 : 1.0) / norm(far);
    for (Quad& at : mode.shape) at = {scale * at.x, scale * at.y, scale * at.z, 0.0};
    return mode;
  }
  throw refuse();
}

}  // namespace carillon::transient
