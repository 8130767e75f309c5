// An arm of two links that swings by motors and lets go of a box, by Simbody: carillon/simbody.h reads the contacts of the program's own
// system.
//
//   simbody_arm BOX OUT.f32    BOX: bank of a box; OUT: pressure at two ears [Pa], pairs of floats at 48 kHz. Prints the fall.
#include <carillon/simbody.h>

#include <algorithm>
#include <memory>

#include "sound.hpp"

namespace {

using SimTK::Rotation;
using SimTK::Transform;
using SimTK::Vec3;

constexpr double kStep = 1.0 / 240.0;  // s; of the program. Simbody takes smaller ones
constexpr double kSeconds = 3.0;
constexpr double kRelease = 0.5;  // s; when the hand opens
constexpr double kLink = 0.25;    // m
constexpr double kLoss = 0.25;    // s/m
constexpr double kCorner = 1e-3;  // m; radius of the balls at the corners of the box: Simbody has no contact of boxes

SimTK::Body::Rigid make_box(const carillon_bank* bank) {
  carillon_body_facts facts;
  carillon_body_facts_init(&facts);
  carillon_bank_get_facts(bank, &facts);
  const double* i = facts.inertia_kg_m2;
  SimTK::Body::Rigid box(SimTK::MassProperties(facts.mass_kg, Vec3(0), SimTK::Inertia(i[0], i[4], i[8])));
  Vec3 half(0);
  const double* x = carillon_bank_vertices_m(bank);
  for (std::int32_t v = 0; v < carillon_bank_vertex_count(bank); ++v, x += 3)
    for (int k = 0; k < 3; ++k) half[k] = std::max(half[k], std::abs(x[k]));
  const SimTK::ContactMaterial wood(facts.young_modulus_pa / (1 - facts.poisson_ratio * facts.poisson_ratio), kLoss, 0.45, 0.45, 0);
  for (int c = 0; c < 8; ++c) {
    const Vec3 side(c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1);
    box.addContactSurface(Transform(side.elementwiseMultiply(half - Vec3(kCorner))),
                          SimTK::ContactSurface(SimTK::ContactGeometry::Sphere(kCorner), wood));
  }
  return box;
}

class Arm {
 public:
  explicit Arm(const carillon_bank* bank) {
    SimTK::Force::UniformGravity(forces_, matter, Vec3(0, 0, -9.81));
    contact.setTransitionVelocity(1e-3);
    const SimTK::ContactMaterial concrete(30e9 / 0.96, kLoss, 0.45, 0.45, 0);
    matter.Ground().updBody().addContactSurface(Transform(Rotation(SimTK::Pi / 2, SimTK::YAxis), Vec3(0)),
                                                SimTK::ContactSurface(SimTK::ContactGeometry::HalfSpace(), concrete));
    const Vec3 middle(kLink / 2, 0, 0);
    SimTK::Body::Rigid link(SimTK::MassProperties(0.3, middle, SimTK::Inertia(1e-3, 3e-3, 3e-3).shiftFromMassCenter(middle, 0.3)));
    const Rotation along_y(-SimTK::Pi / 2, SimTK::XAxis);  // pins turn about z
    SimTK::MobilizedBody::Pin upper(matter.Ground(), Transform(along_y, Vec3(-0.3, 0, 0.6)), link, Transform(along_y, Vec3(0)));
    SimTK::MobilizedBody::Pin fore(upper, Transform(along_y, Vec3(kLink, 0, 0)), link, Transform(along_y, Vec3(0)));
    SimTK::Motion::Sinusoid(upper, SimTK::Motion::Position, 0.4, 6.0, 0.0);
    SimTK::Motion::Sinusoid(fore, SimTK::Motion::Position, 0.3, 9.0, 0.5);
    SimTK::MobilizedBody::Free held(matter.Ground(), Transform(), make_box(bank), Transform());
    box = held.getMobilizedBodyIndex();
    hand_ = std::make_unique<SimTK::Constraint::Weld>(fore, Transform(Vec3(kLink, 0, 0)), held, Transform());
    system.realizeTopology();
    SimTK::State state = system.getDefaultState();
    system.realizeModel(state);
    SimTK::Assembler(system).assemble(state);
    integrator.setAccuracy(1e-3);
    integrator.setReturnEveryInternalStep(true);
    integrator.setMaximumStepSize(1e-3);
    integrator.initialize(state);
  }
  void open_hand() {
    SimTK::State state = integrator.getState();
    hand_->disable(state);
    integrator.initialize(state);
  }

  SimTK::MultibodySystem system;
  SimTK::SimbodyMatterSubsystem matter{system};
  SimTK::ContactTrackerSubsystem tracker{system};
  SimTK::CompliantContactSubsystem contact{system, tracker};
  SimTK::RungeKuttaMersonIntegrator integrator{system};
  SimTK::MobilizedBodyIndex box;

 private:
  SimTK::GeneralForceSubsystem forces_{system};
  std::unique_ptr<SimTK::Constraint::Weld> hand_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return std::fputs("usage: simbody_arm BOX OUT.f32\n", stderr), 2;
  carillon_touches_options options;
  carillon_touches_options_init(&options);
  options.points_after = options.compliant = 1;
  Sound sound(options);
  const std::int32_t index = sound.add(argv[1], "box", 0.5, 0.4);
  Arm arm(sound.get_bank(index));
  carillon::SimbodyTouches simbody(arm.system, arm.matter, arm.tracker, arm.contact, sound.get_touches());
  simbody.add(arm.box, index);
  const SimTK::State& state = arm.integrator.getState();
  Message message;
  message.check(simbody.start(state, message.text(), message.size()));
  bool is_held = true, has_landed = false;
  for (int step = 1; step * kStep < kSeconds; ++step) {
    while (arm.integrator.getTime() < step * kStep - 1e-12) {
      arm.integrator.stepTo(step * kStep, step * kStep);
      simbody.add_step(state);
      if (has_landed || arm.contact.getNumContactForces(state) == 0) continue;
      const double height = arm.matter.getMobilizedBody(arm.box).getBodyOriginLocation(state)[2];
      std::printf("lands at %.4f s, %.4f m high\n", arm.integrator.getTime(), height);
      has_landed = true;
    }
    message.check(simbody.step(state, message.text(), message.size()));
    sound.play();
    if (!is_held || step * kStep < kRelease) continue;
    const SimTK::MobilizedBody& box = arm.matter.getMobilizedBody(arm.box);
    const Vec3 at = box.getBodyOriginLocation(state), speed = box.getBodyOriginVelocity(state);
    std::printf("released at %.4f s, %.4f m high, %.4f m/s upwards\n", step * kStep, at[2], speed[2]);
    arm.open_hand();
    is_held = false;
  }
  sound.finish(argv[2]);
  return 0;
}
