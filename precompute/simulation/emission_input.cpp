#include "precompute/simulation/emission_input.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace carillon::simulation {

emission::Options make_emission_options(const job::SimulationSpec& spec, int steps_per_sample, bool is_resumed) {
  emission::Options options;
  options.sample_rate_hz = spec.sample_rate_hz;
  options.steps_per_sample = steps_per_sample;
  options.frames = static_cast<std::uint64_t>(std::llround(spec.duration_s * spec.sample_rate_hz));
  options.radiation = spec.radiation == job::SurfaceSound::kirchhoff  ? emission::Radiation::kKirchhoff
                      : spec.radiation == job::SurfaceSound::rayleigh ? emission::Radiation::kRayleigh
                                                                      : emission::Radiation::kPaper2001;
  if (spec.radiation != job::SurfaceSound::paper2001) options.high_pass_hz = spec.high_pass_hz;
  options.has_visibility = spec.visibility;
  if (spec.receivers.microphones_m.empty()) {
    options.receivers =
        emission::make_ears(spec.receivers.position_m, spec.receivers.position_m + spec.receivers.facing, spec.receivers.ear_distance_m);
  } else {
    for (const Vec3& place : spec.receivers.microphones_m) options.receivers.push_back({place, 0.0, {0, 1, 0}});
  }
  for (emission::Microphone& receiver : options.receivers) {
    receiver.directivity = spec.receivers.cardioid;
    receiver.axis = spec.receivers.facing;
  }
  for (const job::Obstacle& obstacle : spec.obstacles) options.walls.push_back(obstacle.form);
  for (const job::Striker& striker : spec.strikers) options.ball_radius_m.push_back(striker.ball.radius_m);
  options.surface_file = spec.surface;
  options.is_resumed = is_resumed;
  return options;
}

std::vector<std::string> find_deaf_receivers(const job::SimulationSpec& spec) {
  std::vector<std::string> warnings;
  if (!spec.visibility) return warnings;
  const emission::Options options = make_emission_options(spec, 0, false);
  for (std::size_t i = 0; i < options.receivers.size(); ++i)
    for (const job::Obstacle& obstacle : spec.obstacles) {
      const Vec3& place = options.receivers[i].place_m;
      if (!emission::is_between(obstacle.form, place, place)) continue;
      const std::string name = !spec.receivers.microphones_m.empty() ? fmt::format("microphone {}", i + 1)
                               : i == 0                              ? "the left ear of the listener"
                                                                     : "the right ear of the listener";
      warnings.push_back(fmt::format("{}: this obstacle encloses {} at ({:.4g}, {:.4g}, {:.4g}) m, which hears nothing; move one of them",
                                     obstacle.place, name, place[0], place[1], place[2]));
    }
  return warnings;
}

emission::SurfacePart make_surface_part(const transient::Domain& domain, const job::SimulationSpec& spec) {
  emission::SurfacePart part;
  const transient::Assembly& assembly = domain.get_assembly();
  part.nodes_m = domain.get_rest_m();
  for (std::int32_t place = 0; place < domain.node_count(); ++place) part.node_number.push_back(domain.find_number(place));
  std::int64_t number = 0;
  for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
    if (!spec.bodies[b].sounds && !spec.visibility) continue;
    // Corners only, also for quadratic elements: wavelengths exceed a facet, and four triangles each cost four times as much.
    for (const auto& facet : transient::list_skin(assembly, static_cast<std::int32_t>(b))) {
      const std::array<std::int32_t, 3> triangle{facet[0], facet[1], facet[2]};
      const std::int32_t owner = domain.find_place(*std::min_element(triangle.begin(), triangle.end()));
      const std::int64_t own = number;
      if (spec.bodies[b].sounds) number += spec.bodies[b].sheet ? 2 : 1;
      if (owner < 0 || owner >= domain.own_count()) continue;
      const Triangle made{domain.find_place(triangle[0]), domain.find_place(triangle[1]), domain.find_place(triangle[2])};
      if (!spec.bodies[b].sounds) {
        part.silent.push_back(made);
        continue;
      }
      part.triangles.push_back(made);
      part.triangle_number.push_back(own);
      part.body.push_back(static_cast<std::int32_t>(b));
      if (!spec.bodies[b].sheet) continue;
      part.triangles.push_back({made[0], made[2], made[1]});
      part.triangle_number.push_back(own + 1);
      part.body.push_back(static_cast<std::int32_t>(b));
    }
  }
  return part;
}

}  // namespace carillon::simulation
