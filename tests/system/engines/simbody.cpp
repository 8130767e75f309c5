#include <algorithm>
#include <cmath>

#include "tests/system/engines/simbody_bodies.hpp"

namespace carillon::testing {
namespace {

using SimTK::Vec3;

/// Dissipation c of Hunt and Crossley [s/m], F = k x^1.5 (1 + 1.5 c dx/dt), for a restitution e of hits at 2 m/s. Integrated over a hit,
/// ln((1 + 1.5 c v) / (1 - 1.5 c e v)) = 1.5 c v (1 + e). 1 - c v is the tangent of e at v = 0.
double calc_loss(double restitution) {
  const double e = restitution;
  double low = 1e-3, high = (1.0 - 1e-9) / (1.5 * e);  // c v
  while (high - low > 1e-6) {
    const double x = 0.5 * (low + high);
    (std::log((1.0 + 1.5 * x) / (1.0 - 1.5 * e * x)) > 1.5 * x * (1.0 + e) ? high : low) = x;
  }
  return 1e-3 * std::round(1e3 * low) / 2.0;
}

constexpr double kCorner = 1e-3;  // m; radius of the balls at the corners of a box

class Simbody : public Engine {
 public:
  Simbody(const std::vector<Solid>& solids, carillon_touches* touches) : reader_(system_, matter_, tracker_, contact_, touches) {
    SimTK::Force::UniformGravity(forces_, matter_, Vec3(0, 0, -9.81));
    contact_.setTransitionVelocity(1e-3);
    double least = kRestitution;  // of the ground too, because losses are mixed
    for (const Solid& solid : solids) least = std::min(least, solid.restitution);
    matter_.Ground().updBody().addContactSurface(
        SimTK::Transform(SimTK::Rotation(SimTK::Pi / 2, SimTK::YAxis), Vec3(0)),
        SimTK::ContactSurface(SimTK::ContactGeometry::HalfSpace(),
                              SimTK::ContactMaterial(30e9 / 0.96, calc_loss(least), kFriction, kFriction, 0)));
    double longest_s = 1e-3;  // in larger steps rolling bodies hop, and boxes at rest are kicked
    for (const Solid& solid : solids) {
      const SimTK::MobilizedBody::Free body(matter_.Ground(), SimTK::Transform(), make_body(solid), SimTK::Transform());
      reader_.add(body.getMobilizedBodyIndex(), static_cast<std::int32_t>(bodies_.size()));
      bodies_.push_back(body);
      longest_s = std::min(longest_s, solid.kind == "ball" ? 1e-4 : solid.kind == "tube" ? 5e-5 : 2e-4);
    }
    integrator_.setAccuracy(1e-3);
    integrator_.setReturnEveryInternalStep(true);
    integrator_.setMaximumStepSize(longest_s);
    integrator_.initialize(make_state(system_, bodies_, solids));
  }

  carillon_status start(char* message, std::size_t size) override { return reader_.start(integrator_.getState(), message, size); }
  carillon_status step(double time_s, char* message, std::size_t size) override {
    while (integrator_.getTime() < time_s - 1e-12) {
      integrator_.stepTo(time_s, time_s);
      reader_.add_step(integrator_.getState());
    }
    return reader_.step(integrator_.getState(), message, size);
  }

 private:
  static SimTK::Body::Rigid make_body(const Solid& solid) {
    SimTK::Body::Rigid body(make_mass(solid));
    const auto add_ball = [&](const Vec3& at, double radius) {
      body.addContactSurface(
          SimTK::Transform(at),
          SimTK::ContactSurface(SimTK::ContactGeometry::Sphere(radius),
                                SimTK::ContactMaterial(solid.modulus_pa, calc_loss(solid.restitution), kFriction, kFriction, 0)));
    };
    const auto& half = solid.half_m;
    if (solid.kind == "ball") add_ball(Vec3(0), half[0]);
    if (solid.kind == "tube")
      for (const int side : {-1, 1}) add_ball(Vec3(side * half[0], 0, 0), half[1]);
    if (solid.kind == "box")
      for (int c = 0; c < 8; ++c)
        add_ball(
            Vec3((c & 1 ? 1 : -1) * (half[0] - kCorner), (c & 2 ? 1 : -1) * (half[1] - kCorner), (c & 4 ? 1 : -1) * (half[2] - kCorner)),
            kCorner);
    return body;
  }

  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_{system_};
  SimTK::GeneralForceSubsystem forces_{system_};
  SimTK::ContactTrackerSubsystem tracker_{system_};
  SimTK::CompliantContactSubsystem contact_{system_, tracker_};
  SimTK::RungeKuttaMersonIntegrator integrator_{system_};
  std::vector<SimTK::MobilizedBody::Free> bodies_;
  SimbodyTouches reader_;
};

}  // namespace

void set_options(carillon_touches_options& options) { options.points_after = options.compliant = 1; }
std::unique_ptr<Engine> make_engine(const std::vector<Solid>& solids, double, carillon_touches* touches) {
  return std::make_unique<Simbody>(solids, touches);
}

}  // namespace carillon::testing
