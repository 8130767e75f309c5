// The stages of a step, without the loop over them.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "runtime/physics/rigid/modal_impact.hpp"
#include "runtime/physics/rigid/projection.hpp"
#include "runtime/physics/rigid/rest.hpp"
#include "runtime/physics/rigid/rigid_impact.hpp"
#include "runtime/physics/rigid/step_problem.hpp"
#include "runtime/physics/rigid/windows.hpp"
#include "tests/unit/runtime/physics/rigid/bodies.hpp"

namespace carillon::rigid {

inline const Vec3 kBoxSides{0.06, 0.05, 0.04};
inline constexpr double kGravity = 9.81;
inline const Ground kWood{.restitution = 0.2, .friction = 0.4, .young_modulus_pa = 10e9, .poisson_ratio = 0.3};

struct Stages {
  Stages(std::vector<Solid> solids, std::vector<State> states, std::optional<Ground> ground, const Vec3& gravity)
      : bodies(std::move(solids), std::move(states), ground, gravity) {}

  /// All bodies as one island, on pairs that are searched now.
  void begin(const std::vector<std::pair<int, int>>& pairs) {
    for (int i = 0; i < bodies.count(); ++i) island.bodies.push_back(i);
    for (const auto& [a, b] : pairs) {
      island.pairs.push_back(&touches.get(a, b));
      touches.search(*island.pairs.back(), 1e-3);
    }
    step.begin(island);
    step.together_s = kSimultaneousS;
  }
  /// The impulses of a step.
  void solve(double length_s, bool leaves_impacts = false) {
    problem.predict(step, length_s, false);
    problem.make_points(step, leaves_impacts);
    problem.solve(step);
  }
  Vec3 sum_impulses() const {
    Vec3 sum{};
    for (const Point& p : step.points) sum = sum + p.impulse;
    return sum;
  }
  Books calc_books() const {
    Books books;
    bodies.add_to(books);
    modal_states.add_to(books, bodies.get_time());
    modal_impacts.add_to(books);
    touches.add_to(books);
    ledger.add_to(books);
    return books;
  }

  Options options;
  Ledger ledger;
  Bodies bodies;
  ModalStates modal_states{bodies, ledger};
  ModalImpacts modal_impacts{bodies, modal_states, ledger};
  TouchSets touches{bodies, {}, modal_impacts, ledger};
  Windows windows{bodies, touches, options, ledger};
  Projection projection{bodies, touches, modal_states, ledger};
  StepProblem problem{bodies, touches, options, ledger};
  Instants instants{bodies, touches};
  RigidImpact rigid_impact{bodies, touches};
  Rest rest{bodies, touches, windows, problem, options, ledger};
  Step step{bodies};
  Island island;
};

inline State make_state(const Vec3& centre, const Vec3& velocity = {}) {
  State s;
  s.centre = centre;
  s.velocity = velocity;
  return s;
}

}  // namespace carillon::rigid
