#include "precompute/job/simulation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <variant>

namespace {

using carillon::InputError;
using carillon::Vec3;
using namespace carillon::job;

const std::string kMaterial =
    R"("material": {"young_modulus_pa": 2e11, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {"alpha1_s": 1e-8, "alpha2_per_s": 2}}})";
const std::string kBar = R"({"name": "bar", "mesh": "bar.msh", )" + kMaterial + "}";

/// A job with these bodies and more keys of "simulate" and of the job.
std::string make_job(const std::string& bodies, const std::string& more = "", const std::string& outer = R"(, "sound": "s.wav")") {
  return R"({"simulate": {"duration_s": 1, "bodies": [)" + bodies + "]" + more + "}" + outer + "}";
}

SimulationSpec parse(const std::string& text) { return parse_simulation(text, "/jobs/job.json"); }

TEST(Simulation, defaults) {
  const SimulationSpec spec = parse(make_job(kBar));
  EXPECT_EQ(spec.sample_rate_hz, 48000);
  EXPECT_FALSE(spec.step_s);
  EXPECT_EQ(spec.gravity_m_s2, (Vec3{0, 0, 0}));
  ASSERT_EQ(spec.bodies.size(), 1U);
  EXPECT_EQ(spec.bodies[0].mesh, "/jobs/bar.msh");
  EXPECT_EQ(spec.bodies[0].element, Element::T10);
  EXPECT_TRUE(spec.bodies[0].sounds);
  EXPECT_EQ(spec.radiation, SurfaceSound::kirchhoff);
  EXPECT_FALSE(spec.visibility);
  EXPECT_EQ(spec.high_pass_hz, 20.0);
  EXPECT_EQ(spec.sound, "/jobs/s.wav");
  EXPECT_TRUE(spec.motion.empty() && spec.surface.empty() && spec.record.empty());
  EXPECT_TRUE(is_simulation(make_job(kBar)));
  EXPECT_FALSE(is_simulation(R"({"mesh": "bar.msh"})"));
  EXPECT_FALSE(is_simulation("no job"));
}

TEST(Simulation, all_keys_of_bodies_strikers_and_obstacles) {
  const std::string sheet = R"({"name": "sheet", "sheet": {"shape": "rectangle", "length_m": 0.3, "width_m": 0.2, "thickness_m": 1e-3,
      "cells": 12, "bow_m": 0.01}, )" +
                            kMaterial + R"(, "fixed": ["x-min", {"box_m": {"min": [0, 0, 0], "max": [1, 1, 1]}}],
      "hinged": "y-min", "drive": [{"node_set": "x-max", "path": [[0, 0, 0, 0], [0.5, 0, 0, -0.01]]}], "position_m": [1, 2, 3],
      "rotation_deg": [0, 90, 0], "velocity_m_s": [1, 0, 0], "angular_velocity_rad_s": [0, 0, 5], "sounds": false})";
  const SimulationSpec spec = parse(make_job(kBar + "," + sheet, R"(, "gravity_m_s2": [0, 0, -9.81], "settle_s": 0.1, "step_s": 1e-6,
      "strikers": [{"sphere_m": 0.01, "mass_kg": 0.05, "position_m": [0, 0, 0.1], "velocity_m_s": [0, 0, -2]}],
      "obstacles": [{"plane": {"normal": [0, 0, 2]}}, {"sphere": {"centre_m": [1, 0, 0], "radius_m": 0.5}},
                    {"box": {"min": [0, 0, 0], "max": [1, 1, 1]}}],
      "impulses": [{"time_s": 0.01, "body": "sheet", "point_m": [0, 0, 0], "impulse_n_s": [0, 0, -1], "duration_s": 1e-3}],
      "contact": {"stiffness": 1, "restitution": 0.5, "friction": 0}, "microphones": [[0, 0, 1], [0, 0, 2]],
      "radiation": "paper2001", "high_pass_hz": 0, "motion_hz": 100)"));
  const SimulatedBody& body = spec.bodies.at(1);
  ASSERT_TRUE(body.sheet);
  EXPECT_EQ(body.sheet->cells, 12);
  EXPECT_EQ(body.sheet->bow_m, 0.01);
  ASSERT_EQ(body.fixed.size(), 2U);
  EXPECT_EQ(body.fixed[0].node_set, "x-min");
  EXPECT_EQ(body.fixed[1].box_m[1], (Vec3{1, 1, 1}));
  EXPECT_EQ(body.hinged.at(0).node_set, "y-min");
  EXPECT_EQ(body.drives.at(0).path.at(1), (std::array<double, 4>{0.5, 0, 0, -0.01}));
  EXPECT_EQ(body.position_m, (Vec3{1, 2, 3}));
  EXPECT_FALSE(body.sounds);
  EXPECT_EQ(spec.step_s, 1e-6);
  EXPECT_EQ(spec.strikers.at(0).ball.velocity_m_s, (Vec3{0, 0, -2}));
  ASSERT_EQ(spec.obstacles.size(), 3U);
  EXPECT_EQ(std::get<PlaneObstacle>(spec.obstacles[0].form).normal, (Vec3{0, 0, 1}));
  EXPECT_EQ(std::get<BallObstacle>(spec.obstacles[1].form).radius_m, 0.5);
  EXPECT_EQ(std::get<BoxObstacle>(spec.obstacles[2].form).max_m, (Vec3{1, 1, 1}));
  EXPECT_EQ(spec.blows.at(0).body, 1U);
  EXPECT_EQ(spec.contact.restitution, 0.5);
  EXPECT_EQ(spec.receivers.microphones_m.size(), 2U);
  EXPECT_TRUE(spec.visibility) << "the paper's sound has shadows";
}

TEST(Simulation, a_listener_looks_at_a_point) {
  const SimulationSpec spec = parse(make_job(kBar, R"(, "listener": {"position_m": [0, -2, 0], "look_at_m": [0, 5, 0]})"));
  EXPECT_EQ(spec.receivers.facing, (Vec3{0, 1, 0}));
  EXPECT_TRUE(spec.receivers.microphones_m.empty());
}

TEST(Simulation, other_damping_laws_become_rayleighs_with_a_warning) {
  const std::string glass = R"({"name": "bar", "mesh": "bar.msh", "material": {"young_modulus_pa": 7e10, "poisson_ratio": 0.2,
      "density_kg_m3": 2500, "damping": {"internal_friction": {"tan_phi": 1e-3}}}})";
  const SimulationSpec spec = parse(make_job(glass));
  ASSERT_EQ(spec.warnings.size(), 1U);
  EXPECT_NE(spec.warnings[0].find("Rayleigh"), std::string::npos);
  const Material& material = spec.bodies[0].material;
  for (const double hz : {200.0, 5000.0}) {
    const double omega = 2 * std::numbers::pi * hz;
    // tan phi is the loss factor: decay rate c = omega tan phi.
    EXPECT_NEAR(material.alpha1_s * omega * omega + material.alpha2_per_s, 1e-3 * omega, 1e-9 * omega);
  }
}

TEST(Simulation, invalid_jobs_are_refused_with_place_and_cause) {
  const auto body = [](const std::string& more) { return R"({"name": "b", )" + more + kMaterial + "}"; };
  const std::string sheet = R"("sheet": {"shape": "disc", "radius_m": 0.1, "thickness_m": 1e-3}, )", mesh = R"("mesh": "m.msh", )";
  for (const auto& [text, place, words] : std::vector<std::array<std::string, 3>>{
           {make_job(kBar, R"(, "duraton_s": 1)"), "duraton_s", "did you mean"},
           {make_job(""), "bodies", "give 1 to"},
           {make_job(kBar + "," + kBar), "json:1", "two bodies"},
           {make_job(body("")), "json:1", "a body is one of"},
           {make_job(body(mesh + sheet)), "json:1", "a body is one of"},
           {make_job(body(R"("sheet": {"surface": "s.obj", "thickness_m": 1e-3}, )")), "json:1", "\"shape\" is missing"},
           {make_job(body(R"("sheet": {"shape": "disc", "radius_m": 0.1, "thickness_m": 0}, )")), "thickness_m", "out of range"},
           {make_job(body(R"("sheet": {"shape": "rectangle", "length_m": 1, "width_m": 1, "bow_m": 0.5, "thickness_m": 1e-3}, )")), "bow_m",
            "0.4"},
           {make_job(body(sheet + R"("element": "T4", )")), "element", "for solids"},
           {make_job(body(mesh + R"("hinged": "x-min", )")), "hinged", "for sheets"},
           {make_job(body(mesh + R"("model": "ogden", )")), "model", "stvk"},
           {make_job(body(mesh + R"("drive": [{"node_set": "a", "path": [[0, 0, 0, 0]]}], )")), "path", "two or more"},
           {make_job(body(mesh + R"("drive": [{"node_set": "a", "path": [[0, 0, 0, 0], [1e-3, 1, 0, 0]]}], )")), "path", "faster than"},
           {make_job(body(mesh + R"("drive": [{"node_set": "a", "path": [[0, 0, 0, 0], [0, 0, 0, 0]]}], )")), "path", "order of time"},
           {make_job(body(mesh + R"("drive": [{"node_set": "a", "path": [[0, 1, 0, 0], [1, 1, 0, 0]]}], )")), "path", "[t, 0, 0, 0]"},
           {make_job(body(mesh + R"("velocity_m_s": [400, 0, 0], )")), "velocity_m_s", "out of range"},
           {make_job(kBar, R"(, "impulses": [{"time_s": 1, "body": "bra", "point_m": [0, 0, 0], "impulse_n_s": [0, 0, 1]}])"),
            "impulses[0].body", "did you mean \"bar\""},
           {make_job(kBar, R"(, "impulses": [{"time_s": 0, "body": "bar", "point_m": [0, 0, 0], "impulse_n_s": [0, 0, 1]}])"), "time_s",
            "before the simulation"},
           {make_job(kBar, R"(, "obstacles": [{"plane": {"normal": [0, 0, 0]}}])"), "normal", "is 0"},
           {make_job(kBar, R"(, "obstacles": [{}])"), "json:1", "an obstacle is a"},
           {make_job(kBar, R"(, "strikers": [{"sphere_m": 0.01, "mass_kg": 0}])"), "mass_kg", "out of range"},
           {make_job(kBar, R"(, "listener": {}, "microphones": [[0, 0, 1]])"), "microphones", "keep one"},
           {make_job(kBar, R"(, "step_s": 0)"), "step_s", "out of range"},
           {make_job(kBar, R"(, "step_s": "small")"), "step_s", "automatic"},
           {make_job(kBar, "", R"(, "sound": "a.wav", "motion": "a.wav")"), "motion", "overwrite"},
           {make_job(kBar, "", R"(, "sound": "bar.msh")"), "sound", "overwrite"},
           {make_job(kBar, "", R"(, "sound": "job.json")"), "sound", "overwrite"}}) {
    try {
      parse(text);
      ADD_FAILURE() << "accepted: " << text;
    } catch (const InputError& error) {
      const std::string message = error.what();
      EXPECT_TRUE(message.starts_with("/jobs/job.json:")) << message;
      EXPECT_NE(message.find(place), std::string::npos) << message;
      EXPECT_NE(message.find(words), std::string::npos) << message;
    }
  }
}

}  // namespace
