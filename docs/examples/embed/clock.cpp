// A clock that strikes, by Simbody: two pendulums with brass bobs side by side; one falls against the other. carillon/simbody.h reads the
// contacts of the program's own system.
//
//   simbody_clock BOB OUT.f32    BOB: bank of a ball; OUT: pressure at two ears [Pa], pairs of floats at 48 kHz. Prints the strikes.
#include <carillon/simbody.h>

#include <algorithm>

#include "sound.hpp"

namespace {

using SimTK::Rotation;
using SimTK::Transform;
using SimTK::Vec3;

constexpr double kStep = 1.0 / 240.0;  // s; of the program. Simbody takes smaller ones
constexpr double kSeconds = 3.0;
constexpr double kRod = 0.3, kPivot = 0.8;  // m
constexpr double kAngle = 0.6;              // rad; where the first pendulum is released
constexpr double kLoss = 0.25;              // s/m

class Clock {
 public:
  Clock(const carillon_bank* bank, double young_pa, double poisson) {
    SimTK::Force::UniformGravity(forces_, matter, Vec3(0, 0, -9.81));
    contact.setTransitionVelocity(1e-3);
    carillon_body_facts facts;
    carillon_body_facts_init(&facts);
    carillon_bank_get_facts(bank, &facts);
    double radius = 0.0;
    const double* x = carillon_bank_vertices_m(bank);
    for (std::int32_t i = 0; i < carillon_bank_vertex_count(bank); ++i, x += 3) radius = std::max(radius, Vec3(x[0], x[1], x[2]).norm());
    SimTK::Body::Rigid bob(SimTK::MassProperties(facts.mass_kg, Vec3(0), SimTK::Inertia(facts.inertia_kg_m2[0])));
    const SimTK::ContactMaterial brass(young_pa / (1 - poisson * poisson), kLoss, 0.4, 0.4, 0);
    bob.addContactSurface(Transform(), SimTK::ContactSurface(SimTK::ContactGeometry::Sphere(radius), brass));
    const Rotation along_y(-SimTK::Pi / 2, SimTK::XAxis);  // pins turn about z
    for (const double place : {-radius, radius})
      bobs.push_back(
          SimTK::MobilizedBody::Pin(matter.Ground(), Transform(along_y, Vec3(place, 0, kPivot)), bob, Transform(along_y, Vec3(0, 0, kRod)))
              .getMobilizedBodyIndex());
    system.realizeTopology();
    SimTK::State state = system.getDefaultState();
    system.realizeModel(state);
    matter.getMobilizedBody(bobs[0]).setOneQ(state, 0, kAngle);
    integrator.setAccuracy(1e-3);
    integrator.setReturnEveryInternalStep(true);
    integrator.setMaximumStepSize(1e-3);
    integrator.initialize(state);
  }
  /// Speed of the bobs towards each other [m/s].
  double calc_approach() const {
    const SimTK::State& state = integrator.getState();
    return kRod * (matter.getMobilizedBody(bobs[1]).getOneU(state, 0) - matter.getMobilizedBody(bobs[0]).getOneU(state, 0));
  }

  SimTK::MultibodySystem system;
  SimTK::SimbodyMatterSubsystem matter{system};
  SimTK::ContactTrackerSubsystem tracker{system};
  SimTK::CompliantContactSubsystem contact{system, tracker};
  SimTK::RungeKuttaMersonIntegrator integrator{system};
  std::vector<SimTK::MobilizedBodyIndex> bobs;

 private:
  SimTK::GeneralForceSubsystem forces_{system};
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return std::fputs("usage: simbody_clock BOB OUT.f32\n", stderr), 2;
  carillon_touches_options options;
  carillon_touches_options_init(&options);
  options.points_after = options.compliant = 1;
  Sound sound(options);
  const std::int32_t first = sound.add(argv[1], "first bob", 0.7, 0.4), second = sound.add(argv[1], "second bob", 0.7, 0.4);
  carillon_body_facts brass;
  carillon_body_facts_init(&brass);
  carillon_bank_get_facts(sound.get_bank(first), &brass);
  Clock clock(sound.get_bank(first), brass.young_modulus_pa, brass.poisson_ratio);
  carillon::SimbodyTouches simbody(clock.system, clock.matter, clock.tracker, clock.contact, sound.get_touches());
  simbody.add(clock.bobs[0], first, CARILLON_JOINTED);
  simbody.add(clock.bobs[1], second, CARILLON_JOINTED);
  const SimTK::State& state = clock.integrator.getState();
  Message message;
  message.check(simbody.start(state, message.text(), message.size()));
  for (int step = 1; step * kStep < kSeconds; ++step) {
    const double before = clock.calc_approach();
    while (clock.integrator.getTime() < step * kStep - 1e-12) {
      clock.integrator.stepTo(step * kStep, step * kStep);
      simbody.add_step(state);
    }
    message.check(simbody.step(state, message.text(), message.size()));
    sound.play();
    if (before > 0.1 && clock.calc_approach() < 0) std::printf("strike at %.4f s, %.3f m/s\n", step * kStep, before);
  }
  sound.finish(argv[2]);
  return 0;
}
