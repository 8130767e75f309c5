// Corners of a flat face that lands.
#include "runtime/physics/impact/face.hpp"

#include <gtest/gtest.h>

#include "tests/unit/runtime/physics/impact/scenes.hpp"

namespace carillon::impact::tests {
namespace {

constexpr double kFlatM = 2e-5, kCornerM = 1e-3;  // m; flatness of the face, radius of corners
const Vec3 kHalf{0.06, 0.04, 0.025};

/// A rigid box of 1 kg over the ground; its lower corners have these gaps.
struct Landing {
  Body box{};
  std::vector<Contact> contacts{};
  std::vector<FaceCorner> corners{};

  explicit Landing(const std::array<double, 4>& gaps_m) {
    box.mass_kg = 1.0;
    box.centre_m = {0, 0, kHalf[2]};
    box.velocity_m_s = {0, 0, -1.0};
    for (std::size_t k = 0; k < 3; ++k) {
      const double across = kHalf[(k + 1) % 3], along = kHalf[(k + 2) % 3];
      box.inertia_kg_m2[k][k] = box.mass_kg / 3.0 * (across * across + along * along);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      Contact& corner = contacts.emplace_back(make_contact(kCornerM));
      corner.where_m = {(k == 0 || k == 3 ? 1.0 : -1.0) * kHalf[0], (k < 2 ? 1.0 : -1.0) * kHalf[1], 0.0};
      corner.gap_m = gaps_m[k];
      corners.push_back({.alone = corner.spring,
                         .is_sharp = true,
                         .where_m = corner.where_m,
                         .normal = corner.normal,
                         .size_m = 0.1,
                         .compliance_per_pa = 2.0 * (1.0 - kPoisson * kPoisson) / kYoung});
    }
  }
};

TEST(Face, LandsAsAFlatPunch) {
  Landing landing({});
  const std::vector<Spring> springs = find_springs(Impact({landing.box}, landing.contacts), landing.corners, kFlatM, 1e-4);
  const double area = 4.0 * kHalf[0] * kHalf[1], stiffness = kYoung / (1.0 - kPoisson * kPoisson) * std::sqrt(area / kPi);
  for (std::size_t k = 0; k < 4; ++k) landing.contacts[k].spring = springs[k];
  Impact impact({landing.box}, landing.contacts, {.steps_per_pulse = 200.0});
  EXPECT_TRUE(impact.advance(1.0));
  const std::vector<Pulse> pulses = impact.take_pulses();
  ASSERT_EQ(pulses.size(), 4U);
  // Half a period of mass and spring; restitution 1.
  const double length_s = kPi * std::sqrt(landing.box.mass_kg / stiffness);
  for (const Pulse& pulse : pulses) EXPECT_NEAR(pulse.step_s * static_cast<double>(pulse.impulse_n_s.size()), length_s, 0.02 * length_s);
  EXPECT_NEAR(impact.get_bodies()[0].velocity_m_s[2], 1.0, 1e-3);
}

TEST(Face, NeedsThreeCornersThatArePressed) {
  const auto count_linear = [](const std::vector<Spring>& springs) {
    return std::count_if(springs.begin(), springs.end(), [](const Spring& spring) { return spring.exponent == 1.0; });
  };
  const Landing tilted({0.0, 0.0, 5e-5, 5e-5});
  const Impact impact({tilted.box}, tilted.contacts);
  EXPECT_EQ(count_linear(find_springs(impact, tilted.corners, kFlatM, 6e-5)), 0) << "two corners are still open";
  EXPECT_EQ(count_linear(find_springs(impact, tilted.corners, kFlatM, 8e-5)), 4);
  Landing others({});
  others.corners[0].normal = {0.6, 0.0, 0.8};
  EXPECT_EQ(count_linear(find_springs(impact, others.corners, kFlatM, 1e-4)), 3) << "of another face";
  others.corners[1].is_sharp = false;
  EXPECT_EQ(count_linear(find_springs(impact, others.corners, kFlatM, 1e-4)), 0) << "of a curved surface";
}

/// A face that forms while corners are pressed changes no energy.
TEST(Face, KeepsTheEnergyWhileItForms) {
  const Landing landing({0.0, 0.0, 3e-5, 6e-5});
  Impact impact({landing.box}, landing.contacts);
  int changes = 0;
  while (!impact.advance(impact.get_time() + 1e-5) && impact.get_time() < 0.05) {
    const std::vector<Spring> springs = find_springs(impact, landing.corners, kFlatM, 1e-5);
    for (int k = 0; k < 4; ++k) {
      if (springs[k] == impact.get_contact(k).spring) continue;
      impact.exchange_spring(k, springs[k]);
      ++changes;
    }
    ASSERT_LT(std::abs(impact.get_books().calc_error()), 1e-10);
  }
  EXPECT_GT(changes, 0);
  EXPECT_LE(impact.get_books().rigid, impact.get_books().start);
}

}  // namespace
}  // namespace carillon::impact::tests
