// Energy that hits give to modes: never above the loss of kinetic energy.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "tests/unit/runtime/drive/touch_rig.hpp"
#include "tests/unit/runtime/physics/plate_bank.hpp"

namespace carillon::drive::tests {
namespace {

/// Energy of undamped modes after the events on a body [J]. Pulses sin^1.5 by quadrature.
double calc_modal_j(const Rig& rig, const bank::Bank& bank, int body) {
  std::vector<std::complex<double>> state(bank.mode_count());
  const auto push = [&](std::int32_t triangle, const Vec3& barycentric, const Vec3& impulse, double begin_s, double length_s) {
    const std::vector<double> phi = bank::calc_shapes(bank, triangle, barycentric);
    for (std::size_t i = 0; i < state.size(); ++i) {
      const double omega = std::sqrt(bank.eigenvalue_rad2_s2[i]), x = 0.5 * omega * length_s;
      const double given = phi[3 * i] * impulse[0] + phi[3 * i + 1] * impulse[1] + phi[3 * i + 2] * impulse[2];
      state[i] += given * (x > 0.0 ? std::sin(x) / x : 1.0) * std::polar(1.0, omega * (begin_s + 0.5 * length_s));
    }
  };
  for (const auto& f : rig.list<events::Force>()) {
    if (f.body != body) continue;
    for (int k = 0; k < f.count; ++k) {
      const Vec3 impulse{f.impulse_n_s[k][0], f.impulse_n_s[k][1], f.impulse_n_s[k][2]};
      push(f.triangle, f.barycentric, impulse, f.time_s + k * f.step_s, f.step_s);
    }
  }
  for (const auto& p : rig.list<events::Impulse>()) {
    if (p.body != body) continue;
    constexpr int kParts = 200;
    double area = 0.0;
    for (int k = 0; k < kParts; ++k) area += std::pow(std::sin(M_PI * (k + 0.5) / kParts), 1.5);
    for (int k = 0; k < kParts; ++k)
      push(p.triangle, p.barycentric, (std::pow(std::sin(M_PI * (k + 0.5) / kParts), 1.5) / area) * p.impulse_n_s,
           p.time_s + (static_cast<double>(k) / kParts - 0.5) * p.duration_s, p.duration_s / kParts);
  }
  double sum = 0.0;
  for (const auto& x : state) sum += 0.5 * std::norm(x);
  return sum;
}

TEST(TouchEnergy, PlatesNeverRingWithMoreThanTheBlow) {
  for (const double thickness : {0.5e-3, 1e-3, 2e-3, 5e-3}) {
    const bank::Bank plate = physics::tests::make_plate_bank(0.2, thickness, 8000.0, 8, 1.0);
    for (const double e : {0.2, 0.5, 0.9})
      for (const int impacts : {8, 0}) {
        Rig rig({.max_impacts = impacts, .ground_restitution = e});
        const double speed = 1.0;
        rig.add(plate, "plate", {0, 0, 0.5 * thickness}, {0, 0, -speed}, e);
        rig.start();
        // At a quarter of an edge: the plate turns; the impulse is that of a rigid body.
        const Vec3 where{0.05, 0.08, 0.0};
        const auto& inertia = plate.rigid.inertia_kg_m2;
        const double inverse = 1.0 / plate.rigid.mass_kg + where[1] * where[1] / inertia[0] + where[0] * where[0] / inertia[4];
        const double impulse = (1.0 + e) * speed / inverse;
        rig.poses[0].velocity_m_s[2] += impulse / plate.rigid.mass_kg;
        rig.poses[0].spin_rad_s = {where[1] * impulse / inertia[0], -where[0] * impulse / inertia[4], 0.0};
        const double dt = 1e-4;
        rig.step(dt, {on_ground(0, where, impulse)});
        ASSERT_TRUE(rig.has_hits());
        const double blow = 0.5 * speed * speed / inverse;
        EXPECT_LE(calc_modal_j(rig, plate, 0), (1.0 - e * e + 0.01) * blow) << thickness << " m, e = " << e << ", " << impacts;
        EXPECT_LE(rig.sum_impulses(0)[2], 1.01 * impulse);
        EXPECT_TRUE(rig.faults.empty());
        EXPECT_EQ(rig.touches.get_counters().impacts + rig.touches.get_counters().simplified, 1) << "modes matter";
      }
  }
}

/// A plate that falls at `speed` and is struck at both ends at once, so that it leaves with e times the speed; steps of 0.1 ms.
void strike_both_ends(Rig& rig, const bank::Bank& plate, double speed, double e) {
  const double impulse = (1.0 + e) * speed * plate.rigid.mass_kg;
  rig.poses[0].velocity_m_s[2] = -speed;
  rig.step(1e-4, {});
  rig.poses[0].velocity_m_s[2] = e * speed;
  rig.step(1e-4, {on_ground(0, {0.1, 0.0, 0.0}, 0.5 * impulse), on_ground(0, {-0.1, 0.0, 0.0}, 0.5 * impulse)});
  for (int n = 0; n < 300; ++n) rig.step(1e-4, {});
}

TEST(TouchEnergy, BothEndsStrikeTogether) {
  const bank::Bank plate = physics::tests::make_plate_bank(0.2, 5e-3, 8000.0, 8, 1.0);
  const double e = 0.5, speed = 1.0;
  Rig rig({.ground_restitution = e});
  rig.add(plate, "plate", {0, 0, 2.5e-3}, {}, e);
  rig.start();
  strike_both_ends(rig, plate, speed, e);
  const double wanted = (1.0 + e) * speed * plate.rigid.mass_kg;
  EXPECT_EQ(rig.touches.get_counters().impacts, 2);
  EXPECT_LE(rig.sum_impulses(0)[2], 1.001 * wanted);
  EXPECT_GE(rig.sum_impulses(0)[2], 0.8 * wanted) << "each alone turns the plate, and gives a quarter";
}

TEST(TouchEnergy, BlowsOnARingingPlateAddNoMoreThanTheirOwn) {
  const double e = 0.5, speed = 1.0;
  for (const double thickness : {0.5e-3, 2e-3}) {
    const bank::Bank plate = physics::tests::make_plate_bank(0.2, thickness, 8000.0, 8, 1e-6);
    Rig rig({.ground_restitution = e});
    rig.add(plate, "plate", {0, 0, 0.5 * thickness}, {}, e);
    rig.start();
    for (int blows = 1; blows <= 4; ++blows) {
      strike_both_ends(rig, plate, speed, e);
      const double lost_j = 0.5 * plate.rigid.mass_kg * speed * speed * (1.0 - e * e);
      EXPECT_LE(calc_modal_j(rig, plate, 0), 1.01 * blows * lost_j) << thickness << " m, after " << blows;
    }
    EXPECT_GT(rig.touches.get_counters().impacts, 0);
  }
}

}  // namespace
}  // namespace carillon::drive::tests
