// Large-motion coupling of bodies with known modes: hardening against closed forms of beams and plates, energies against quadrature.
#include <gtest/gtest.h>

#include <random>

#include "precompute/analytic/flat_bodies.hpp"
#include "precompute/analytic/make_bank.hpp"
#include "runtime/base/error.hpp"
#include "runtime/synth/nonlinear/coupled_modes.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/analytic/bodies.hpp"

namespace carillon::analytic {
namespace {

using std::numbers::pi;

const std::string kSteel = make_material(200e9, 0.3, 7850);
const std::string kStretch = R"(, "nonlinear": "stretch")";

/// A body with coupling of its lowest modes.
struct Coupled {
  std::unique_ptr<KnownBody> body;
  job::JobSpec job;
  std::vector<Mode> modes;
  bank::QuarticEnergy energy;

  Coupled(const std::string& text, double high_hz, std::size_t count, bool is_stretch) : job(parse(text, kSteel)) {
    body = make(job);
    for (const Mode& mode : body->list_modes(high_hz, kAll).modes)
      if (body->is_coupled(mode) && modes.size() < count) modes.push_back(mode);
    EXPECT_EQ(modes.size(), count) << text;
    energy = body->calc_coupling(modes, job.material, is_stretch);
    for (std::size_t i = 0; i < count; ++i) energy.modes.push_back(static_cast<std::int32_t>(i));
    EXPECT_EQ(bank::find_size_fault(energy), "") << text;
  }
  double calc(const std::vector<double>& q) const {
    std::vector<double> gradient(q.size());
    return bank::calc_energy_j(energy, q, gradient);
  }
  /// gamma of mode i alone, q'' + lambda q (1 + gamma (W / length)^2) = 0 for the largest deflection W.
  double calc_gamma(std::size_t i, double length_m, const std::vector<Vec3>& points) const {
    double peak = 0.0;
    std::vector<Vec3> phi(modes.size());
    for (const Vec3& point : points) {
      body->calc_shapes(point, modes, phi);
      peak = std::max(peak, norm(phi[i]));
    }
    std::vector<double> q(modes.size());
    q[i] = 1.0;
    return 4.0 * calc(q) * length_m * length_m / (modes[i].lambda_rad2_s2 * peak * peak);
  }
  /// Deflections of a motion at a point.
  Vec3 calc_deflection(const std::vector<double>& q, const Vec3& point) const {
    std::vector<Vec3> phi(modes.size());
    body->calc_shapes(point, modes, phi);
    Vec3 w{};
    for (std::size_t i = 0; i < q.size(); ++i) w = w + q[i] * phi[i];
    return w;
  }
};

std::vector<Vec3> make_line(double length_m) {
  std::vector<Vec3> points;
  for (int i = 0; i <= 4000; ++i) points.push_back({length_m * i / 4000.0, 0.0, 0.0});
  return points;
}

std::vector<double> draw(std::size_t count, unsigned seed, double size) {
  std::mt19937 chance(seed);
  std::vector<double> q;
  for (std::size_t i = 0; i < count; ++i) q.push_back(size * (static_cast<double>(chance() % 2001) / 1000.0 - 1.0));
  return q;
}

std::string make_beam(const std::string& ends, const std::string& more = "") {
  return R"({"beam": {"length_m": 0.5, "width_m": 0.02, "thickness_m": 0.001, "ends": )" + ends + more + "}}";
}

TEST(KnownCoupling, of_beams_hardens_as_in_closed_form) {
  // Woinowsky-Krieger 1950; thickness 1 mm along z, 20 mm along y.
  const auto check = [](const std::string& ends, std::vector<double> wanted, const std::string& more, double tolerance) {
    const Coupled beam(make_beam(ends, more), 900.0, 5, true);
    std::size_t found = 0;
    for (std::size_t i = 0; i < beam.modes.size() && found < wanted.size(); ++i)
      if (beam.modes[i].index[0] == 2) {
        EXPECT_NEAR(beam.calc_gamma(i, 1e-3, make_line(0.5)) / wanted[found], 1.0, tolerance) << ends << more << found;
        ++found;
      }
    EXPECT_EQ(found, wanted.size());
  };
  check(R"("hinged")", {3.0, 3.0, 3.0}, "", 2e-6);
  check(R"("clamped")", {0.719293030305, 1.46864680022}, "", 2e-6);
  check(R"(["clamped", "hinged"])", {1.46864680022}, "", 2e-6);
  check(R"("clamped")", {0.719293030305, 1.46864680022}, R"(, "theory": "timoshenko")", 1e-3);
}

TEST(KnownCoupling, of_strings_and_beams_is_the_stretch_by_both_planes) {
  const auto check = [](const std::string& text, double length_m, double rigidity_n, double high_hz, std::size_t count) {
    const Coupled body(text, high_hz, count, true);
    EXPECT_EQ(body.energy.row_count(), 1u);
    const std::vector<double> q = draw(count, 3, 1e-3);
    constexpr int kPieces = 4000;
    double sum = 0.0;  // integral of w_x^2 by the midpoint rule
    Vec3 before = body.calc_deflection(q, {0, 0, 0});
    for (int i = 1; i <= kPieces; ++i) {
      const Vec3 after = body.calc_deflection(q, {length_m * i / kPieces, 0, 0}), step = after - before;
      sum += (step[1] * step[1] + step[2] * step[2]) * kPieces / length_m;
      before = after;
    }
    EXPECT_NEAR(body.calc(q) / (rigidity_n * sum * sum / (8.0 * length_m)), 1.0, 1e-4) << text;
  };
  check(R"({"string": {"length_m": 0.65, "tension_n": 70, "diameter_m": 0.001}})", 0.65, 200e9 * pi / 4.0 * 1e-6, 2000.0, 12);
  check(R"({"string": {"length_m": 0.65, "tension_n": 70, "mass_kg_m": 0.004}})", 0.65, 200e9 * 0.004 / 7850, 2000.0, 12);
  check(make_beam(R"("clamped")"), 0.5, 200e9 * 2e-5, 3000.0, 8);
  check(make_beam(R"(["hinged", "clamped"])"), 0.5, 200e9 * 2e-5, 3000.0, 8);
  check(make_beam(R"("clamped")", R"(, "theory": "timoshenko")"), 0.5, 200e9 * 2e-5, 3000.0, 8);
}

TEST(KnownCoupling, of_degenerate_pairs_does_not_see_how_they_are_turned) {
  // Rotation of the body about its axis rotates pairs of m nodal diameters by m times the angle.
  const auto check = [](const std::string& text, double high_hz, std::size_t count, bool is_round = false) {
    const Coupled body(text, high_hz, count, true);
    const std::vector<double> q = draw(count, 5, 1e-4);
    std::vector<double> turned = q;
    std::size_t pairs = 0;
    for (std::size_t i = 0; i + 1 < count; ++i) {
      if (body.modes[i + 1].lambda_rad2_s2 > body.modes[i].lambda_rad2_s2 * (1.0 + 1e-9)) continue;
      const double angle = 0.7 * (is_round ? body.modes[i].index[0] : 1), c = std::cos(angle), s = std::sin(angle);
      turned[i] = c * q[i] - s * q[i + 1];
      turned[i + 1] = s * q[i] + c * q[i + 1];
      ++pairs;
    }
    EXPECT_GT(body.calc(q), 0.0);
    EXPECT_NEAR(body.calc(turned) / body.calc(q), 1.0, 1e-6) << text;
    EXPECT_GT(pairs, 1u) << text;
  };
  check(R"({"string": {"length_m": 0.65, "tension_n": 70, "diameter_m": 0.001}})", 2000.0, 12);
  check(R"({"beam": {"length_m": 0.65, "diameter_m": 0.002, "ends": "clamped"}})", 2000.0, 8);
  check(R"({"membrane": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.4, "lowest_hz": 100, "thickness_m": 2e-4}})", 600.0, 12);
  check(R"({"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 100, "thickness_m": 2e-4}})", 600.0, 12, true);
  check(R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 1e-3, "edges": "clamped"}})", 2000.0, 10, true);
}

std::string make_plate(double a, double b, const std::string& edges = R"("hinged")") {
  return R"({"plate": {"shape": "rectangle", "length_m": )" + std::to_string(a) + R"(, "width_m": )" + std::to_string(b) +
         R"(, "thickness_m": 0.001, "edges": )" + edges + "}}";
}

TEST(KnownCoupling, of_hinged_plates_hardens_as_in_closed_form) {
  // Chu and Herrmann 1956; by all rows and by the two rows of the mean stretch.
  for (const auto& [ratio, gamma] : {std::pair(1.0, 1.31625), {4.0 / 3.0, 1.384164}, {2.0, 1.6281}})
    for (const bool is_stretch : {false, true}) {
      const Coupled plate(make_plate(0.3 * ratio, 0.3), 2000.0, 6, is_stretch);
      const Vec3 middle{0.15 * ratio, 0.15, 0.0};
      EXPECT_NEAR(plate.calc_gamma(0, 1e-3, {middle}) / gamma, 1.0, 1e-6) << ratio << is_stretch;
      EXPECT_EQ(plate.energy.row_count() == 2, is_stretch);
    }
}

TEST(KnownCoupling, of_hinged_plates_is_von_karmans_energy) {
  constexpr double kA = 0.4, kB = 0.3, kH = 1e-3, kE = 200e9, kNu = 0.3, kArea = kA * kB;
  const Coupled plate(make_plate(kA, kB), 2000.0, 9, false);
  const std::vector<double> q = draw(9, 11, 1e-3);
  // Right-hand side of Airy's equation on a grid, from second derivatives of sines; its cosine coefficients; the energy of each.
  constexpr int kGrid = 48;
  const double scale = 2.0 / std::sqrt(7850 * kH * kArea);
  std::vector<double> right(kGrid * kGrid);
  double mean_x = 0.0, mean_y = 0.0;
  const auto at = [](int i, double side) { return side * (i + 0.5) / kGrid; };
  for (int i = 0; i < kGrid; ++i)
    for (int j = 0; j < kGrid; ++j) {
      double x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
      for (std::size_t m = 0; m < q.size(); ++m) {
        const double a = plate.modes[m].index[0] * pi / kA, b = plate.modes[m].index[1] * pi / kB;
        const double sx = std::sin(a * at(i, kA)), cx = std::cos(a * at(i, kA)), sy = std::sin(b * at(j, kB)), cy = std::cos(b * at(j, kB));
        x += scale * q[m] * a * cx * sy;
        y += scale * q[m] * b * sx * cy;
        xx -= scale * q[m] * a * a * sx * sy;
        yy -= scale * q[m] * b * b * sx * sy;
        xy += scale * q[m] * a * b * cx * cy;
      }
      right[i * kGrid + j] = xy * xy - xx * yy;
      mean_x += 0.5 * x * x / (kGrid * kGrid);
      mean_y += 0.5 * y * y / (kGrid * kGrid);
    }
  double wanted = kArea * kE * kH / (2.0 * (1.0 - kNu * kNu)) * (mean_x * mean_x + mean_y * mean_y + 2.0 * kNu * mean_x * mean_y);
  for (int k = 0; k < 16; ++k)
    for (int l = k == 0 ? 1 : 0; l < 16; ++l) {
      double sum = 0.0;
      for (int i = 0; i < kGrid; ++i)
        for (int j = 0; j < kGrid; ++j)
          sum += right[i * kGrid + j] * std::cos(k * pi * (i + 0.5) / kGrid) * std::cos(l * pi * (j + 0.5) / kGrid);
      sum *= kArea / (kGrid * kGrid);  // integral of the right-hand side times the product
      const double norm = kArea * (k > 0 ? 0.5 : 1.0) * (l > 0 ? 0.5 : 1.0), wave = std::pow(k * pi / kA, 2) + std::pow(l * pi / kB, 2);
      wanted += 0.5 * kE * kH * sum * sum / (norm * wave * wave);
    }
  EXPECT_NEAR(plate.calc(q) / wanted, 1.0, 1e-6);
}

/// Pitch of mode (1, 1) in windows of 0.1 s [Hz], from upward zero crossings: three impulses of 0.3 N s, 1 ms long, at 0, 0.4 and 0.8 s.
std::vector<double> strike_three_times(const Coupled& plate, double rate_hz) {
  const std::size_t count = plate.modes.size();
  std::vector<nonlinear::ModeConstants> constants;
  for (const Mode& mode : plate.modes) constants.push_back({mode.lambda_rad2_s2, 6.0 * (1.0 + 2e-8 * mode.lambda_rad2_s2)});
  nonlinear::CoupledModes modes(plate.energy, constants, rate_hz);
  std::vector<Vec3> phi(count);
  plate.body->calc_shapes({0.37 * 0.4, 0.41 * 0.3, 0.0}, plate.modes, phi);
  const auto share = [](double since_s) {  // of the impulse
    const double t = std::clamp(since_s / 1e-3, 0.0, 1.0);
    return t - std::sin(2.0 * pi * t) / (2.0 * pi);
  };
  std::vector<double> re(count), im(count, 0.0), window_hz;
  const auto window = static_cast<int>(std::lround(0.1 * rate_hz));
  double before = 0.0, first = 0.0, last = 0.0;
  int crossings = 0;
  for (int n = 1; n <= 16 * window; ++n) {
    double impulse = 0.0;
    for (const double begin_s : {0.0, 0.4, 0.8}) impulse += 0.3 * (share(n / rate_hz - begin_s) - share((n - 1) / rate_hz - begin_s));
    for (std::size_t i = 0; i < count; ++i) re[i] = impulse * phi[i][2];
    modes.step(re, im);
    const double q = modes.get_amplitude(0);
    if (before < 0.0 && q >= 0.0) {
      last = n - 1 + before / (before - q);
      if (crossings++ == 0) first = last;
    }
    before = q;
    if (n % window != 0) continue;
    window_hz.push_back((crossings - 1) * rate_hz / (last - first));
    crossings = 0;
  }
  return window_hz;
}

TEST(KnownCoupling, of_hinged_plates_glides_as_a_computation_at_384_kHz) {
  // From an independent program: Verlet's method at 384 kHz, 30 modes. After the second impulse the strong motion is chaotic.
  const std::vector<double> wanted_hz{94.11, 64.93, 50.05, 44.56};
  const Coupled plate(make_plate(0.4, 0.3), 2000.0, 30, false);
  const std::vector<double> found_hz = strike_three_times(plate, 48000.0);
  for (std::size_t w = 0; w < wanted_hz.size(); ++w) EXPECT_NEAR(found_hz[w] / wanted_hz[w], 1.0, 0.01) << w;
  EXPECT_NEAR(1200.0 * std::log2(found_hz[15] / 41.66), 0.0, 1.0);
}

TEST(KnownCoupling, of_flat_bodies_by_one_row_is_bergers) {
  // The mean square of the slope by differences of deflections on a grid.
  const auto check = [](const std::string& text, double high_hz, const Vec3& low, const Vec3& size,
                        const std::function<bool(double, double)>& is_in) {
    const Coupled body(text, high_hz, 7, true);
    ASSERT_EQ(body.energy.row_count(), 1u);
    const std::vector<double> q = draw(7, 13, 1e-3);
    constexpr int kGrid = 80;
    constexpr double kStep = 1e-5;
    double sum = 0.0, area = 0.0;
    for (int i = 0; i < kGrid; ++i)
      for (int j = 0; j < kGrid; ++j) {
        const double x = low[0] + size[0] * (i + 0.5) / kGrid, y = low[1] + size[1] * (j + 0.5) / kGrid;
        if (!is_in(x, y)) continue;
        const double cell = size[0] * size[1] / (kGrid * kGrid);
        const double by_x = body.calc_deflection(q, {x + kStep, y, 0})[2] - body.calc_deflection(q, {x - kStep, y, 0})[2];
        const double by_y = body.calc_deflection(q, {x, y + kStep, 0})[2] - body.calc_deflection(q, {x, y - kStep, 0})[2];
        sum += cell * (by_x * by_x + by_y * by_y) / (4.0 * kStep * kStep);
        area += cell;
      }
    const double strain = 0.5 * sum / area;
    EXPECT_NEAR(body.calc(q) / (0.5 * 200e9 * body.energy.thickness_m / (1.0 - 0.09) * area * strain * strain), 1.0, 0.03) << text;
  };
  const auto is_in_disc = [](double x, double y) { return std::hypot(x, y) < 0.2; };
  const auto is_in_all = [](double, double) { return true; };
  check(R"({"membrane": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "lowest_hz": 100, "thickness_m": 2e-4}})", 600.0, {0, 0, 0},
        {0.4, 0.3, 0}, is_in_all);
  check(R"({"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 100, "thickness_m": 2e-4}})", 600.0, {-0.2, -0.2, 0},
        {0.4, 0.4, 0}, is_in_disc);
  for (const char* edges : {"clamped", "hinged"})
    check(R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 1e-3, "edges": ")" + std::string(edges) + R"("}})", 2000.0,
          {-0.2, -0.2, 0}, {0.4, 0.4, 0}, is_in_disc);
  check(R"({"membrane": {"shape": "L", "side_m": 0.2, "lowest_hz": 300, "density_kg_m2": 0.3}})", 1500.0, {0, 0, 0}, {0.4, 0.4, 0},
        [](double x, double y) { return x < 0.2 || y < 0.2; });
  check(make_plate(0.4, 0.3, R"(["clamped", "hinged", "clamped", "clamped"])"), 2000.0, {0, 0, 0}, {0.4, 0.3, 0}, is_in_all);
}

TEST(KnownCoupling, of_a_clamped_disc_hardens_as_by_von_karman) {
  // 0.500843 at nu = 0.3: the axisymmetric energy of von Karman's plate with an immovable rim, its radial displacement by 4,000 elements.
  const Coupled disc(R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 1e-3, "edges": "clamped"}})", 500.0, 3, true);
  EXPECT_NEAR(disc.calc_gamma(0, 1e-3, {{0, 0, 0}}) / 0.500843, 1.0, 0.01);
}

TEST(KnownCoupling, is_in_banks_that_are_sane) {
  for (const std::string body :
       {R"({"string": {"length_m": 0.65, "tension_n": 70, "diameter_m": 0.001}})",
        R"({"beam": {"length_m": 0.4, "width_m": 0.03, "thickness_m": 0.002, "ends": "clamped"}})",
        R"({"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 150, "density_kg_m2": 0.3}})",
        R"({"plate": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.002, "edges": "hinged"}})",
        R"({"plate": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.002, "edges": "clamped"}})",
        R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 0.002, "edges": "hinged"}})"}) {
    const Made made = make_bank(parse(body, R"("steel")", R"(, "band_hz": [20, 2000])" + kStretch));
    const std::vector<std::string> faults = bank::find_faults(made.bank);
    EXPECT_TRUE(faults.empty()) << body << faults[0];
    EXPECT_LE(made.bank.quartic.row_count(), 2u) << body;
    EXPECT_GT(made.bank.quartic.mode_count(), 0u) << body;
    EXPECT_GT(made.bank.quartic.membrane_ratio, 0.0) << body;
    EXPECT_FALSE(made.coupling.empty());
  }
  const Made plate = make_bank(parse(make_plate(0.3, 0.3), kSteel, R"(, "band_hz": [20, 4000], "nonlinear": {"modes": 7})"));
  EXPECT_TRUE(bank::find_faults(plate.bank).empty());
  EXPECT_GT(plate.bank.quartic.row_count(), 20u);
  EXPECT_EQ(plate.bank.quartic.mode_count(), 6u);  // (1, 1), two pairs and one between; the seventh is half of a pair
  const Made high = make_bank(parse(make_plate(0.3, 0.3), kSteel, R"(, "band_hz": [300, 4000], "nonlinear": {"below_hz": 310})"));
  EXPECT_TRUE(high.bank.quartic.is_empty());
  EXPECT_FALSE(high.warnings.empty());
}

TEST(KnownCoupling, is_refused_where_there_is_none) {
  const auto expect_refused = [](const std::string& body, const std::string& nonlinear, const std::string& words) {
    tests::expect_error<InputError>({words}, [&] { (void)parse(body, kSteel, R"(, "nonlinear": )" + nonlinear); });
  };
  expect_refused(make_beam(R"("free")"), R"("stretch")", "no mean stretch");
  expect_refused(make_beam(R"(["clamped", "sliding"])"), R"("stretch")", "no mean stretch");
  expect_refused(make_plate(0.4, 0.3, R"("free")"), R"("stretch")", "no mean stretch");
  expect_refused(make_plate(0.4, 0.3, R"(["clamped", "clamped", "free", "clamped"])"), R"("stretch")", "no mean stretch");
  expect_refused(R"({"plate": {"shape": "circle", "radius_m": 0.2, "thickness_m": 1e-3, "edges": "sliding"}})", R"("stretch")",
                 "no mean stretch");
  expect_refused(make_plate(0.4, 0.3, R"("clamped")"), "{}", "stretch");
  expect_refused(R"({"string": {"length_m": 0.65, "tension_n": 70, "diameter_m": 0.001}})", "{}", "stretch");
  expect_refused(make_plate(0.4, 0.3), R"({"energy_error": 1e-3})", "energy_error");
  expect_refused(make_plate(0.4, 0.3), R"({"modes": 201})", "modes");
  expect_refused(make_plate(0.4, 0.3), R"({"form": "short"})", "form");
  expect_refused(make_plate(0.4, 0.3), R"("full")", "nonlinear");
}

}  // namespace
}  // namespace carillon::analytic
