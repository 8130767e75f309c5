// Simbody's impacts: rigid contacts with restitution, by its time stepper.
#include <algorithm>
#include <stdexcept>

#include "tests/system/engines/simbody_bodies.hpp"

namespace carillon::testing {
namespace {

using SimTK::Vec3;

constexpr double kStep = 1e-3;  // s, at most
constexpr double kGap = 1e-5;   // m; of a contact
const SimTK::UnitVec3 kUp(0, 0, 1);

/// Balls on each other and on the ground.
class Impacts : public Engine {
 public:
  Impacts(const std::vector<Solid>& solids, carillon_touches* touches) : reader_(system_, matter_, touches) {
    SimTK::Force::UniformGravity(forces_, matter_, Vec3(0, 0, -9.81));
    for (const Solid& solid : solids) {
      if (solid.kind != "ball") throw std::invalid_argument("Simbody's impacts are tested with balls: " + solid.name);
      SimTK::MobilizedBody::Free body(matter_.Ground(), SimTK::Transform(), SimTK::Body::Rigid(make_mass(solid)), SimTK::Transform());
      const auto index = static_cast<std::int32_t>(bodies_.size());
      const double radius = solid.half_m[0];
      add({index, -1},
          new SimTK::SpherePlaneContact(matter_.Ground(), kUp, 0, body, Vec3(0), radius, kRestitution, kFriction, kFriction, 0));
      for (std::int32_t other = 0; other < index; ++other) {
        const auto at = static_cast<std::size_t>(other);
        add({index, other},
            new SimTK::SphereSphereContact(body, Vec3(0), radius, bodies_[at], Vec3(0), radii_[at], kRestitution, kFriction, kFriction, 0));
      }
      reader_.add(body.getMobilizedBodyIndex(), index);
      bodies_.push_back(body);
      radii_.push_back(radius);
    }
    stepper_.setDefaultImpactMinCORVelocity(0.0);  // restitution independent of speed
    stepper_.setConstraintTolerance(kGap);
    stepper_.initialize(make_state(system_, bodies_, solids));
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
  struct Pair {
    std::int32_t a, b;
  };

  void add(Pair pair, SimTK::UnilateralContact* contact) {
    matter_.adoptUnilateralContact(contact);
    pairs_.push_back(pair);
  }
  /// Adds the point of a pair near enough to have touched in the step.
  void add_point(const SimTK::State& state, const Pair& pair, double step_s) {
    const auto a = static_cast<std::size_t>(pair.a);
    const Vec3 centre = bodies_[a].getBodyOriginLocation(state), velocity = bodies_[a].getBodyOriginVelocity(state);
    Vec3 other(centre[0], centre[1], 0), other_velocity(0);
    double other_radius = 0;
    if (pair.b >= 0) {
      const auto b = static_cast<std::size_t>(pair.b);
      other = bodies_[b].getBodyOriginLocation(state);
      other_velocity = bodies_[b].getBodyOriginVelocity(state);
      other_radius = radii_[b];
    }
    const SimTK::UnitVec3 normal(centre - other);
    const double gap = (centre - other).norm() - radii_[a] - other_radius;
    if (gap > 2 * kGap + step_s * (velocity - other_velocity).norm()) return;
    reader_.add_point(pair.a, pair.b, other + other_radius * normal, normal, gap);
  }

  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_{system_};
  SimTK::GeneralForceSubsystem forces_{system_};
  SimTK::SemiExplicitEulerTimeStepper stepper_{system_};
  std::vector<SimTK::MobilizedBody::Free> bodies_;
  std::vector<double> radii_;
  std::vector<Pair> pairs_;
  SimbodyTouches reader_;
};

}  // namespace

void set_options(carillon_touches_options& options) { options.points_after = 1; }
std::unique_ptr<Engine> make_engine(const std::vector<Solid>& solids, double, carillon_touches* touches) {
  return std::make_unique<Impacts>(solids, touches);
}

}  // namespace carillon::testing
