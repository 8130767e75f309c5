// Losses at supports against closed forms and exact oscillators on their support, and at their limits.
#include "runtime/bank/mounting/losses.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "runtime/base/printable.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::mounting {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
constexpr double kPi = std::numbers::pi;

/// Bank of a few modes with one patch of normal x.
bank::Bank make_bank(const std::vector<double>& reaction, double share = 0.0, double area_m2 = 1e-4) {
  bank::Bank bank = bank::example::make_bank();
  const std::size_t modes = bank.mode_count();
  bank.supports.text = R"({"supports": [{"name": "end"}]})";
  bank.supports.centre_m = {{0.05, -0.09, 0.205}};
  bank.supports.normal = {{1.0, 0.0, 0.0}};
  bank.supports.area_m2 = {area_m2};
  bank.supports.thickness_m = {0.01};
  for (std::size_t m = 0; m < modes; ++m) bank.supports.reaction.insert(bank.supports.reaction.end(), reaction.begin(), reaction.end());
  bank.supports.energy.assign(modes, share);
  return bank;
}

material::Fixing on(const std::string& members) {
  base::Object object = base::parse_document("{" + members + "}", "test").root();
  return *material::read_fixing(object);
}

MountingRequest wish(const std::string& members) { return {.all = on(members)}; }

TEST(Plate, absorbs_normal_forces_by_its_point_impedance) {
  // Cremer and Heckl: Z = 8 sqrt(B m'').
  const bank::Bank bank = make_bank({300.0, 0, 0, 0, 0, 0});
  const Losses losses = calc_losses(
      bank, wish(R"("on": {"young_modulus_pa": 30e9, "poisson_ratio": 0.2, "density_kg_m3": 2300, "thickness_m": 0.1, "loss_factor": 0})"));
  const double z = 8.0 * std::sqrt(30e9 * 1e-3 / (12.0 * 0.96) * 230.0);
  EXPECT_NEAR(z, 2.3 * 2300 * std::sqrt(30e9 / 2300 / 0.96) * 0.01, 0.01 * z) << "the rule of thumb 2.3 rho c_L h^2";
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double lambda = bank.eigenvalue_rad2_s2[m];
    EXPECT_NEAR(losses.decay_per_s[m], 300.0 * 300.0 / z / (2 * lambda), 1e-12 * losses.decay_per_s[m]);
    EXPECT_EQ(losses.shift_rad_s[m], 0.0) << "an infinite plate is purely resistive";
  }
}

TEST(Plate, couple_and_in_plane_admittances_match_closed_forms) {
  const std::string wall =
      R"("on": {"young_modulus_pa": 30e9, "poisson_ratio": 0.2, "density_kg_m3": 2300, "thickness_m": 0.1, "loss_factor": 0})";
  const double b = 30e9 * 1e-3 / (12.0 * 0.96), g = 30e9 / 2.4 * 0.1, e = 30e9 / 0.96 * 0.1;
  const bank::Bank couple = make_bank({0, 0, 0, 0, 2.0, 0}), shear = make_bank({0, 0, 300.0, 0, 0, 0});
  // A force along z, across the normal x, rotates the wall about y: M = -(h / 2) n x F = (h / 2) F y. An opposing couple cancels it.
  const bank::Bank balanced = make_bank({0, 0, 300.0, 0, -0.05 * 300.0, 0});
  const Losses of_couple = calc_losses(couple, wish(wall)), of_shear = calc_losses(shear, wish(wall)),
               rest = calc_losses(balanced, wish(wall));
  for (std::size_t m = 0; m < couple.mode_count(); ++m) {
    const double lambda = couple.eigenvalue_rad2_s2[m], omega = std::sqrt(lambda);
    EXPECT_NEAR(of_couple.decay_per_s[m], 4.0 * omega / (16.0 * b) / (2 * lambda), 1e-10 * of_couple.decay_per_s[m]);
    const double plane = omega / 8.0 * (1.0 / g + 1.0 / e) * 300.0 * 300.0 / (2 * lambda);
    const double arm = 15.0 * 15.0 * omega / (16.0 * b) / (2 * lambda);
    EXPECT_NEAR(of_shear.decay_per_s[m], plane + arm, 1e-10 * of_shear.decay_per_s[m]);
    EXPECT_NEAR(rest.decay_per_s[m], plane, 1e-10 * plane);
    EXPECT_LE(of_couple.shift_rad_s[m], 0.0) << "under the patch the plate is a spring";
  }
}

TEST(Plate, long_edges_match_line_excitation) {
  // A line of length l in an infinite plate: force per length on a beam of unit width, k / (4 m omega), couple omega / (4 B k); over l.
  const std::string wall =
      R"("on": {"young_modulus_pa": 30e9, "poisson_ratio": 0.2, "density_kg_m3": 2300, "thickness_m": 0.1, "loss_factor": 0})";
  const double length = 20.0, b = 30e9 * 1e-3 / (12.0 * 0.96), mass = 230.0;
  const bank::Bank force = make_bank({300.0, 0, 0, 0, 0, 0}, 0.0, 0.01 * length),
                   couple = make_bank({0, 0, 0, 0, 2.0, 0}, 0.0, 0.01 * length);
  const Losses of_force = calc_losses(force, wish(wall)), of_couple = calc_losses(couple, wish(wall));
  for (std::size_t m = 0; m < force.mode_count(); ++m) {
    const double lambda = force.eigenvalue_rad2_s2[m], omega = std::sqrt(lambda), k = std::pow(lambda * mass / b, 0.25);
    EXPECT_NEAR(of_force.decay_per_s[m], 9e4 * k / (4 * mass * omega * length) / (2 * lambda), 1e-9 * of_force.decay_per_s[m]);
    EXPECT_NEAR(of_couple.decay_per_s[m], 4.0 * omega / (4 * b * k * length) / (2 * lambda), 1e-9 * of_couple.decay_per_s[m]);
  }
}

TEST(HalfSpace, absorbs_radiation_and_material_loss) {
  // Concrete under a disc of 5 mm: the spring 3.1e8 N/m, Re Y about 1e-8 at 214 Hz without the material's loss.
  const double a = 5e-3, g = 30e9 / 2.4, omega = 2 * kPi * 214.0;
  const double k = 4 * g * a / 0.8, c = 3.4 * a * a * std::sqrt(2300 * g) / 0.8;
  EXPECT_NEAR(k, 3.1e8, 0.03e8);
  EXPECT_NEAR(c * omega * omega / (k * k), 1e-8, 0.2e-8);
  const bank::Bank bank = make_bank({300.0, 0, 0, 0, 0, 0}, 0.0, kPi * a * a);
  const Losses losses = calc_losses(bank, wish(R"("on": "concrete block")"));
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double lambda = bank.eigenvalue_rad2_s2[m], w = std::sqrt(lambda);
    const double re = c + 0.006 * k / w, im = -k / w;
    EXPECT_NEAR(losses.decay_per_s[m], re / (re * re + im * im) * 9e4 / (2 * lambda), 1e-9 * losses.decay_per_s[m]);
    EXPECT_LT(losses.shift_rad_s[m], 0.0) << "a spring lowers the frequency";
  }
}

TEST(Joint, absorbs_energy_within_one_thickness) {
  const bank::Bank bank = make_bank({300.0, 0, 0, 0, 0, 0}, 0.25);
  const Losses losses = calc_losses(bank, wish(R"("loss": 0.02)"));
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    EXPECT_DOUBLE_EQ(losses.decay_per_s[m], 0.25 * 0.02 * std::sqrt(bank.eigenvalue_rad2_s2[m]) / 2);
    EXPECT_EQ(losses.shift_rad_s[m], 0.0);
  }
}

/// Oscillator whose spring is attached to mass, dashpot and spring, integrated in small steps.
struct Ringing {
  double decay_per_s = 0.0, omega = 0.0;
  double lost_j = 0.0, dissipated_j = 0.0, start_j = 0.0;
};

Ringing ring(double mass, double stiffness, const material::Base& base, int periods) {
  struct State {
    double x, v, u, w;
  };
  const auto slope = [&](const State& s) {
    const double pull = stiffness * (s.x - s.u);
    return State{s.v, -pull / mass, s.w, (pull - base.damping_n_s_m * s.w - base.stiffness_n_m * s.u) / base.mass_kg};
  };
  const auto add = [](const State& a, const State& b, double h) {
    return State{a.x + h * b.x, a.v + h * b.v, a.u + h * b.u, a.w + h * b.w};
  };
  const auto energy = [&](const State& s) {
    return 0.5 * (mass * s.v * s.v + stiffness * (s.x - s.u) * (s.x - s.u) + base.mass_kg * s.w * s.w + base.stiffness_n_m * s.u * s.u);
  };
  const double omega = std::sqrt(stiffness / mass);
  const double fast = std::sqrt((stiffness + base.stiffness_n_m) / base.mass_kg);
  const double h = 0.02 / std::max(omega, fast);
  State s{1e-3, 0, 1e-3 * stiffness / (stiffness + base.stiffness_n_m), 0};
  Ringing result;
  result.start_j = energy(s);
  double first_s = 0, first = 0, last_s = 0, last = 0;
  int peaks = 0;
  for (double t = 0; peaks < periods; t += h) {
    const State a = slope(s), b = slope(add(s, a, h / 2)), c = slope(add(s, b, h / 2)), d = slope(add(s, c, h));
    const State next{s.x + h / 6 * (a.x + 2 * b.x + 2 * c.x + d.x), s.v + h / 6 * (a.v + 2 * b.v + 2 * c.v + d.v),
                     s.u + h / 6 * (a.u + 2 * b.u + 2 * c.u + d.u), s.w + h / 6 * (a.w + 2 * b.w + 2 * c.w + d.w)};
    const double middle = 0.5 * (s.w + next.w);
    result.dissipated_j += h * base.damping_n_s_m * (s.w * s.w + 4 * middle * middle + next.w * next.w) / 6;
    if (s.v > 0 && next.v <= 0) {  // a maximum of x
      const double at = t + h * s.v / (s.v - next.v);
      if (peaks++ == 2) {
        first_s = at;
        first = energy(next);
      }
      last_s = at;
      last = energy(next);
    }
    s = next;
  }
  result.lost_j = result.start_j - energy(s);
  result.decay_per_s = 0.5 * std::log(first / last) / (last_s - first_s);
  result.omega = 2 * kPi * (peaks - 3) / (last_s - first_s);
  return result;
}

TEST(FirstOrder, matches_an_oscillator_on_its_support) {
  // r = omega^2 sqrt(M): the whole mass moves. Springs 100 and 1000 times as stiff as the body's.
  const double mass = 0.4, omega = 2 * kPi * 300.0, stiffness = mass * omega * omega;
  for (const double ratio : {30.0, 300.0}) {
    const material::Base base{.kind = material::BaseKind::kLumped,
                              .mass_kg = 0.02,
                              .damping_n_s_m = 0.2 * ratio * stiffness / omega,
                              .stiffness_n_m = ratio * stiffness};
    bank::Bank bank = make_bank({omega * omega * std::sqrt(mass), 0, 0, 0, 0, 0});
    for (double& lambda : bank.eigenvalue_rad2_s2) lambda = omega * omega;
    const Losses losses = calc_losses(bank, {.all = material::Fixing{base, "", 0.0}});
    const Ringing exact = ring(mass, stiffness, base, 40);
    EXPECT_NEAR(losses.decay_per_s[0] / exact.decay_per_s, 1.0, 3.0 / ratio);
    EXPECT_NEAR(losses.shift_rad_s[0] / (exact.omega - omega), 1.0, 3.0 / ratio);
    EXPECT_NEAR(exact.lost_j, exact.dissipated_j, 1e-6 * exact.start_j) << "energy balance: loss equals dissipation in the support";
    // The same by modal decay: energy falls as exp(-2 d t), over the same 40 periods to first order.
    const double left = std::exp(-2 * losses.decay_per_s[0] * 40 * 2 * kPi / exact.omega);
    EXPECT_NEAR((1 - left) * exact.start_j / exact.dissipated_j, 1.0, 0.05);
  }
}

TEST(Holder, matches_an_oscillator_with_dashpot_or_spring) {
  const bank::Bank bank = bank::example::make_bank();
  const std::size_t vertex = bank.triangles[5][1];
  const Vec3 at = bank.vertices_m[vertex];
  const auto held = [&](const material::Base& by) { return calc_losses(bank, {.held = {{by, at}}}); };
  const Losses cord = held({.kind = material::BaseKind::kLumped, .damping_n_s_m = 0.2}),
               pad = held({.kind = material::BaseKind::kLumped, .stiffness_n_m = 2e4, .loss_factor = 0.3}),
               skin = held({.kind = material::BaseKind::kLumped, .mass_kg = 5e-4});
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const Vec3 phi = bank.shape_at(vertex, m);
    const double square = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2], omega = std::sqrt(bank.eigenvalue_rad2_s2[m]);
    EXPECT_NEAR(cord.decay_per_s[m], 0.1 * square, 1e-9 * square);
    EXPECT_EQ(cord.shift_rad_s[m], 0.0);
    // A spring in parallel: omega'^2 = omega^2 + k (1 + i eta) phi^2; a mass: omega'^2 = omega^2 / (1 + m phi^2).
    EXPECT_NEAR(pad.decay_per_s[m], 0.3 * 2e4 * square / (2 * omega), 1e-9 * pad.decay_per_s[m]);
    EXPECT_NEAR(pad.shift_rad_s[m], std::sqrt(omega * omega + 2e4 * square) - omega, 0.01 * pad.shift_rad_s[m] + 1e-9);
    EXPECT_NEAR(skin.shift_rad_s[m], omega / std::sqrt(1 + 5e-4 * square) - omega, 0.01 * std::abs(skin.shift_rad_s[m]));
    EXPECT_EQ(skin.decay_per_s[m], 0.0);
  }
}

TEST(Limits, nodes_and_zero_impedance_absorb_nothing) {
  const bank::Bank bank = make_bank({0, 0, 0, 0, 0, 0});
  for (const std::string& name : material::list_base_names()) {
    const Losses losses = calc_losses(bank, wish("\"on\": " + base::quote(name)));
    for (const double d : losses.decay_per_s) EXPECT_EQ(d, 0.0) << name;
    for (const double shift : losses.shift_rad_s) EXPECT_EQ(shift, 0.0) << name;
  }
  const Losses none = calc_losses(bank, {.held = {{material::Base{.kind = material::BaseKind::kLumped}, bank.vertices_m[0]}}});
  for (const double d : none.decay_per_s) EXPECT_EQ(d, 0.0);
}

TEST(Limits, an_empty_request_changes_nothing) {
  const bank::Bank before = make_bank({300.0, 20.0, 1.0, 2.0, 3.0, 4.0}, 0.3);
  for (const MountingRequest& wanted : {MountingRequest{}, wish(R"("on": "rigid")")}) {
    const Losses losses = calc_losses(before, wanted);
    EXPECT_TRUE(losses.is_empty());
    bank::Bank after = before;
    apply(losses, after);
    EXPECT_EQ(after.decay_per_s, before.decay_per_s);
    EXPECT_EQ(after.eigenvalue_rad2_s2, before.eigenvalue_rad2_s2);
    EXPECT_EQ(after.damping.law, before.damping.law);
    EXPECT_THAT(describe(losses, before), IsEmpty());
  }
}

TEST(Limits, soft_walls_give_a_bounded_decay_and_a_warning) {
  for (const double softer : {1e2, 1e6, 1e12}) {
    for (const double area : {1e-4, 1e-12, 0.0}) {
      bank::Bank before = make_bank({0.4, 0.3, 0.2, 0.01, 0.01, 0.02}, 0.3, area);  // fractions of sqrt(mass)
      for (std::size_t i = 0; i < before.supports.reaction.size(); ++i) before.supports.reaction[i] *= before.eigenvalue_rad2_s2[i / 6];
      material::Fixing fixing = on(R"("on": "plasterboard wall", "joint": "glued")");
      fixing.base.young_modulus_pa /= softer;
      const Losses losses = calc_losses(before, {.all = fixing});
      EXPECT_EQ(losses.beyond, before.mode_count());
      EXPECT_THAT(describe_limits(losses, before), HasSubstr("first order"));
      bank::Bank after = before;
      apply(losses, after);
      for (std::size_t m = 0; m < before.mode_count(); ++m) {
        const double omega = std::sqrt(before.eigenvalue_rad2_s2[m]);
        EXPECT_TRUE(std::isfinite(after.decay_per_s[m]));
        EXPECT_LE(losses.decay_per_s[m], 0.3 * omega * (1 + 1e-12));
        EXPECT_EQ(losses.shift_rad_s[m], 0.0);
      }
      EXPECT_THAT(bank::find_faults(after), IsEmpty());
    }
  }
}

TEST(Limits, degenerate_patches_give_finite_results) {
  for (const double area : {0.0, 1e-30, 1e-4, 1e6}) {
    bank::Bank bank = make_bank({3.0, 2.0, 1.0, 0.1, 0.2, 0.3}, 0.1, area);
    for (const bool has_normal : {true, false}) {
      if (!has_normal) bank.supports.normal[0] = {};
      for (const std::string& name : material::list_base_names()) {
        const Losses losses = calc_losses(bank, wish("\"on\": " + base::quote(name) + ", \"joint\": \"screwed\""));
        for (const double d : losses.decay_per_s) EXPECT_TRUE(std::isfinite(d) && d > 0.0) << name << " " << area;
        for (const double shift : losses.shift_rad_s) EXPECT_TRUE(std::isfinite(shift)) << name << " " << area;
      }
    }
  }
}

TEST(Limits, modes_keep_their_order) {
  bank::Bank bank = make_bank({3000.0, 0, 0, 0, 1.0, 0}, 0.3);
  bank.eigenvalue_rad2_s2[1] = bank.eigenvalue_rad2_s2[0] * (1 + 1e-9);
  bank.decay_per_s[1] = bank::calc_decay(bank.damping, bank.material, bank.eigenvalue_rad2_s2[1]);
  bank.proof.reset();
  bank.supports.reaction[6] *= 3;  // shifts the second mode further down
  const Losses losses = calc_losses(bank, wish(R"("on": {"stiffness_n_m": 1e9, "loss_factor": 0.1})"));
  EXPECT_LT(losses.shift_rad_s[1], losses.shift_rad_s[0]);
  EXPECT_GT(losses.mixed, 0U);
  apply(losses, bank);
  EXPECT_THAT(bank::find_faults(bank), IsEmpty());
}

TEST(Names, select_supports_and_unknown_ones_are_rejected) {
  bank::Bank bank = make_bank({300.0, 0, 0, 0, 0, 0}, 0.25);
  EXPECT_THAT(list_names(bank), testing::ElementsAre("end"));
  MountingRequest wanted;
  wanted.by_name["end"] = on(R"("loss": 0.02)");
  EXPECT_GT(calc_losses(bank, wanted).decay_per_s[0], 0.0);
  MountingRequest wrong;
  wrong.by_name["ent"] = on(R"("loss": 0.02)");
  tests::expect_error<InputError>({"did you mean \"end\"?"}, [&] { calc_losses(bank, wrong); });
  const bank::Bank free = bank::example::make_bank();
  EXPECT_THROW(calc_losses(free, wish(R"("on": "brick wall")")), InputError);
  EXPECT_TRUE(calc_losses(free, {}).is_empty());
  bank.supports.text = R"({"supports": [{"name": "end", "on": "brick wall", "joint": "screwed"}]})";
  EXPECT_GT(calc_losses(bank, {}).decay_per_s[0], 0.0) << "supports of the bank";
  EXPECT_TRUE(calc_losses(bank, wish(R"("on": "rigid")")).is_empty()) << "the scene overrides the bank";
  bank.supports.text = R"({"supports": [{"name": "end"}, {"name": "more"}]})";
  EXPECT_THROW(calc_losses(bank, {}), InputError);
  bank.supports.text = "{";
  EXPECT_THROW(calc_losses(bank, {}), InputError);
}

TEST(Description, names_support_and_reverberation_times) {
  const bank::Bank bank = make_bank({300.0, 0, 0, 0, 0, 0}, 0.25);
  const std::string text = describe(calc_losses(bank, wish(R"("on": "brick wall", "joint": "screwed")")), bank);
  EXPECT_THAT(text, HasSubstr("end on brick wall, screwed"));
  EXPECT_THAT(text, HasSubstr("T60 at"));
  EXPECT_THAT(text, HasSubstr("instead of"));
}

}  // namespace
}  // namespace carillon::mounting
