#include "precompute/simulation/simulation.hpp"

#include <fmt/core.h>

#include <string_view>
#include <utility>

#include "precompute/simulation/transient/vectors.hpp"
#include "runtime/base/error.hpp"

namespace carillon::simulation {
namespace {

transient::MotionOptions make_motion_options(const job::SimulationSpec& spec) {
  transient::MotionOptions options;
  options.sample_rate_hz = spec.sample_rate_hz;
  if (spec.step_s) options.longest_step_s = *spec.step_s;
  options.gravity_m_s2 = spec.gravity_m_s2;
  options.settle_s = spec.settle_s;
  options.round_steps = emission::find_steps;
  return options;
}

/// Job line of the body or striker at the beginning of a message of Contacts.
std::string find_overlap_place(const job::SimulationSpec& spec, std::string_view message) {
  for (std::size_t i = 0; i < spec.strikers.size(); ++i)
    if (message.starts_with(fmt::format("striker {} ", i + 1))) return spec.strikers[i].place;
  for (const job::SimulatedBody& body : spec.bodies)
    if (message.starts_with(fmt::format("body \"{}\" ", body.name))) return body.place;
  return spec.file.string();
}

}  // namespace

void make_motion(const comm::Communicator& comm, Simulation& simulation) {
  const job::SimulationSpec& spec = simulation.spec;
  simulation.domain = std::make_unique<transient::Domain>(comm, simulation.bodies.assembly);
  simulation.motion = std::make_unique<transient::Motion>(*simulation.domain, make_motion_options(spec), simulation.bodies.constraints,
                                                          simulation.bodies.impulses);
  std::vector<transient::BallStriker> strikers;
  for (const job::Striker& striker : spec.strikers) strikers.push_back(striker.ball);
  std::vector<transient::RigidObstacle> obstacles;
  for (const job::Obstacle& obstacle : spec.obstacles) obstacles.push_back(obstacle.form);
  const transient::TouchRules rules{spec.contact.restitution, spec.contact.friction, spec.gravity_m_s2};
  simulation.contacts = std::make_unique<transient::Contacts>(*simulation.domain, make_touch_surface(*simulation.bodies.assembly, spec),
                                                              std::move(strikers), std::move(obstacles), rules);
  if (simulation.contacts->is_needed()) simulation.motion->add(*simulation.contacts);
  simulation.motion->set_start([&](std::int32_t node, const Vec3& rest_m) {
    const std::size_t body = simulation.bodies.assembly->find_body_of_node(node);
    const job::SimulatedBody& described = spec.bodies[body];
    transient::Motion::Start start;
    start.velocity_m_s = described.velocity_m_s + cross(described.angular_velocity_rad_s, rest_m - simulation.bodies.centre_m[body]);
    if (!simulation.bodies.start.empty()) {
      const transient::Quad& u = simulation.bodies.start[node];
      start.displacement_m = transient::to_vector(u);
      start.angle_rad = u.x;
    }
    return start;
  });
  // The first forces include the contact search, which finds overlaps.
  try {
    simulation.motion->prepare();
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", find_overlap_place(spec, error.what()), error.what()));
  }
}

void set_balls(Simulation& simulation) {
  if (!simulation.spec.visibility || simulation.spec.strikers.empty()) return;
  std::vector<Vec3> centres;
  for (const transient::BallStriker& ball : simulation.contacts->get_strikers()) centres.push_back(ball.position_m);
  simulation.sound->set_balls(centres);
}

SimulationState collect_state(const comm::Communicator& comm, Simulation& simulation) {
  SimulationState state{simulation.books, simulation.motion->save(), simulation.contacts->save(), {}};
  if (simulation.sound) state.sound = comm.agree([&] { return simulation.sound->save(); });
  return state;
}

void resume(const comm::Communicator& comm, const SimulationState& state, Simulation& simulation) {
  simulation.books = state.books;
  simulation.motion->load(state.motion);
  simulation.contacts->load(state.contacts);
  if (simulation.sound) comm.agree([&] { simulation.sound->load(state.sound); });
}

}  // namespace carillon::simulation
