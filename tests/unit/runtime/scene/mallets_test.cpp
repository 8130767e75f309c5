// Mallet blows: energy balance, limits with a closed form, and agreement of sound and solution.
#include "runtime/scene/mallets.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>
#include <variant>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/physics/impact/spring.hpp"
#include "runtime/scene/strikes.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::scene {
namespace {

constexpr double kPi = std::numbers::pi;

/// A cube of 1 kg with modes up to 20 kHz in all directions.
bank::Bank make_bank(int modes, double decay_per_s = 0.0) {
  std::vector<testing::InventedMode> invented;
  for (int m = 0; m < modes; ++m) {
    const double turn = 1.7 * m;
    invented.push_back({300.0 * std::pow(66.0, static_cast<double>(m) / std::max(modes, 1)),
                        decay_per_s,
                        1.0,
                        {0.5 * std::cos(turn), 0.5 * std::sin(turn), 1.0},
                        0.1});
  }
  return testing::make_cube_bank(invented);
}

Mallet make_hard() { return {.mass_kg = 0.03, .speed_m_s = 1.5, .radius_m = 0.012, .young_modulus_pa = 3e9}; }
Mallet make_felt() { return {.mass_kg = 0.03, .speed_m_s = 1.5, .felt = Felt{2e8, 2.5}, .restitution = 0.7}; }

class MalletsOnACube : public ::testing::Test {
 protected:
  void begin(bank::Bank bank, bool fixed) {
    bank_ = std::move(bank);
    scene_ = {};
    scene_.file = "scene.json";
    scene_.duration_s = 2.0;
    scene_.bodies.resize(1);
    scene_.bodies[0].name = "cube";
    scene_.bodies[0].spec.fixed = fixed;
    scene_.bodies[0].spec.bank = &bank_;
  }
  void add(const Mallet& mallet, double time_s, const Vec3& point_m = {0.01, 0.02, 0.05}) {
    SceneStrike strike;
    strike.place = "scene.json:" + std::to_string(scene_.strikes.size() + 5);
    strike.time_s = time_s;
    strike.point_m = point_m;
    strike.mallet = mallet;
    scene_.strikes.push_back(strike);
  }
  Strikes make() const { return make_strikes(scene_, {&bank_}); }
  Strikes make(const Mallet& mallet) {
    scene_.strikes.clear();
    add(mallet, 0.01);
    return make();
  }
  bank::Bank bank_;
  Scene scene_;
};

void expect_closed(const std::vector<Blow>& blows, double slack = 1e-9) {
  double before = 0.0, then = 0.0;
  for (const Blow& b : blows) {
    before += b.before_j;
    then += b.after_j + b.motion_j + b.modes_j + b.lost_j;
    EXPECT_GE(b.after_j, 0.0);
    EXPECT_GE(b.motion_j, 0.0);
    EXPECT_GE(b.lost_j, -1e-12);
    EXPECT_LE(b.after_j, b.before_j * (1.0 + 1e-12));
  }
  EXPECT_NEAR(then, before, slack * before);
}

/// Final energy of a voice, for a bank without damping.
double play(const bank::Bank& bank, const std::vector<events::Event>& events, double until_s) {
  synth::ResonatorBank voice(synth::Model::make(bank, {.rate_hz = 48000.0}), {.max_forces = 8000, .silence_pa = 1e-30});
  for (const events::Event& event : events) EXPECT_TRUE(voice.push(std::get<events::Force>(event)));
  std::vector<float> block(128);
  for (int i = 0; i * 128 < until_s * 48000.0; ++i) voice.process(block);
  return voice.calc_energy_j();
}

TEST_F(MalletsOnACube, EnergyBalancesForAllHeadsOnFixedAndFreeBodies) {
  for (const bool fixed : {true, false}) {
    for (const double decay : {0.0, 30.0}) {
      begin(make_bank(60, decay), fixed);
      for (Mallet mallet : {make_hard(), make_felt()}) {
        for (const double speed : {0.01, 1.0, 20.0}) {
          for (const double friction : {0.0, 0.4}) {
            mallet.speed_m_s = speed;
            mallet.friction = friction;
            mallet.direction = friction > 0.0 ? std::optional<Vec3>({0.6, 0.0, -0.8}) : std::nullopt;
            const Strikes made = make(mallet);
            ASSERT_EQ(made.blows.size(), 1U);
            expect_closed(made.blows);
            const Blow& blow = made.blows[0];
            EXPECT_NEAR(blow.before_j, 0.5 * 0.03 * speed * speed, 1e-12);
            EXPECT_EQ(blow.motion_j > 0.0, !fixed);
            EXPECT_GT(blow.modes_j, 0.0);
            EXPECT_GT(blow.peak_n * blow.contact_s, blow.impulse_n_s);
            // Momentum of the head along the normal.
            double sum = 0.0;
            for (const events::Event& event : made.events) sum -= events::calc_impulse(std::get<events::Force>(event))[2];
            EXPECT_NEAR(sum, blow.impulse_n_s, 1e-6 * sum);
          }
        }
      }
    }
  }
}

TEST_F(MalletsOnACube, RigidFixedBodyGivesHertzsPulse) {
  begin(make_bank(0), true);
  const Mallet mallet = make_hard();
  const Strikes made = make(mallet);
  const double stiffness = impact::calc_hertz_stiffness(3e9, 0.3, bank_.material.young_modulus_pa, bank_.material.poisson_ratio, 0.012);
  const double tau = 3.2181 * std::pow(0.03 / (stiffness * std::sqrt(1.5)), 0.4);
  const Blow& blow = made.blows.at(0);
  EXPECT_NEAR(blow.contact_s, tau, 0.06 * tau) << "whole steps, 20 of them";
  EXPECT_NEAR(blow.impulse_n_s, 2.0 * 0.03 * 1.5, 1e-9);
  EXPECT_NEAR(blow.restitution, 1.0, 1e-9);
  EXPECT_NEAR(blow.after_j, blow.before_j, 1e-9 * blow.before_j);
  EXPECT_NEAR(std::get<events::Force>(made.events.at(0)).time_s, 0.01, 1e-12);
}

TEST_F(MalletsOnACube, FeltFollowsItsPowerLaw) {
  begin(make_bank(0), true);
  Mallet mallet = make_felt();
  mallet.restitution = 1.0;
  for (const double exponent : {1.5, 2.5, 3.5}) {
    mallet.felt->exponent = exponent;
    const Blow blow = make(mallet).blows.at(0);
    const double deepest = std::pow(0.5 * (exponent + 1.0) * 0.03 * 1.5 * 1.5 / 2e8, 1.0 / (exponent + 1.0));
    EXPECT_NEAR(blow.peak_n, 2e8 * std::pow(deepest, exponent), 0.02 * blow.peak_n) << exponent;
    EXPECT_NEAR(blow.restitution, 1.0, 1e-9);
  }
}

TEST_F(MalletsOnACube, RestitutionIsThatOnARigidBody) {
  begin(make_bank(0), true);
  for (Mallet mallet : {make_hard(), make_felt()}) {
    for (const double e : {0.2, 0.5, 0.9}) {
      mallet.restitution = e;
      const Blow blow = make(mallet).blows.at(0);
      EXPECT_NEAR(blow.restitution, e, 0.02) << e;
      EXPECT_NEAR(blow.lost_j, (1.0 - blow.restitution * blow.restitution) * blow.before_j, 1e-9);
    }
  }
}

TEST_F(MalletsOnACube, AFreeBodyRecoils) {
  begin(make_bank(0), false);
  const Mallet mallet = make_hard();
  const Blow blow = make(mallet).blows.at(0);
  // At (0.01, 0.02) from the centre: 1/m = 1/m_head + 1/M + (x^2 + y^2)/I.
  const double inverse = 1.0 / 0.03 + 1.0 / 1.0 + (0.01 * 0.01 + 0.02 * 0.02) / (0.01 / 6.0);
  EXPECT_NEAR(blow.impulse_n_s, 2.0 * 1.5 / inverse, 1e-9);
  EXPECT_NEAR(blow.restitution, 1.0, 1e-9);
  EXPECT_GT(blow.motion_j, 0.0);
  // A very heavy head is not stopped: it pushes the body along.
  Mallet heavy = make_hard();
  heavy.mass_kg = 900.0;
  heavy.radius_m = 0.3;
  const Blow pushed = make(heavy).blows.at(0);
  EXPECT_GT(pushed.after_j, 0.98 * pushed.before_j);
  expect_closed({pushed});
}

TEST_F(MalletsOnACube, SoundMatchesTheSolution) {
  begin(make_bank(80), true);
  for (const Mallet& mallet : {make_hard(), make_felt()}) {
    const Strikes made = make(mallet);
    EXPECT_NEAR(play(bank_, made.events, 0.1), made.blows[0].modes_j, 1e-5 * made.blows[0].modes_j);
  }
}

TEST_F(MalletsOnACube, LaterBlowMeetsTheRingingBody) {
  for (const double apart_s : {3e-5, 2e-4, 0.0507}) {
    for (const bool fixed : {true, false}) {
      begin(make_bank(50), fixed);
      add(make_felt(), 0.01);
      add(make_hard(), 0.01 + apart_s, {-0.03, 0.02, 0.05});
      add(make_felt(), 0.01 + 2.0 * apart_s, {-0.05, 0.02, 0.01});
      const Strikes made = make();
      ASSERT_EQ(made.blows.size(), 3U);
      EXPECT_EQ(made.blows[0].together > 1, apart_s < 1e-3);
      expect_closed(made.blows);
      double modes_j = 0.0;
      for (const Blow& blow : made.blows) modes_j += blow.modes_j;
      EXPECT_NEAR(play(bank_, made.events, 0.2), modes_j, 1e-5 * modes_j) << apart_s;
    }
  }
}

TEST_F(MalletsOnACube, FeltExcitesHighModesLess) {
  begin(make_bank(80), true);
  const auto calc_high_share = [&](const Mallet& mallet) {
    const std::vector<events::Event> events = make(mallet).events;
    const double all = play(bank_, events, 0.1);
    bank::Bank high = bank_;
    for (std::size_t m = 0; m < high.mode_count(); ++m) {
      if (std::sqrt(high.eigenvalue_rad2_s2[m]) < 2.0 * kPi * 3000.0) high.shape_scale[m] = 0.0;
    }
    return play(high, events, 0.1) / all;
  };
  const double hard = calc_high_share(make_hard());
  Mallet soft = make_felt();
  soft.felt->stiffness_n_m_p = 1e6;
  EXPECT_LT(calc_high_share(soft), 0.01 * hard);
}

/// Extremes allowed in scenes: from a needle at a micrometre per second to a ton of diamond at the speed of a shot.
TEST_F(MalletsOnACube, ExtremesBalanceEnergy) {
  std::mt19937_64 random(5);
  const auto draw = [&](double low, double high) { return low * std::pow(high / low, static_cast<double>(random() % 10001) / 1e4); };
  for (int trial = 0; trial < 60; ++trial) {
    begin(make_bank(trial % 3 == 0 ? 0 : 30, trial % 2 == 0 ? 0.0 : 20.0), trial % 5 != 0);
    Mallet mallet{.mass_kg = draw(1e-6, 1e3),
                  .speed_m_s = draw(1e-6, 300.0),
                  .restitution = trial % 4 == 0 ? 0.0 : 0.8,
                  .friction = trial % 7 == 0 ? 2.0 : 0.0};
    mallet.direction = Vec3{draw(1e-3, 1.0) / 1.5, -draw(1e-3, 1.0) / 1.5, -1.0};
    if (trial % 2 == 0) {
      mallet.radius_m = draw(1e-4, 10.0);
      mallet.young_modulus_pa = draw(1e2, 1e13);
    } else {
      mallet.felt = Felt{draw(1e-3, 1e30), draw(1.0, 6.0)};
    }
    const Strikes made = make(mallet);
    ASSERT_EQ(made.blows.size(), 1U);
    for (const events::Event& event : made.events) ASSERT_EQ(events::find_fault(event), nullptr) << trial;
    const Blow& blow = made.blows[0];
    const bool is_over = made.warnings.empty() || made.warnings[0].find("still in contact") == std::string::npos;
    // Unfinished contacts keep energy in the spring.
    if (is_over) expect_closed(made.blows, 1e-6);
    EXPECT_TRUE(std::isfinite(blow.impulse_n_s + blow.peak_n + blow.contact_s + blow.restitution)) << trial;
    EXPECT_LE(blow.after_j + blow.motion_j + blow.modes_j + blow.lost_j, blow.before_j * (1.0 + 1e-6)) << trial;
  }
}

TEST_F(MalletsOnACube, MovingAwayIsRefused) {
  begin(make_bank(3), true);
  for (const Vec3& away : {Vec3{0, 0, 1}, Vec3{1, 0, 0}, Vec3{0.9999, 0, -0.01}}) {
    Mallet mallet = make_hard();
    mallet.direction = away;
    tests::expect_error<InputError>({"scene.json:5: the mallet does not move towards the surface"}, [&] { (void)make(mallet); });
  }
}

TEST_F(MalletsOnACube, VaryInSpeedPlaceAndDirection) {
  begin(make_bank(20), true);
  for (int i = 0; i < 300; ++i) add(make_hard(), 0.01 + 0.005 * i);
  const Strikes equal = make();
  scene_.bodies[0].variation = 1.0;
  const Strikes varied = make();
  double mean = 0.0, square = 0.0;
  for (const Blow& blow : varied.blows) {
    const double energy = blow.before_j / equal.blows[0].before_j;
    mean += energy / 300.0;
    square += energy * energy / 300.0;
  }
  EXPECT_NEAR(mean, 1.0, 0.05);
  EXPECT_NEAR(std::sqrt(square - mean * mean), 0.18, 0.04);
}

TEST_F(MalletsOnACube, ExcessiveCompressionIsAWarning) {
  begin(make_bank(3), true);
  Mallet mallet = make_felt();
  mallet.felt->stiffness_n_m_p = 1e3;
  EXPECT_EQ(make(mallet).warnings.size(), 1U);
  EXPECT_EQ(make(make_felt()).warnings.size(), 0U);
  EXPECT_EQ(make(make_hard()).warnings.size(), 0U);
}

TEST_F(MalletsOnACube, LargeIdealImpulseIsAWarning) {
  begin(make_bank(200), true);
  const auto question = [&](double impulse_n_s, double duration_s) {
    SceneStrike strike;
    strike.place = "scene.json:9";
    strike.time_s = 0.1;
    strike.point_m = Vec3{0.0, 0.0, 0.05};
    strike.impulse_n_s = {0, 0, -impulse_n_s};
    strike.duration_s = duration_s;
    scene_.strikes = {strike};
    return make().warnings;
  };
  ASSERT_EQ(question(1.0, 0.0).size(), 1U);
  EXPECT_EQ(question(1.0, 0.0)[0].rfind("scene.json:9: 1 N s on \"cube\" with a \"duration_s\" of 0 puts ", 0), 0U)
      << question(1.0, 0.0)[0];
  EXPECT_EQ(question(0.6, 0.0).size(), 1U) << "72 J";
  EXPECT_TRUE(question(0.01, 0.0).empty());
  EXPECT_TRUE(question(1.0, 1e-3).empty());
}

}  // namespace
}  // namespace carillon::scene
