// Method: bodies in joint coordinates; mass matrix, Jacobians and accelerations by Simbody's recursive operators without forming matrices:
// accelerations cost O(n). Free motion by Merson's Runge-Kutta method of fourth order with its error estimate; the work of the damping is
// an additional component. The response of all members to an impulse on one is J M^-1 J^T, six columns per impacted member.
// Source: A. Jain, "Robot and multibody dynamics" (2011), spatial operators; M. Sherman, A. Seth, S. Delp, "Simbody: multibody dynamics for
// biomedical research" (2011); E. Hairer, G. Wanner, "Solving ordinary differential equations I" (1993), II.4, Merson.
#include "runtime/physics/joints/engine.hpp"

#include <SimTKsimbody.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace carillon::joints {
namespace {

using SimTK::MobilizedBody;
using SimTK::SpatialVec;
using SimTK::Stage;

SimTK::Vec3 to_simtk(const Vec3& v) { return SimTK::Vec3(v[0], v[1], v[2]); }
Vec3 from_simtk(const SimTK::Vec3& v) { return Vec3{{v[0], v[1], v[2]}}; }
SimTK::Rotation to_rotation(const Quaternion& q) { return SimTK::Rotation(SimTK::Quaternion(q[0], q[1], q[2], q[3])); }

/// Frame of a joint in the world: its axis as in Simbody's joint of that kind.
SimTK::Rotation find_axes(const Joint& joint) {
  switch (joint.kind) {
    case Kind::kHinge:
      return SimTK::Rotation(SimTK::UnitVec3(to_simtk(joint.axis)), SimTK::ZAxis);
    case Kind::kSlider:
      return SimTK::Rotation(SimTK::UnitVec3(to_simtk(joint.axis)), SimTK::XAxis);
    case Kind::kUniversal:
      return SimTK::Rotation(SimTK::UnitVec3(to_simtk(joint.axis)), SimTK::XAxis, to_simtk(joint.second_axis), SimTK::YAxis);
    default:
      return SimTK::Rotation();
  }
}

constexpr double kShortest = 1e-9;  // s; with shorter steps the integration has failed

class Tree final : public Mechanism {
 public:
  Tree(const std::vector<Member>& members, const std::vector<Joint>& joints, const Vec3& gravity)
      : matter_(system_), bodies_(members.size()) {
    matter_.setShowDefaultGeometry(false);
    build(members, joints);
    state_ = system_.realizeTopology();
    system_.realizeModel(state_);
    damping_.assign(state_.getNU(), 0.0);
    for (const Damped& d : damped_) {
      const MobilizedBody& body = matter_.getMobilizedBody(d.body);
      for (int k = 0; k < body.getNumU(state_); ++k) damping_[static_cast<std::size_t>(body.getFirstUIndex(state_)) + k] = d.damping;
    }
    weights_.resize(matter_.getNumBodies());
    weights_.setToZero();
    for (std::size_t i = 0; i < members.size(); ++i) weights_[bodies_[i]][1] = members[i].mass_kg * to_simtk(gravity);
    start(members);
  }

  int count_members() const override { return static_cast<int>(bodies_.size()); }
  int count_freedoms() const override { return static_cast<int>(start_.u.size()); }
  const Coordinates& get_start() const override { return start_; }
  double get_start_error() const override { return start_error_; }

  Coordinates fly(const Coordinates& from, double time_s, double tolerance) override {
    Coordinates now = from;
    const std::size_t nq = now.q.size(), nu = now.u.size(), n = nq + nu + 1;
    if (time_s == 0.0 || nu == 0) return now;
    x_.resize(n);
    std::copy(now.q.begin(), now.q.end(), x_.begin());
    std::copy(now.u.begin(), now.u.end(), x_.begin() + static_cast<std::ptrdiff_t>(nq));
    x_[n - 1] = now.lost_j;
    const double sign = time_s > 0.0 ? 1.0 : -1.0, whole = std::abs(time_s);
    double done = 0.0, wished = now.step_s > 0.0 ? now.step_s : whole;
    bool has_first = false;
    while (whole - done > 1e-15 * whole) {
      const double left = whole - done, length = wished >= left ? left : wished >= 0.5 * left ? 0.5 * left : wished, h = sign * length;
      if (!has_first) calc_rates(x_, k1_);
      has_first = true;
      combine(h / 3.0, k1_, 0.0, k1_, 0.0, k1_, k2_);
      combine(h / 6.0, k1_, h / 6.0, k2_, 0.0, k1_, k3_);
      combine(h / 8.0, k1_, 3.0 * h / 8.0, k3_, 0.0, k1_, k4_);
      combine(h / 2.0, k1_, -1.5 * h, k3_, 2.0 * h, k4_, k5_);
      double error = 0.0;
      for (std::size_t i = 0; i + 1 < n; ++i) {
        const double e = length / 30.0 * std::abs(2.0 * k1_[i] - 9.0 * k3_[i] + 8.0 * k4_[i] - k5_[i]);
        error = std::max(error, i < nq ? e : length * e);
      }
      if (!std::isfinite(error)) throw std::runtime_error("motion of the mechanism is not finite");
      const double change = std::clamp(0.9 * std::pow(tolerance / std::max(error, 1e-30), 0.2), 0.2, 4.0);
      if (error > tolerance) {
        wished = length * std::min(change, 0.9);
        if (wished < kShortest) throw std::runtime_error("motion of the mechanism cannot be integrated: step length too small");
        continue;
      }
      for (std::size_t i = 0; i < n; ++i) x_[i] += h / 6.0 * (k1_[i] + 4.0 * k4_[i] + k5_[i]);
      normalise();
      done += length;
      has_first = false;
      if (length * change > wished || length == wished) wished = length * change;
    }
    std::copy(x_.begin(), x_.begin() + static_cast<std::ptrdiff_t>(nq), now.q.begin());
    std::copy(x_.begin() + static_cast<std::ptrdiff_t>(nq), x_.begin() + static_cast<std::ptrdiff_t>(nq + nu), now.u.begin());
    now.lost_j = x_[n - 1];
    now.step_s = wished;
    return now;
  }

  void find_motions(const Coordinates& at, std::vector<Motion>& out) override {
    set(at, Stage::Velocity);
    out.resize(bodies_.size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const MobilizedBody& body = matter_.getMobilizedBody(bodies_[i]);
      const SpatialVec& velocity = body.getBodyVelocity(state_);
      const SimTK::Quaternion rotation = body.getBodyRotation(state_).convertRotationToQuaternion();
      out[i] = {from_simtk(body.getBodyOriginLocation(state_)), from_simtk(velocity[1]),
                Quaternion{{rotation[0], rotation[1], rotation[2], rotation[3]}}, from_simtk(velocity[0])};
    }
  }

  void find_accelerations(const Coordinates& at, std::vector<Spatial>& out) override {
    set(at, Stage::Velocity);
    (void)calc_accelerations();
    matter_.calcBodyAccelerationFromUDot(state_, rates_, body_rates_);
    out.resize(bodies_.size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const SpatialVec& a = body_rates_[bodies_[i]];
      out[i] = {from_simtk(a[1]), from_simtk(a[0])};
    }
  }

  std::vector<double> calc_mobility(const Coordinates& at, int member) override {
    set(at, Stage::Position);
    const std::size_t n = bodies_.size();
    std::vector<double> mobility(36 * n);
    SimTK::Vector_<SpatialVec> impulses(matter_.getNumBodies(), SpatialVec(SimTK::Vec3(0))), velocities;
    SimTK::Vector f, du;
    for (int column = 0; column < 6; ++column) {
      SpatialVec& on = impulses[bodies_[member]];
      on = SpatialVec(SimTK::Vec3(0));
      on[column < 3 ? 1 : 0][column % 3] = 1.0;
      matter_.multiplyBySystemJacobianTranspose(state_, impulses, f);
      matter_.multiplyByMInv(state_, f, du);
      matter_.multiplyBySystemJacobian(state_, du, velocities);
      for (std::size_t i = 0; i < n; ++i) {
        const SpatialVec& v = velocities[bodies_[i]];
        for (int row = 0; row < 6; ++row)
          mobility[6 * (6 * i + static_cast<std::size_t>(row)) + static_cast<std::size_t>(column)] = v[row < 3 ? 1 : 0][row % 3];
      }
    }
    return mobility;
  }

  std::vector<double> calc_push(const Coordinates& at, const std::vector<Spatial>& impulses) override {
    set(at, Stage::Position);
    SimTK::Vector_<SpatialVec> all(matter_.getNumBodies(), SpatialVec(SimTK::Vec3(0)));
    for (std::size_t i = 0; i < bodies_.size(); ++i)
      all[bodies_[i]] = SpatialVec(to_simtk(impulses[i].angular), to_simtk(impulses[i].linear));
    SimTK::Vector f, du;
    matter_.multiplyBySystemJacobianTranspose(state_, all, f);
    matter_.multiplyByMInv(state_, f, du);
    return to_list(du);
  }

  Coordinates move(const Coordinates& from, const std::vector<double>& du, double part, double time_s) override {
    Coordinates to = from;
    for (std::size_t i = 0; i < to.u.size(); ++i) to.u[i] += part * du[i];
    if (time_s == 0.0) return to;
    set(from, Stage::Position);
    SimTK::Vector u(static_cast<int>(du.size())), dq;
    for (std::size_t i = 0; i < du.size(); ++i) u[static_cast<int>(i)] = du[i];
    matter_.multiplyByN(state_, false, u, dq);
    for (std::size_t i = 0; i < to.q.size(); ++i) to.q[i] += time_s * dq[static_cast<int>(i)];
    for (std::size_t i = 0; i < to.q.size(); ++i) state_.updQ()[static_cast<int>(i)] = to.q[i];
    matter_.normalizeQuaternions(state_);
    for (std::size_t i = 0; i < to.q.size(); ++i) to.q[i] = state_.getQ()[static_cast<int>(i)];
    return to;
  }

 private:
  struct Damped {
    SimTK::MobilizedBodyIndex body;
    double damping;
  };

  /// Builds the tree from the world outwards.
  void build(const std::vector<Member>& members, const std::vector<Joint>& joints) {
    std::vector<char> placed(members.size(), 0), used(joints.size(), 0);
    const auto get_pose = [&](int member) {
      if (member < 0) return SimTK::Transform();
      const Motion& m = members[member].start;
      return SimTK::Transform(to_rotation(m.rotation), to_simtk(m.centre));
    };
    const auto make_body = [&](int member) {
      const Member& m = members[member];
      const Mat3& i = m.inertia_kg_m2;
      return SimTK::Body::Rigid(
          SimTK::MassProperties(m.mass_kg, SimTK::Vec3(0), SimTK::Inertia(i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2])));
    };
    const auto add = [&](int member, SimTK::MobilizedBodyIndex index) {
      bodies_[member] = index;
      placed[member] = 1;
    };
    const bool hangs = std::any_of(joints.begin(), joints.end(), [](const Joint& j) { return j.to < 0 || j.body < 0; });
    if (!hangs && !members.empty()) {
      MobilizedBody::Free body(matter_.Ground(), get_pose(0), make_body(0), SimTK::Transform());
      add(0, body.getMobilizedBodyIndex());
    }
    for (std::size_t left = joints.size(); left > 0;) {
      const std::size_t before = left;
      for (std::size_t j = 0; j < joints.size(); ++j) {
        if (used[j]) continue;
        const Joint& joint = joints[j];
        const auto is_placed = [&](int member) { return member < 0 || placed[member]; };
        const bool has_body = is_placed(joint.body), has_to = is_placed(joint.to);
        if (has_body && has_to) throw std::invalid_argument("joints close a loop");
        if (!has_body && !has_to) continue;
        used[j] = 1;
        --left;
        // A joint reached from its other end is reversed: its axes are those of the start, and Simbody reverses it.
        const int outer = has_to ? joint.body : joint.to, inner = has_to ? joint.to : joint.body;
        const SimTK::Transform frame(find_axes(joint), to_simtk(joint.at));
        const SimTK::Transform in = ~get_pose(inner) * frame, out = ~get_pose(outer) * frame;
        MobilizedBody& parent = inner < 0 ? static_cast<MobilizedBody&>(matter_.updGround()) : matter_.updMobilizedBody(bodies_[inner]);
        const auto way = has_to ? MobilizedBody::Forward : MobilizedBody::Reverse;
        const SimTK::Body::Rigid body = make_body(outer);
        SimTK::MobilizedBodyIndex index;
        switch (joint.kind) {
          case Kind::kWeld:
            index = MobilizedBody::Weld(parent, in, body, out).getMobilizedBodyIndex();
            break;
          case Kind::kHinge:
            index = MobilizedBody::Pin(parent, in, body, out, way).getMobilizedBodyIndex();
            break;
          case Kind::kSlider:
            index = MobilizedBody::Slider(parent, in, body, out, way).getMobilizedBodyIndex();
            break;
          case Kind::kUniversal:
            index = MobilizedBody::Universal(parent, in, body, out, way).getMobilizedBodyIndex();
            break;
          case Kind::kBall:
            index = MobilizedBody::Ball(parent, in, body, out, way).getMobilizedBodyIndex();
            break;
        }
        add(outer, index);
        if (joint.damping > 0.0) damped_.push_back({index, joint.damping});
      }
      if (left == before) throw std::invalid_argument("members are not connected by joints");
    }
    if (std::find(placed.begin(), placed.end(), 0) != placed.end()) throw std::invalid_argument("members are not connected by joints");
  }

  /// Velocities permitted by the joints, nearest to the given ones by the kinetic energy of the difference.
  void start(const std::vector<Member>& members) {
    start_.q = to_list(state_.getQ());
    start_.u.assign(state_.getNU(), 0.0);
    std::vector<Spatial> momenta;
    for (const Member& m : members) {
      const SimTK::Rotation r = to_rotation(m.start.rotation);
      const Mat3& i = m.inertia_kg_m2;
      const SimTK::Mat33 inertia(i[0][0], i[0][1], i[0][2], i[1][0], i[1][1], i[1][2], i[2][0], i[2][1], i[2][2]);
      const SimTK::Vec3 spin = ~r * to_simtk(m.start.spin);
      momenta.push_back({m.mass_kg * m.start.velocity, from_simtk(r * (inertia * spin))});
    }
    start_.u = calc_push(start_, momenta);
    std::vector<Motion> motions;
    find_motions(start_, motions);
    for (std::size_t i = 0; i < members.size(); ++i) {
      const SimTK::Vec3 v = to_simtk(motions[i].velocity - members[i].start.velocity),
                        w = to_simtk(motions[i].spin - members[i].start.spin);
      const double gyration = std::sqrt((members[i].inertia_kg_m2[0][0] + members[i].inertia_kg_m2[1][1] + members[i].inertia_kg_m2[2][2]) /
                                        (2.0 * members[i].mass_kg));
      start_error_ = std::max(start_error_, std::max(v.norm(), gyration * w.norm()));
    }
  }

  void set(const Coordinates& at, Stage stage) {
    SimTK::Vector &q = state_.updQ(), &u = state_.updU();
    for (std::size_t i = 0; i < at.q.size(); ++i) q[static_cast<int>(i)] = at.q[i];
    for (std::size_t i = 0; i < at.u.size(); ++i) u[static_cast<int>(i)] = at.u[i];
    system_.realize(state_, stage);
  }

  /// Derivatives q', u' and the power of the damping.
  void calc_rates(const std::vector<double>& x, std::vector<double>& k) {
    SimTK::Vector &q = state_.updQ(), &u = state_.updU();
    const std::size_t nq = static_cast<std::size_t>(q.size()), nu = u.size();
    for (std::size_t i = 0; i < nq; ++i) q[static_cast<int>(i)] = x[i];
    for (std::size_t i = 0; i < nu; ++i) u[static_cast<int>(i)] = x[nq + i];
    system_.realize(state_, Stage::Velocity);
    const double power = calc_accelerations();
    const SimTK::Vector& qdot = state_.getQDot();
    k.resize(nq + nu + 1);
    for (std::size_t i = 0; i < nq; ++i) k[i] = qdot[static_cast<int>(i)];
    for (std::size_t i = 0; i < nu; ++i) k[nq + i] = rates_[static_cast<int>(i)];
    k[nq + nu] = power;
  }

  /// Accelerations by gravity and damping. Returns the power of the damping.
  double calc_accelerations() {
    const SimTK::Vector& u = state_.getU();
    mobility_forces_.resize(u.size());
    double power = 0.0;
    for (int i = 0; i < u.size(); ++i) {
      const double damping = damping_[i];
      mobility_forces_[i] = -damping * u[i];
      power += damping * u[i] * u[i];
    }
    // M u' = forces - bias; bias by recursive Newton-Euler.
    matter_.calcResidualForceIgnoringConstraints(state_, mobility_forces_, weights_, SimTK::Vector(), residual_);
    matter_.multiplyByMInv(state_, -residual_, rates_);
    return power;
  }

  void combine(double a, const std::vector<double>& ka, double b, const std::vector<double>& kb, double c, const std::vector<double>& kc,
               std::vector<double>& out) {
    y_.resize(x_.size());
    for (std::size_t i = 0; i < x_.size(); ++i) y_[i] = x_[i] + a * ka[i] + b * kb[i] + c * kc[i];
    calc_rates(y_, out);
  }

  void normalise() {
    SimTK::Vector& q = state_.updQ();
    for (int i = 0; i < q.size(); ++i) q[i] = x_[i];
    matter_.normalizeQuaternions(state_);
    for (int i = 0; i < state_.getNQ(); ++i) x_[i] = state_.getQ()[i];
  }

  static std::vector<double> to_list(const SimTK::Vector& v) {
    std::vector<double> list(v.size());
    for (int i = 0; i < v.size(); ++i) list[i] = v[i];
    return list;
  }

  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  std::vector<SimTK::MobilizedBodyIndex> bodies_;
  std::vector<Damped> damped_;
  std::vector<double> damping_;
  SimTK::State state_;
  Coordinates start_;
  double start_error_ = 0.0;
  std::vector<double> x_, y_, k1_, k2_, k3_, k4_, k5_;
  SimTK::Vector mobility_forces_, residual_, rates_;
  SimTK::Vector_<SpatialVec> weights_, body_rates_;
};

}  // namespace
}  // namespace carillon::joints

extern "C" __attribute__((visibility("default"))) carillon::joints::Mechanism* carillon_make_mechanism_1(
    const std::vector<carillon::joints::Member>& members, const std::vector<carillon::joints::Joint>& joints,
    const carillon::Vec3& gravity) {
  return new carillon::joints::Tree(members, joints, gravity);
}
