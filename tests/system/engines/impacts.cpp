// Simbody's impacts: rigid contacts with restitution, by its time stepper.
#include <carillon/simbody.h>

#include <algorithm>
#include <stdexcept>

#include "tests/system/engines/engine.hpp"

namespace carillon::testing {
namespace {

using SimTK::Vec3;

constexpr double kStep = 1e-3;  // s, at most
constexpr double kGap = 1e-5;   // m; of a contact
const SimTK::UnitVec3 kUp(0, 0, 1);

Vec3 to_simbody(const double (&x)[3]) { return {x[0], x[1], x[2]}; }

/// Balls on each other and on the ground.
class Impacts : public Engine {
 public:
  Impacts(const std::vector<Solid>& solids, carillon_touches* touches) : reader_(system_, matter_, touches) {
    SimTK::Force::UniformGravity(forces_, matter_, Vec3(0, 0, -9.81));
    for (const Solid& solid : solids) {
      if (solid.kind != "ball") throw std::invalid_argument("Simbody's impacts are tested with balls: " + solid.name);
      const auto& i = solid.inertia_kg_m2;
      const SimTK::MassProperties mass(solid.mass_kg, Vec3(0), SimTK::Inertia(i[0], i[1], i[2]));
      SimTK::MobilizedBody::Free body(matter_.Ground(), SimTK::Transform(), SimTK::Body::Rigid(mass), SimTK::Transform());
      const auto index = static_cast<std::int32_t>(balls_.size());
      const double radius = solid.half_m[0];
      add({index, -1},
          new SimTK::SpherePlaneContact(matter_.Ground(), kUp, 0, body, Vec3(0), radius, kRestitution, kFriction, kFriction, 0));
      for (std::int32_t other = 0; other < index; ++other) {
        Ball& b = balls_[static_cast<std::size_t>(other)];
        add({index, other},
            new SimTK::SphereSphereContact(body, Vec3(0), radius, b.body, Vec3(0), b.radius, kRestitution, kFriction, kFriction, 0));
      }
      reader_.add(body.getMobilizedBodyIndex(), index);
      balls_.push_back({body, radius});
    }
    system_.realizeTopology();
    SimTK::State state = system_.getDefaultState();
    system_.realizeModel(state);
    for (std::size_t i = 0; i < solids.size(); ++i) {
      const auto& q = solids[i].rotation;
      const SimTK::Rotation turn(SimTK::Quaternion(q[0], q[1], q[2], q[3]));
      balls_[i].body.setQToFitTransform(state, SimTK::Transform(turn, to_simbody(solids[i].position_m)));
      balls_[i].body.setUToFitVelocity(state, SimTK::SpatialVec(to_simbody(solids[i].spin_rad_s), to_simbody(solids[i].velocity_m_s)));
    }
    stepper_.setDefaultImpactMinCORVelocity(0.0);  // restitution independent of speed
    stepper_.setConstraintTolerance(kGap);
    stepper_.initialize(state);
  }

  carillon_status start(char* message, std::size_t size) override { return reader_.start(stepper_.getState(), message, size); }
  carillon_status step(double time_s, char* message, std::size_t size) override {
    while (stepper_.getTime() < time_s - 1e-12) {
      const double begin_s = stepper_.getTime();
      stepper_.stepTo(std::min(time_s, begin_s + kStep));
      const SimTK::State& state = stepper_.getState();
      system_.realize(state, SimTK::Stage::Velocity);
      for (const Pair& pair : pairs_) add_point(state, pair, state.getTime() - begin_s);
      if (const carillon_status status = reader_.step(state, message, size); status != CARILLON_OK) return status;
    }
    return CARILLON_OK;
  }

 private:
  struct Ball {
    SimTK::MobilizedBody::Free body;
    double radius;
  };
  struct Pair {
    std::int32_t a, b;
  };

  void add(Pair pair, SimTK::UnilateralContact* contact) {
    matter_.adoptUnilateralContact(contact);
    pairs_.push_back(pair);
  }
  /// Adds the point of a pair near enough to have touched in the step.
  void add_point(const SimTK::State& state, const Pair& pair, double step_s) {
    const Ball& a = balls_[static_cast<std::size_t>(pair.a)];
    const Vec3 centre = a.body.getBodyOriginLocation(state), velocity = a.body.getBodyOriginVelocity(state);
    Vec3 other(centre[0], centre[1], 0), other_velocity(0);
    double other_radius = 0;
    if (pair.b >= 0) {
      const Ball& b = balls_[static_cast<std::size_t>(pair.b)];
      other = b.body.getBodyOriginLocation(state);
      other_velocity = b.body.getBodyOriginVelocity(state);
      other_radius = b.radius;
    }
    const SimTK::UnitVec3 normal(centre - other);
    const double gap = (centre - other).norm() - a.radius - other_radius;
    if (gap > 2 * kGap + step_s * (velocity - other_velocity).norm()) return;
    reader_.add_point(pair.a, pair.b, other + other_radius * normal, normal, gap);
  }

  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_{system_};
  SimTK::GeneralForceSubsystem forces_{system_};
  SimTK::SemiExplicitEulerTimeStepper stepper_{system_};
  std::vector<Ball> balls_;
  std::vector<Pair> pairs_;
  SimbodyTouches reader_;
};

}  // namespace

void set_options(carillon_touches_options& options) { options.points_after = 1; }
std::unique_ptr<Engine> make_engine(const std::vector<Solid>& solids, double, carillon_touches* touches) {
  return std::make_unique<Impacts>(solids, touches);
}

}  // namespace carillon::testing
