// When the plain pulse is enough: against the impact itself.
#include <array>

#include "runtime/physics/impact/predict.hpp"
#include "tests/unit/runtime/physics/impact/scenes.hpp"

namespace carillon::impact::tests {
namespace {

TEST(Prediction, PulseSpectrum) {
  EXPECT_NEAR(calc_pulse_spectrum(0.0), 1.0, 1e-12);
  for (const double x : {0.5, 2.0, 5.0, 9.3, 15.0, 40.0}) {
    long double real = 0, imaginary = 0, area = 0;
    constexpr int kPoints = 200000;
    for (int i = 0; i < kPoints; ++i) {
      const long double t = (i + 0.5L) / kPoints, f = std::pow(std::sin(std::numbers::pi_v<long double> * t), 1.5L);
      area += f;
      real += f * std::cos(x * t);
      imaginary += f * std::sin(x * t);
    }
    EXPECT_NEAR(calc_pulse_spectrum(x), static_cast<double>((real * real + imaginary * imaginary) / (area * area)), 2e-3) << x;
  }
  EXPECT_EQ(calc_pulse_spectrum(1e9), 0.0);
}

TEST(Prediction, AgreementWithIntegratedImpact) {
  int enough = 0, not_enough = 0;
  for (const double thickness : {0.003, 0.01, 0.03})
    for (const double radius : {0.002, 0.005, 0.01, 0.02})
      for (const double given : {1.0, 0.8}) {
        const Plate plate = make_plate(0.4, 0.3, thickness, 20e3, 0.17, 0.13);
        const Modes modes(plate.omega, plate.decay, 2.0 * kPi * 20e3);
        const Body ball = make_ball(radius, {0, 0, -1.0});
        Body below;
        below.modes = &modes;
        std::vector<Contact> contacts{make_contact(radius, 0, 1)};
        contacts[0].shape_b = plate.shape;
        contacts[0].restitution = given;
        std::vector<double> phi;
        for (std::size_t i = 2; i < plate.shape.size(); i += 3) phi.push_back(plate.shape[i]);
        const Prediction predicted =
            predict(contacts[0].spring, ball.mass_kg, 1.0, given, {}, {.modes = &modes, .phi = phi, .q = {}, .q_dot = {}});
        EXPECT_LE(predicted.restitution, given);
        if (!predicted.is_enough) {
          ++not_enough;
          continue;
        }
        ++enough;
        EXPECT_LE(predicted.modal_j, 0.5 * ball.mass_kg * (1.0 - predicted.restitution * predicted.restitution) + 1e-15);
        const double e = run({ball, below}, contacts).get_bodies()[0].velocity_m_s[2];
        EXPECT_NEAR(predicted.restitution, e, 0.015) << thickness << " " << radius << " " << given;
        EXPECT_NEAR(predicted.impulse_n_s, (1.0 + e) * ball.mass_kg, 0.01 * predicted.impulse_n_s);
      }
  EXPECT_GE(enough, 4);
  EXPECT_GE(not_enough, 4);
}

TEST(Prediction, ModalEnergyBelowLossOfMotion) {
  const Plate plate = make_plate(0.3, 0.3, 0.0005, 20e3, 0.01, 0.01);
  const Modes modes(plate.omega, plate.decay);
  std::vector<double> phi;
  for (std::size_t i = 2; i < plate.shape.size(); i += 3) phi.push_back(20.0 * plate.shape[i]);
  const Spring spring{1e10, 1.5, 0.0};
  for (const double given : {1.0, 0.5, 0.0})
    for (const double scale : {1.0, 0.3, 0.1, 0.03, 0.01}) {
      std::vector<double> scaled = phi;
      for (double& one : scaled) one *= scale;
      const Prediction p = predict(spring, 0.1, 2.0, given, {.modes = &modes, .phi = scaled, .q = {}, .q_dot = {}}, {});
      EXPECT_GE(p.restitution, 0.0);
      if (p.is_enough) {
        EXPECT_LE(p.modal_j, 0.5 * 0.1 * 4.0 * (1.0 - p.restitution * p.restitution) + 1e-15);
      }
    }
}

TEST(Prediction, InsufficientForRingingBodies) {
  const Modes modes(std::array{6000.0}, std::array{1.0});
  const std::vector<double> phi{0.01}, rest{0.0}, ringing{3.0};
  const Spring spring{1e10, 1.5, 0.0};
  EXPECT_TRUE(predict(spring, 0.01, 1.0, 1.0, {.modes = &modes, .phi = phi, .q = rest, .q_dot = rest}, {}).is_enough);
  EXPECT_FALSE(predict(spring, 0.01, 1.0, 1.0, {.modes = &modes, .phi = phi, .q = rest, .q_dot = ringing}, {}).is_enough);
  EXPECT_FALSE(predict({1e10, 2.5, 0.0}, 0.01, 1.0, 1.0, {}, {}).is_enough);
}

}  // namespace
}  // namespace carillon::impact::tests
