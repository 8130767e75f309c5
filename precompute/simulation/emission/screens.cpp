// Method: rays from every triangle to every receiver, 1000 times a second, at the positions of the beginning of a sample; delta is
//   interpolated in between.
// Source: OCE01 eq. 10; docs/equations.md E14.
#include "precompute/simulation/emission/screens.hpp"

#include <algorithm>
#include <map>
#include <set>

#include "precompute/simulation/emission/visibility.hpp"

namespace carillon::emission {
namespace {

constexpr std::size_t kTestsPerSecond = 1000;
constexpr std::size_t kMaxLagSamples = 64;  // largest lag between the step of a sample and its emission, in samples

}  // namespace

Screens::Screens(const Surfaces& surfaces, const SurfacePart& part, const Options& options)
    : surfaces_(surfaces),
      options_(options),
      every_(std::max<std::size_t>(1, static_cast<std::size_t>(options.sample_rate_hz) / kTestsPerSecond)),
      ring_(kMaxLagSamples / every_ + 2),
      balls_(options.ball_radius_m.size()),
      before_(surfaces.get_slots() * options.receivers.size(), 1.0F),
      now_(before_) {
  std::vector<std::int64_t> numbers;
  std::set<std::int32_t> own;
  for (const Triangle& corner : part.silent) own.insert(corner.begin(), corner.end());
  for (const std::int32_t one : own) {
    node_.push_back(one);
    numbers.push_back(part.node_number[one]);
    for (const double x : part.nodes_m[one]) rest_.push_back(x);
  }
  std::vector<std::array<std::int64_t, 3>> triangles;
  for (const Triangle& corner : part.silent) {
    triangles.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) triangles.back()[c] = part.node_number[corner[c]];
  }
  triangles_ = surfaces_.comm.all_gather(triangles);
  std::map<std::int64_t, std::int64_t> place_of;
  const std::vector<std::int64_t> all = surfaces_.comm.all_gather(numbers);
  for (std::size_t i = 0; i < all.size(); ++i) place_of.try_emplace(all[i], static_cast<std::int64_t>(i));
  for (auto& corner : triangles_)
    for (std::int64_t& one : corner) one = place_of.at(one);
  rows_ = 3 * (node_.size() + balls_.size());
  places_.assign(ring_ * rows_, 0.0);
}

void Screens::keep(std::int64_t k, const double* u) {
  if (static_cast<std::size_t>(k) % every_ != 0) return;
  double* to = get_places(k);
  for (std::size_t s = 0; s < node_.size(); ++s)
    for (std::size_t axis = 0; axis < 3; ++axis) *to++ = rest_[3 * s + axis] + u[4 * node_[s] + axis];
  for (const Vec3& ball : balls_) to = std::copy(ball.begin(), ball.end(), to);
}

void Screens::look(std::int64_t k, const double* x) {
  if (static_cast<std::size_t>(k) % every_ != 0) return;
  const std::vector<Vec3> vertices = surfaces_.gather_vertices(x);
  std::vector<Corners> triangles;
  for (const Triangle& corner : surfaces_.tables.triangles) {
    const auto at = [&](std::size_t c) { return vertices[corner[c]]; };
    triangles.push_back({at(0), at(1), at(2)});
  }
  std::vector<job::RigidObstacle> walls = options_.walls;
  if (!triangles_.empty()) {
    std::vector<Vec3> screen;
    for (std::size_t s = 0; s < node_.size(); ++s) screen.push_back(get_vertex(get_places(k), static_cast<std::int32_t>(3 * s)));
    screen = surfaces_.comm.all_gather(screen);
    const auto at = [&](std::int64_t s) { return screen[s]; };
    for (const auto& corner : triangles_) triangles.push_back({at(corner[0]), at(corner[1]), at(corner[2])});
  }
  for (std::size_t b = 0; b < balls_.size(); ++b)
    walls.push_back(
        job::BallObstacle{get_vertex(get_places(k), static_cast<std::int32_t>(3 * (node_.size() + b))), options_.ball_radius_m[b]});
  const Visibility visibility(triangles);
  before_ = now_;
  for (std::size_t t = 0; t < surfaces_.get_slots(); ++t) {
    if (surfaces_.place[t] < 0) continue;
    const Corners& corner = triangles[surfaces_.place[t]];
    const Vec3 centre = (1.0 / 3.0) * (corner[0] + corner[1] + corner[2]);
    const Vec3 out = cross(corner[1] - corner[0], corner[2] - corner[0]);
    for (std::size_t i = 0; i < options_.receivers.size(); ++i) {
      // A side that faces away is hidden by its own body; for a sheet, by its other side in the same plane.
      const Vec3& ear = options_.receivers[i].place_m;
      const bool is_seen = dot(out, ear - centre) > 0.0 &&
                           std::none_of(walls.begin(), walls.end(), [&](const auto& wall) { return is_between(wall, centre, ear); }) &&
                           visibility.is_free(centre, ear, surfaces_.place[t]);
      now_[i * surfaces_.get_slots() + t] = is_seen ? 1.0F : 0.0F;
    }
  }
  if (k == 0) before_ = now_;
}

void Screens::shade(std::int64_t k, std::size_t receiver, std::size_t first, std::size_t count, double* pa) const {
  const double fade = std::min(1.0, static_cast<double>(static_cast<std::size_t>(k) % every_) / static_cast<double>(every_));
  const std::size_t at = receiver * surfaces_.get_slots() + first;
  for (std::size_t i = 0; i < count; ++i) {
    const auto before = static_cast<double>(before_[at + i]), now = static_cast<double>(now_[at + i]);
    pa[i] *= before + fade * (now - before);
  }
}

}  // namespace carillon::emission
