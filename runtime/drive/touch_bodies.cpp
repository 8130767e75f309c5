#include "runtime/drive/touch_bodies.hpp"

namespace carillon::drive {
namespace {

void calc_own(const TouchBody& body, const Vec3& station, const Vec3& outward, double& curvature, bool& is_round) {
  if (!body.shape) {  // as of a ball
    curvature = 2.0 / body.given.size_m;
    is_round = true;
    return;
  }
  const NearEdges near = body.edges->find_near(station);
  const bool is_rim = near.outward != Vec3{};
  is_round = near.directions == 0 && !body.shape->is_polyhedron();
  if (near.directions > 0)
    curvature = (near.directions == 1 ? 0.5 : 1.0) * body.shape->get_corner_curvature_per_m();
  else
    curvature = std::max(0.0, body.shape->find_place(is_rim ? near.rim_m : station, is_rim ? near.outward : outward).curvature_per_m);
}

}  // namespace

Curvatures calc_curvatures(const StepView& step, int a, int b, const std::array<Vec3, 2>& stations, const std::array<Vec3, 2>& outwards) {
  Curvatures c;
  calc_own(step.bodies[a], stations[0], outwards[0], c.a_per_m, c.is_a_round);
  if (b >= 0) calc_own(step.bodies[b], stations[1], outwards[1], c.b_per_m, c.is_b_round);
  return c;
}

}  // namespace carillon::drive
