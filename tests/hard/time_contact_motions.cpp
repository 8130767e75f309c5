// Hard cases of contact: spinning, rolling, sliding, bouncing and balancing bodies, thin and tiny ones, bodies inside others. Against
// closed forms and the energy balance.
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <utility>

#include "tests/hard/contact_course.hpp"
#include "tests/hard/figure.hpp"
#include "tests/unit/runtime/physics/plate_bank.hpp"

namespace carillon::hard {
namespace {

using physics::tests::rotate;

std::array<double, 4> make_turn_about_y(double angle) { return {std::cos(angle / 2), 0, std::sin(angle / 2), 0}; }

BodySpec make_fixed(const bank::Bank& bank, Vec3 position, double restitution = 0.3) {
  BodySpec body = make_body(bank, position, restitution);
  body.fixed = true;
  return body;
}

/// The inside of a hemispherical basin below z = 0, and a wall of a tenth of its radius about it.
geometry::tests::Solid make_basin(double radius_m) {
  std::vector<std::array<double, 2>> outline;
  const int rings = 32;
  for (int i = 0; i <= rings; ++i) {
    const double angle = 0.5 * M_PI * i / rings;
    outline.push_back({1.1 * radius_m * std::sin(angle), -1.1 * radius_m * std::cos(angle)});
  }
  for (int i = rings; i >= 0; --i) {
    const double angle = 0.5 * M_PI * i / rings;
    outline.push_back({radius_m * std::sin(angle), -radius_m * std::cos(angle)});
  }
  return geometry::tests::make_lathe(outline, 64, false);
}

TEST(time, contact_thin_plate) {
  const bank::Bank plate = physics::tests::make_plate_bank(0.3, 0.002, 8e3, 16, 3.0);
  const double weight = plate.rigid.mass_kg * kGravity;
  for (int turn = 0; turn < 4; ++turn) {
    WorldSpec spec;
    spec.ground = GroundSpec{};
    spec.bodies = {make_body(plate, {0, 0, 0.6}, 1.0)};
    spec.bodies[0].initial.rotation = {1.0, 0.15 * turn * std::cos(turn), 0.15 * turn * std::sin(turn), 0.0};
    World world(spec, {.end_s = 1.0, .audits_energy = true});
    std::vector<double> modes_j(1, 0.0);  // after each window
    double share = 0.0, error = 0.0;
    for (int window = 1; window <= 500; ++window) {
      world.advance(2e-3 * window, 1e9, [&](const events::Event& e) {
        const auto* m = std::get_if<events::BodyMotion>(&e);  // comes up to a window later
        const auto k = m == nullptr ? 0 : static_cast<std::size_t>(std::lround(m->time_s / 2e-3));
        if (k == 0 || k >= modes_j.size() || std::abs(m->time_s - 2e-3 * static_cast<double>(k)) > 1e-9) return;
        const double v = norm(m->velocity_m_s), lost = weight * (0.6 - m->position_m[2]) - 0.5 * plate.rigid.mass_kg * v * v;
        if (modes_j[k] > 1e-6) share = std::max(share, modes_j[k] / lost);
      });
      const physics::EnergyAudit energy = world.get_statistics().energy;
      modes_j.push_back(energy.modes_j);
      error = std::max(error, energy.error_j / energy.start_j);
    }
    const std::string part = "throw " + std::to_string(turn);
    hold("contact_thin_plate", share, 1.0, part + ", modes over what fall and speed of the centre lost");
    hold("contact_thin_plate", error, 0.01, part + ", books, relative");
  }
}

TEST(time, contact_ball_in_bowl) {
  const bank::Bank basin = make_bank(make_basin(0.1), 2700.0), ball = make_round(0.02, 6);
  WorldSpec spec;
  const double a = 0.5;
  spec.bodies = {make_body(ball, {0.08 * std::sin(a), 0, -0.08 * std::cos(a)}), make_fixed(basin, {})};
  spec.bodies[0].velocity_m_s = {0, 0.2, 0};
  const Course course = run(spec, 300.0, 600.0);
  hold("contact_ball_in_bowl", calc_drift(course), 0.0, "way in the last five minutes [m]");
  hold("contact_ball_in_bowl", norm(course.end[0].position_m - Vec3{0, 0, -0.08}), 1e-3, "from the lowest place [m]");
  hold("contact_ball_in_bowl", calc_rise(course), 1e-5, "energy gained as a height [m]");
}

TEST(time, contact_sleeps_apart) {
  // A board with twelve boxes; another one slides to and fro on it between two walls, without friction. Each strikes where it turns.
  const bank::Bank board = make_dense_box({1.6, 0.5, 0.02}, 700.0), box = make_dense_box({0.06, 0.05, 0.04}, 700.0),
                   wall = make_dense_box({0.05, 0.2, 0.2}, 2700.0);
  WorldSpec spec;
  spec.ground = GroundSpec{};
  spec.bodies = {make_body(board, {0, 0, 0.01}), make_body(box, {0, 0.15, 0.04}, 1.0), make_fixed(wall, {-0.9, 0.15, 0.15}, 1.0),
                 make_fixed(wall, {0.9, 0.15, 0.15}, 1.0)};
  spec.bodies[1].velocity_m_s = {0.7, 0, 0};
  spec.bodies[1].friction = 0.0;
  for (int i = 0; i < 12; ++i) spec.bodies.push_back(make_body(box, {-0.66 + 0.12 * i, -0.1, 0.04}));
  World world(spec, {.end_s = 60.0, .lasting_contacts = false, .audits_energy = true});
  double way = 0.0;
  int hits = 0;
  world.advance(60.0, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
    if (const auto* i = std::get_if<events::Impulse>(&e)) hits += i->body >= 4 ? 1 : 0;
    if (const auto* m = std::get_if<events::BodyMotion>(&e); m != nullptr && m->body >= 4)
      way = std::max(way, norm(m->position_m - spec.bodies[m->body].initial.position_m));
  });
  const auto statistics = world.get_statistics();
  hold("contact_sleeps_apart", way, 1e-5, "way of those that stand in a minute [m]");
  hold("contact_sleeps_apart", hits, 0, "hits of those that stand");
  hold("contact_sleeps_apart", statistics.energy.error_j / statistics.energy.kinetic_j, 0.01, "books, relative");
  hold("contact_sleeps_apart", static_cast<double>(statistics.body_steps) / static_cast<double>(statistics.steps), 7.0,
       "bodies of fourteen that take a step, mean");
}

TEST(time, contact_flush) {
  // Two or three equal boxes whose faces and edges coincide, without gap and without weight, pushed along and across.
  const bank::Bank box = make_dense_box({0.06, 0.05, 0.04}, 2700.0);
  for (int variant = 0; variant < 4; ++variant) {
    WorldSpec spec;
    spec.gravity_m_s2 = {};
    spec.bodies = {make_body(box, {}, 0.5), make_body(box, {0, 0, 0.04}, 0.5), make_body(box, {0, 0, 0.08}, 0.5)};
    if (variant == 1) spec.bodies[1].initial.position_m = {0.06, 0, 0.04};  // edge on edge
    if (variant == 2) spec.bodies[1].initial.rotation = {std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
    spec.bodies[0].velocity_m_s = variant == 3 ? Vec3{1, 0.3, 0} : Vec3{0, 0, 1};
    const Course course = run(spec, 0.25, 0.5);
    Vec3 sum{};
    for (const auto& m : course.end) sum = sum + m.velocity_m_s;
    const std::string part = "variant " + std::to_string(variant);
    hold("contact_flush", norm(sum - spec.bodies[0].velocity_m_s), 1e-10, part + ", momentum, relative");
    const double given = 0.5 * box.rigid.mass_kg * (variant == 3 ? 1.09 : 1.0);
    hold("contact_flush", std::max(course.energy.rise_j, course.energy.hit_rise_j) / given, 1e-9, part + ", energy gained, relative");
  }
}

TEST(time, contact_coin_on_rim) {
  const double radius = 0.012;
  const bank::Bank coin = make_bank(geometry::tests::make_cylinder(radius, 0.002, 96), 7800.0);
  const std::array<double, 4> upright{std::sqrt(0.5), std::sqrt(0.5), 0, 0};
  {
    WorldSpec spec;
    spec.ground = GroundSpec{};
    spec.bodies = {make_body(coin, {0, 0, radius})};
    spec.bodies[0].initial.rotation = upright;
    spec.bodies[0].velocity_m_s = {0.5, 0, 0};
    spec.bodies[0].angular_velocity_rad_s = {0, 0.5 / radius, 0};
    const Course course = run(spec, 0.5, 1.0);
    // Couple c R F with c = 0.001 against rolling, inertia m R^2/2: it slows down by 2/3 c g.
    hold("contact_coin_on_rim", std::abs(course.end[0].velocity_m_s[0] / (0.5 - 2.0 / 3.0 * 1e-3 * kGravity) - 1.0), 0.02,
         "rolls, speed after 1 s");
    hold("contact_coin_on_rim", std::abs(course.end[0].position_m[1]), 1e-3, "rolls, to the side [m]");
    hold("contact_coin_on_rim", calc_rise(course), 1e-5, "rolls, energy gained as a height [m]");
  }
  for (const double lean : {0.0, 1e-3, 0.1}) {
    WorldSpec spec;
    spec.ground = GroundSpec{};
    const double a = 0.5 * M_PI - lean;
    spec.bodies = {make_body(coin, {0, 0, radius * std::sin(a) + 0.001 * std::cos(a)})};
    spec.bodies[0].initial.rotation = {std::cos(a / 2), std::sin(a / 2), 0, 0};
    const Course course = run(spec, 3.0, 5.0);
    const double height = lean * radius < 0.001 ? radius : 0.001;  // on the flat rim it stands as long as its centre is above it
    const std::string part = "leans by " + std::to_string(lean);
    hold("contact_coin_on_rim", std::abs(course.end[0].position_m[2] - height), 1e-4, part + ", height [m]");
    hold("contact_coin_on_rim", calc_rise(course), 1e-5, part + ", energy gained as a height [m]");
  }
}

TEST(time, contact_bar_in_gap) {
  // Between two plates 20 mm thick and 10.1 mm apart, edges of a bar of 10 mm have 0.05 mm on each side.
  const Vec3 bar_size{0.01, 0.01, 0.3}, plate_size{0.1, 0.2, 0.02};
  const bank::Bank bar = make_dense_box(bar_size, 2700.0), plate = make_dense_box(plate_size, 2700.0);
  for (const double lean : {0.0, 2e-3, 0.05}) {
    WorldSpec spec;
    spec.bodies = {make_body(bar, {0, 0, 0.2}), make_fixed(plate, {-0.05505, 0, 0}), make_fixed(plate, {0.05505, 0, 0})};
    spec.bodies[0].initial.rotation = make_turn_about_y(lean);
    double deepest = 0.0;
    const auto look = [&](const events::BodyMotion& m) {
      if (m.body != 0) return;
      for (int k = 0; k < 4 * 601; ++k) {  // places along the long edges of the bar
        const Vec3 x = m.position_m + rotate(m.rotation, {k & 1 ? 0.005 : -0.005, k & 2 ? 0.005 : -0.005, 0.3 * ((k / 4) / 600.0 - 0.5)});
        const double depth = std::min({0.01 - std::abs(x[2]), std::abs(x[0]) - 0.00505, 0.1 - std::abs(x[1])});
        deepest = std::max(deepest, depth);
      }
    };
    const Course course = run(spec, 0.3, 0.6, look);
    const std::string part = "leans by " + std::to_string(lean);
    hold("contact_bar_in_gap", deepest, 2e-5, part + ", deepest in the plates [m]");
    hold("contact_bar_in_gap", calc_rise(course), 1e-5, part + ", energy gained as a height [m]");
    if (lean == 0.0)
      hold("contact_bar_in_gap", std::abs(course.end[0].position_m[2] / (0.2 - 0.5 * kGravity * 0.36) - 1.0), 1e-9,
           part + ", fall, relative");
  }
}

TEST(time, contact_pressed_start) {
  // A stack that begins 0.15 mm inside itself at every place, of rubber, steel, wood, glass and lead.
  std::vector<bank::Bank> blocks;
  for (const auto& [young, density] :
       std::to_array<std::array<double, 2>>({{1e6, 1100}, {200e9, 7800}, {10e9, 600}, {70e9, 2500}, {16e9, 11340}})) {
    blocks.push_back(make_dense_box({0.05, 0.05, 0.05}, density));
    blocks.back().material.young_modulus_pa = young;
  }
  WorldSpec spec;
  spec.ground = GroundSpec{};
  const double inside = 1.5e-4;
  for (std::size_t i = 0; i < blocks.size(); ++i)
    spec.bodies.push_back(make_body(blocks[i], {0, 0, 0.025 - inside + (0.05 - inside) * static_cast<double>(i)}));
  double fastest = 0.0;
  const Course course = run(spec, 2.0, 20.0, [&](const events::BodyMotion& m) { fastest = std::max(fastest, norm(m.velocity_m_s)); });
  hold("contact_pressed_start", fastest, 0.1, "fastest [m/s]");
  hold("contact_pressed_start", calc_drift(course), 1e-9, "way after 2 s [m]");
  hold("contact_pressed_start", std::abs(course.end[4].position_m[2] - 0.225), 5 * inside, "height of the uppermost [m]");
}

TEST(time, contact_spinning_top) {
  const bank::Bank top = make_bank(geometry::tests::make_lathe({{0, 0}, {0.04, 0.02}, {0.04, 0.03}, {0, 0.03}}, 64, false), 2700.0);
  const double m = top.rigid.mass_kg, l = top.rigid.centre_m[2], along = top.rigid.inertia_kg_m2[8],
               across = top.rigid.inertia_kg_m2[0] + m * l * l, a = 0.2;
  for (const double spin : {200.0, 400.0}) {
    // Steady precession about the vertical at W: along spin W - across W^2 cos a = m g l, the slower of both.
    const double c = across * std::cos(a),
                 W = (along * spin - std::sqrt(along * along * spin * spin - 4.0 * c * m * kGravity * l)) / (2.0 * c);
    WorldSpec spec;
    spec.ground = GroundSpec{.friction = 2.0};
    spec.bodies = {make_body(top, {})};
    BodySpec& b = spec.bodies[0];
    b.friction = 2.0;
    b.initial.rotation = make_turn_about_y(a);
    const Vec3 axis{std::sin(a), 0, std::cos(a)};
    b.angular_velocity_rad_s = (spin - W * std::cos(a)) * axis + Vec3{0, 0, W};
    b.velocity_m_s = {0, W * l * std::sin(a), 0};
    double turned = 0.0, before = 0.0;
    const auto look = [&](const events::BodyMotion& motion) {
      const Vec3 now = rotate(motion.rotation, {0, 0, 1});
      const double angle = std::atan2(now[1], now[0]);
      turned += std::remainder(angle - before, 2.0 * M_PI);
      before = angle;
    };
    const Course course = run(spec, 0.5, 1.0, look);
    const std::string part = std::to_string(static_cast<int>(spin)) + " rad/s";
    hold("contact_spinning_top", std::abs(turned / W - 1.0), 1e-3, part + ", precession in 1 s, relative");
    hold("contact_spinning_top", std::abs(rotate(course.end[0].rotation, {0, 0, 1})[2] - std::cos(a)), 1e-3, part + ", cosine of the lean");
    hold("contact_spinning_top", calc_rise(course), 1e-5, part + ", energy gained as a height [m]");
  }
}

TEST(time, contact_bounces) {
  // Restitution 1: a ball over the ground for a minute, and five in a box without weight.
  const bank::Bank ball = make_round(0.02, 6);
  {
    WorldSpec spec;
    spec.ground = GroundSpec{.restitution = 1.0};
    spec.bodies = {make_body(ball, {0, 0, 0.12}, 1.0)};
    const Course course = run(spec, 30.0, 60.0);
    const double v = norm(course.end[0].velocity_m_s), e = kGravity * (course.end[0].position_m[2] - 0.02) + 0.5 * v * v;
    hold("contact_bounces", std::abs(e / (kGravity * 0.1) - 1.0), 1e-3, "energy after a minute on the ground, relative");
  }
  const bank::Bank wall = make_dense_box({0.6, 0.6, 0.1}, 2700.0);
  WorldSpec spec;
  spec.gravity_m_s2 = {};
  for (int i = 0; i < 5; ++i) {
    BodySpec body = make_body(ball, {0.08 * (i % 3) - 0.08, 0.07 * (i / 3), 0.01 * i}, 1.0);
    body.friction = 0.0;
    body.velocity_m_s = {std::cos(2.0 * i), std::sin(3.0 * i), std::cos(5.0 * i)};
    spec.bodies.push_back(body);
  }
  const double q = std::sqrt(0.5);
  for (const double side : {-0.25, 0.25}) {
    spec.bodies.push_back(make_fixed(wall, {0, 0, side}, 1.0));
    spec.bodies.push_back(make_fixed(wall, {side, 0, 0}, 1.0));
    spec.bodies.back().initial.rotation = {q, 0, q, 0};
    spec.bodies.push_back(make_fixed(wall, {0, side, 0}, 1.0));
    spec.bodies.back().initial.rotation = {q, q, 0, 0};
  }
  double farthest = 0.0;
  const Course course = run(spec, 30.0, 60.0);
  for (std::size_t i = 0; i < 5; ++i)
    for (const double x : course.end[i].position_m) farthest = std::max(farthest, std::abs(x));
  hold("contact_bounces", std::abs(course.energy.motion_j / course.energy.start_j - 1.0), 1e-9,
       "kinetic energy of five after a minute, relative");
  hold("contact_bounces", farthest, 0.18 + 1e-5, "their centres off the middle of the box [m]");
}

TEST(time, contact_ice) {
  const bank::Bank plane = make_dense_box({8.0, 0.4, 0.04}, 2700.0), box = make_dense_box({0.06, 0.05, 0.04}, 2700.0),
                   ball = make_round(0.02, 8);
  const double a = 0.5;
  const Vec3 up{std::sin(a), 0, std::cos(a)}, down{std::cos(a), 0, -std::sin(a)};
  for (const bool is_ball : {false, true}) {
    WorldSpec spec;
    spec.bodies = {make_body(is_ball ? ball : box, 0.04 * up - 3.5 * down), make_fixed(plane, {})};
    for (BodySpec& body : spec.bodies) body.friction = 0.0, body.initial.rotation = make_turn_about_y(a);
    const Course course = run(spec, 0.5, 1.5);
    const Vec3& v = course.end[0].velocity_m_s;
    const std::string part = is_ball ? "ball" : "box";
    hold("contact_ice", std::abs((v[0] * down[0] + v[2] * down[2]) / (kGravity * std::sin(a) * 1.5) - 1.0), 1e-4,
         part + ", speed, relative");
    const auto q = course.end[0].rotation;  // facets may turn a ball
    if (!is_ball) hold("contact_ice", 2.0 * norm(Vec3{q[1], q[2] - std::sin(a / 2), q[3]}), 1e-3, part + ", turned by [rad]");
    hold("contact_ice", calc_rise(course), 1e-6, part + ", energy gained as a height [m]");
  }
}

TEST(time, contact_friction_ten) {
  const bank::Bank slab = make_dense_box({0.2, 0.2, 0.01}, 2700.0), plane = make_dense_box({2.0, 0.4, 0.04}, 2700.0),
                   box = make_dense_box({0.06, 0.05, 0.04}, 2700.0);
  {
    const double a = 80.0 * M_PI / 180.0;  // tan a = 5.7
    WorldSpec spec;
    spec.bodies = {make_body(slab, {0.025 * std::sin(a), 0, 0.025 * std::cos(a)}), make_fixed(plane, {})};
    for (BodySpec& body : spec.bodies) body.friction = 10.0, body.initial.rotation = make_turn_about_y(a);
    const Course course = run(spec, 1.0, 11.0);
    hold("contact_friction_ten", calc_drift(course), 1e-9, "way in ten seconds on 80 degrees [m]");
  }
  for (int turn = 0; turn < 6; ++turn) {
    WorldSpec spec;
    spec.ground = GroundSpec{.friction = 10.0};
    spec.bodies = {make_body(box, {0, 0, 0.1}, 0.6)};
    spec.bodies[0].friction = 10.0;
    spec.bodies[0].velocity_m_s = {2, 0, -1};
    spec.bodies[0].angular_velocity_rad_s = {20.0 * std::cos(turn), -40.0 * std::sin(turn), 10.0 * turn};
    const Course course = run(spec, 4.0, 5.0);
    const std::string part = "throw " + std::to_string(turn);
    hold("contact_friction_ten", calc_rise(course), 1e-5, part + ", energy gained as a height [m]");
    hold("contact_friction_ten", calc_drift(course), 1e-9, part + ", way after 4 s [m]");
    hold("contact_friction_ten", calc_depth(box, course.end[0]), 1e-5, part + ", in the ground [m]");
  }
}

TEST(time, contact_seam) {
  // A tile slides, and a ball rolls, from one board onto the next; their faces are flush.
  const bank::Bank board = make_dense_box({0.4, 0.3, 0.04}, 2700.0), tile = make_dense_box({0.08, 0.06, 0.02}, 2700.0),
                   ball = make_round(0.02, 8);
  for (const bool is_ball : {false, true}) {
    WorldSpec spec;
    const double speed = is_ball ? 0.5 : 1.2, height = is_ball ? 0.02 : 0.01;
    spec.bodies = {make_body(is_ball ? ball : tile, {-0.1, 0, 0.02 + height}), make_fixed(board, {-0.2, 0, 0}),
                   make_fixed(board, {0.2, 0, 0})};
    spec.bodies[0].velocity_m_s = {speed, 0, 0};
    if (is_ball) spec.bodies[0].angular_velocity_rad_s = {0, speed / 0.02, 0};
    double farthest = 0.0;
    const auto look = [&](const events::BodyMotion& m) {
      if (m.body == 0) farthest = std::max(farthest, std::abs(m.position_m[2] - 0.02 - height));
    };
    const Course course = run(spec, 0.3, 0.5, look);
    const std::string part = is_ball ? "ball" : "tile";
    const double way = is_ball ? speed * 0.5 - 0.5 * 5.0 / 7.0 * 1e-3 * kGravity * 0.25 : speed * speed / (2 * 0.4 * kGravity);
    hold("contact_seam", std::abs((course.end[0].position_m[0] + 0.1) / way - 1.0), 0.01, part + ", way, relative");
    hold("contact_seam", farthest, 5e-5, part + ", up or down [m]");
    if (!is_ball) hold("contact_seam", course.hits, 0.0, part + ", hits");
  }
}

TEST(time, contact_cone_on_tip) {
  const bank::Bank cone = make_bank(geometry::tests::make_lathe({{0, 0}, {0.03, 0.1}, {0, 0.1}}, 64, false), 2700.0);
  const double m = cone.rigid.mass_kg, l = cone.rigid.centre_m[2], inertia = cone.rigid.inertia_kg_m2[0] + m * l * l;
  const auto fall = [&](double lean, double end_s, double until, double& when) {
    WorldSpec spec;
    spec.ground = GroundSpec{.friction = 10.0};
    spec.bodies = {make_body(cone, {})};
    spec.bodies[0].friction = 10.0;
    spec.bodies[0].initial.rotation = make_turn_about_y(lean);
    double angle_before = lean, time_before = 0.0;
    return run(spec, 0.5 * end_s, end_s, [&](const events::BodyMotion& motion) {
      const double angle = std::acos(std::clamp(rotate(motion.rotation, {0, 0, 1})[2], -1.0, 1.0));
      if (when == 0.0 && angle >= until)
        when = time_before + (motion.time_s - time_before) * (until - angle_before) / (angle - angle_before);
      angle_before = angle;
      time_before = motion.time_s;
    });
  };
  double none = 0.0;
  const Course stands = fall(0.0, 10.0, 1.0, none);
  hold("contact_cone_on_tip", norm(stands.end[0].position_m - Vec3{0, 0, l}), 1e-9, "upright, way in ten seconds [m]");
  for (const double lean : {1e-3, 0.05}) {
    // The pendulum about its foot, upside down: a'' = m g l / I sin a.
    double a = lean, w = 0.0, wanted = 0.0;
    const double h = 1e-6, k = m * kGravity * l / inertia;
    for (; a < 0.8; wanted += h) {
      const double half = w + 0.5 * h * k * std::sin(a);
      a += h * half;
      w = half + 0.5 * h * k * std::sin(a);
    }
    double when = 0.0;
    const Course course = fall(lean, 3.0, 0.8, when);
    const std::string part = "leans by " + std::to_string(lean);
    hold("contact_cone_on_tip", std::abs(when / wanted - 1.0), 1e-3, part + ", time to 0.8 rad, relative");
    hold("contact_cone_on_tip", calc_rise(course), 1e-5, part + ", energy gained as a height [m]");
  }
}

TEST(time, contact_sizes) {
  // Grains of 0.1 mm fall on a block of 1 m.
  const bank::Bank grain = make_dense_box({1e-4, 1e-4, 1e-4}, 2700.0), block = make_dense_box({1, 1, 1}, 2700.0);
  {
    WorldSpec spec;
    for (int i = 0; i < 5; ++i) {
      spec.bodies.push_back(make_body(grain, {0.1 * i, 0.05 * i, 0.5 + 1e-3}));
      spec.bodies.back().initial.rotation = {1.0, 0.1 * i, 0.2 * i, 0.1};
    }
    spec.bodies.push_back(make_fixed(block, {}));
    const Course course = run(spec, 1.0, 2.0);
    double off = 0.0;
    for (std::size_t i = 0; i < 5; ++i) off = std::max(off, std::abs(course.end[i].position_m[2] - 0.5 - 5e-5));
    hold("contact_sizes", off, 1e-6, "grains, height [m]");
    hold("contact_sizes", calc_drift(course), 1e-9, "grains, way after 1 s [m]");
  }
  // A block of 1 m set down on four cubes of 2 cm: 125,000 times their mass.
  const bank::Bank cube = make_dense_box({0.02, 0.02, 0.02}, 2700.0);
  WorldSpec spec;
  spec.ground = GroundSpec{};
  spec.bodies.push_back(make_body(block, {0, 0, 0.52}));
  for (int i = 0; i < 4; ++i) spec.bodies.push_back(make_body(cube, {i & 1 ? 0.4 : -0.4, i & 2 ? 0.4 : -0.4, 0.01}));
  const Course course = run(spec, 1.0, 60.0);
  hold("contact_sizes", std::abs(course.end[0].position_m[2] - 0.52), 1e-6, "block on cubes, height [m]");
  hold("contact_sizes", calc_drift(course), 1e-9, "block on cubes, way after 1 s [m]");
}

TEST(time, contact_sheets) {
  // Ten sheets of 0.5 mm, turned against each other, fall flat onto each other.
  const bank::Bank sheet = make_dense_box({0.3, 0.2, 0.0005}, 7800.0);
  WorldSpec spec;
  spec.ground = GroundSpec{};
  for (int i = 0; i < 10; ++i) {
    spec.bodies.push_back(make_body(sheet, {0, 0, 0.00025 + 0.0025 * (i + 1)}));
    spec.bodies.back().initial.rotation = {std::cos(0.1 * i), 0, 0, std::sin(0.1 * i)};
  }
  const Course course = run(spec, 3.0, 10.0);
  double deepest = 0.0;
  for (std::size_t i = 0; i < 10; ++i)
    deepest = std::max(deepest, 0.0005 - (course.end[i].position_m[2] - (i > 0 ? course.end[i - 1].position_m[2] : -0.00025)));
  hold("contact_sheets", deepest, 5e-5, "one in the other [m]");
  hold("contact_sheets", std::abs(course.end[9].position_m[2] - 0.00475), 1e-4, "height of the uppermost [m]");
  hold("contact_sheets", calc_drift(course), 1e-9, "way after 3 s [m]");
  hold("contact_sheets", calc_rise(course), 1e-5, "energy gained as a height [m]");
}

TEST(time, contact_inside) {
  // A ball in a hollow ball that is thrown onto the ground.
  std::vector<std::array<double, 2>> outline, inner;
  const int rings = 24;
  for (int i = 0; i <= rings; ++i) {
    const double angle = M_PI * i / rings, s = i == 0 || i == rings ? 0.0 : std::sin(angle);
    outline.push_back({0.055 * s, -0.055 * std::cos(angle)});
    inner.push_back({0.05 * s, -0.05 * std::cos(angle)});
  }
  geometry::tests::Solid shell = geometry::tests::make_lathe(outline, 48, false), hollow = geometry::tests::make_lathe(inner, 48, false);
  hollow.turn_inside_out();
  shell.add(hollow, {});
  const bank::Bank around = make_bank(shell, 2700.0), ball = make_round(0.02, 6);
  for (int turn = 0; turn < 3; ++turn) {
    WorldSpec spec;
    spec.ground = GroundSpec{};
    spec.bodies = {make_body(around, {0, 0, 0.2}, 0.7), make_body(ball, {0.01, 0.005 * turn, 0.19}, 0.7)};
    spec.bodies[0].velocity_m_s = {1, 0, -2};
    spec.bodies[0].angular_velocity_rad_s = {0, 10.0 * turn, 5};
    double farthest = 0.0;
    std::array<Vec3, 2> at{};
    const Course course = run(spec, 1.0, 2.0, [&](const events::BodyMotion& m) {
      at[m.body] = m.position_m;
      if (m.body == 1 && m.time_s > 0.0) farthest = std::max(farthest, norm(at[1] - at[0]));
    });
    const std::string part = "throw " + std::to_string(turn);
    // Motions come body by body: at 3 m/s the one is up to a window of 2 ms ahead.
    hold("contact_inside", norm(course.end[1].position_m - course.end[0].position_m), 0.03 + 1e-4, part + ", distance of the centres [m]");
    hold("contact_inside", farthest, 0.03 + 0.006, part + ", largest distance ever seen [m]");
    hold("contact_inside", calc_rise(course), 1e-5, part + ", energy gained as a height [m]");
  }
}

}  // namespace
}  // namespace carillon::hard
