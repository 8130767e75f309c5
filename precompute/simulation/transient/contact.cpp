// Method: a point of one surface against the nearest point of another: penalty k d (1 + a d' / v), never adhesive, with the closing speed v
//   at the beginning of contact; d is node depth times area (O'Brien and Hodgins 1999: overlap volume). Coulomb friction stops a node
//   within one step at most.
// Source: docs/equations.md E11; Hunt and Crossley 1975; Gonthier, McPhee, Lange and Piedboeuf 2004 (restitution).
#include "precompute/simulation/transient/contact.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <unordered_map>

#include "precompute/comm/exchange.hpp"
#include "precompute/simulation/transient/vectors.hpp"
#include "runtime/base/error.hpp"

namespace carillon::transient {
namespace {

constexpr double kMargin = 0.5;                           // search margin, in mean edges
constexpr double kStartOverlap = 0.1;                     // in mean edges
constexpr std::int64_t kMaxCheckSteps = 64;               // between two motion checks
constexpr double kMinClosingMs = 1e-9;                    // closing speed [m/s] of a contact that begins at rest
constexpr double kStopShare = 0.5;                        // largest share of the tangential momentum removed by friction per step
constexpr double kStrikerPhase = 0.01;                    // [rad] per step of a striker on an obstacle, stopped by its own spring
constexpr double kBallSlide = 3.5;                        // 1 + m r^2 / I: reduction of a ball's effective mass for tangential forces
constexpr double kEqualDistanceRatio = 1e-12;             // equal distances, in mean edges
constexpr double kMaxPositionM = 1e6, kMaxSpeedMs = 1e9;  // limits of a stable motion

/// NaN counts as larger.
void take_larger(double value, double& largest) {
  if (!(value <= largest)) largest = value;
}

void add(Quad& f, const Vec3& force) {
  f.x += force[0];
  f.y += force[1];
  f.z += force[2];
}

}  // namespace

/// Hash of grid cells.
struct Contacts::Grid {
  double cell_m;
  std::unordered_map<std::int64_t, std::vector<std::int32_t>> at;
  std::array<std::int64_t, 3> find(const Vec3& p) const {
    return {static_cast<std::int64_t>(std::floor(p[0] / cell_m)), static_cast<std::int64_t>(std::floor(p[1] / cell_m)),
            static_cast<std::int64_t>(std::floor(p[2] / cell_m))};
  }
  static std::int64_t hash(const std::array<std::int64_t, 3>& c) { return (c[0] * 73856093) ^ (c[1] * 19349663) ^ (c[2] * 83492791); }
};

double calc_hunt_crossley(double restitution) {
  if (restitution >= 1.0) return 0.0;
  // g(a) = log(1 + a) - log(1 - a e) - a (1 + e) has one root in (0, 1 / e) other than 0.
  const double e = restitution;
  double low = 1e-9, high = (1.0 - 1e-15) / e;
  for (int i = 0; i < 200; ++i) {
    const double a = 0.5 * (low + high);
    (std::log1p(a) - std::log1p(-a * e) - a * (1.0 + e) > 0.0 ? high : low) = a;
  }
  return 0.5 * (low + high);
}

Contacts::Contacts(const Domain& domain, TouchSurface surface, std::vector<BallStriker> strikers, std::vector<RigidObstacle> obstacles,
                   const TouchRules& rules)
    : comm_(domain.get_comm()),
      surface_(std::move(surface)),
      strikers_(std::move(strikers)),
      obstacles_(std::move(obstacles)),
      rules_(rules),
      damping_(calc_hunt_crossley(rules.restitution)) {
  on_striker_n_.resize(strikers_.size());
  on_striker_n_m_.resize(strikers_.size());
  const std::size_t nodes = surface_.nodes.size();
  owner_.resize(nodes);
  mass_kg_.resize(nodes);
  place_.resize(nodes);
  found_at_m_.resize(nodes);
  for (std::size_t i = 0; i < nodes; ++i) {
    const std::int32_t place = domain.find_place(surface_.nodes[i].node);
    place_[i] = place < domain.own_count() ? place : -1;
    found_at_m_[i] = surface_.nodes[i].rest_m;
    bodies_ = std::max(bodies_, surface_.nodes[i].body + 1);
    if (place_[i] < 0) continue;
    own_.push_back(static_cast<std::int32_t>(i));
    owner_[i] = comm_.rank();
    mass_kg_[i] = domain.get_masses_kg()[place];
  }
  comm_.sum(std::span<std::int32_t>(owner_));
  comm_.sum(std::span<double>(mass_kg_));
  for (const Assembly::Body& body : domain.get_assembly().bodies) names_.push_back(body.name);
  double edges = 0;
  for (const auto& triangle : surface_.triangles)
    for (std::size_t c = 0; c < 3; ++c) edges += norm(surface_.nodes[triangle[(c + 1) % 3]].rest_m - surface_.nodes[triangle[c]].rest_m);
  edge_m_ = surface_.triangles.empty() ? 0.0 : edges / (3.0 * static_cast<double>(surface_.triangles.size()));
  margin_m_ = kMargin * edge_m_;
}

template <typename FindPosition>
Contacts::Nearest Contacts::find_nearest(const Vec3& p, const std::vector<std::int32_t>& triangles, FindPosition&& find_position) const {
  Nearest nearest;
  double least = std::numeric_limits<double>::infinity(), height = 0;
  Vec3 way{}, face{};
  for (const std::int32_t t : triangles) {
    const auto& triangle = surface_.triangles[t];
    const std::array<Vec3, 3> at{find_position(triangle[0]), find_position(triangle[1]), find_position(triangle[2])};
    const Vec3 w = weigh_corners(p, at[0], at[1], at[2]);
    const Vec3 there = p - (w[0] * at[0] + w[1] * at[1] + w[2] * at[2]), twice = cross(at[1] - at[0], at[2] - at[0]);
    const double distance = norm(there), above = dot(there, twice) / norm(twice);
    // Of several triangles that share the nearest point, the one that faces p most decides the side.
    const double same = kEqualDistanceRatio * edge_m_;
    if (!(distance < least - same || (distance < least + same && std::abs(above) > std::abs(height)))) continue;
    least = std::min(least, distance);
    height = above;
    nearest.triangle = t;
    nearest.weights = w;
    way = there;
    face = (1.0 / norm(twice)) * twice;
  }
  const bool is_sheet = surface_.nodes[surface_.triangles[nearest.triangle][0]].reach_m > 0;
  nearest.distance_m = is_sheet || height >= 0 ? least : -least;
  nearest.normal = least > kEqualDistanceRatio * edge_m_ ? (1.0 / nearest.distance_m) * way : face;
  return nearest;
}

void Contacts::check_start() const {
  const double most = kStartOverlap * edge_m_;
  const auto refuse = [](const std::string& who, double depth, const std::string& where) {
    throw InputError(fmt::format("{} lies {:.3g} m deep in {} at the start; move it away", who, depth, where));
  };
  const auto name = [&](std::int32_t body) { return fmt::format("body \"{}\"", names_[body]); };
  for (std::size_t i = 0; i < surface_.nodes.size(); ++i)
    for (std::size_t o = 0; o < obstacles_.size(); ++o) {
      const double depth = surface_.nodes[i].reach_m - find_clearance(obstacles_[o], found_at_m_[i]).distance_m;
      if (depth > most) refuse(name(surface_.nodes[i].body), depth, fmt::format("obstacle {}", o + 1));
    }
  for (const Candidate& candidate : candidates_) {
    const bool is_striker = candidate.vertex < 0;
    const std::size_t vertex = is_striker ? -1 - candidate.vertex : candidate.vertex;
    const Vec3 p = is_striker ? strikers_[vertex].position_m : found_at_m_[vertex];
    const Nearest nearest = find_nearest(p, candidate.triangles, [&](std::int32_t node) { return found_at_m_[node]; });
    const TouchNode& corner = surface_.nodes[surface_.triangles[nearest.triangle][0]];
    const double reach = (is_striker ? strikers_[vertex].radius_m : surface_.nodes[vertex].reach_m) + corner.reach_m;
    const double depth = reach - nearest.distance_m;
    if (depth > most)
      refuse(is_striker ? fmt::format("striker {}", vertex + 1) : name(surface_.nodes[vertex].body), depth, name(candidate.body));
  }
}

void Contacts::search(const Quad* u) {
  gather_positions(u);
  near_obstacles_.clear();
  for (const std::int32_t i : own_)
    for (std::size_t o = 0; o < obstacles_.size(); ++o) {
      const std::size_t s = i;
      if (find_clearance(obstacles_[o], found_at_m_[s]).distance_m < surface_.nodes[s].reach_m + margin_m_)
        near_obstacles_.push_back({i, static_cast<std::int32_t>(o)});
    }
  candidates_.clear();
  active_index_.assign(surface_.nodes.size(), -1);
  if (strikers_.empty() && bodies_ < 2) return;
  const Grid grid = make_grid();
  std::vector<bool> is_active(surface_.nodes.size());
  for (std::size_t s = 0; s < strikers_.size(); ++s)
    find_candidates(grid, -1 - static_cast<std::int32_t>(s), -1, strikers_[s].position_m, strikers_[s].radius_m + margin_m_, is_active);
  if (bodies_ > 1)
    for (std::size_t i = 0; i < surface_.nodes.size(); ++i)
      find_candidates(grid, static_cast<std::int32_t>(i), surface_.nodes[i].body, found_at_m_[i], surface_.nodes[i].reach_m + margin_m_,
                      is_active);
  order_active(is_active);
}

void Contacts::gather_positions(const Quad* u) {
  std::vector<double> all(3 * surface_.nodes.size());  // 0: owned by another rank
  for (const std::int32_t i : own_) {
    const std::size_t s = i;
    const Vec3 at = surface_.nodes[s].rest_m + to_vector(u[place_[s]]);
    for (std::size_t k = 0; k < 3; ++k) all[3 * s + k] = at[k];
  }
  comm_.sum(std::span(all));
  for (std::size_t i = 0; i < surface_.nodes.size(); ++i) found_at_m_[i] = {all[3 * i], all[3 * i + 1], all[3 * i + 2]};
  strikers_at_m_.clear();
  for (const BallStriker& striker : strikers_) strikers_at_m_.push_back(striker.position_m);
}

Contacts::Grid Contacts::make_grid() const {
  double longest = edge_m_;
  for (const auto& triangle : surface_.triangles)
    for (std::size_t c = 0; c < 3; ++c) longest = std::max(longest, norm(found_at_m_[triangle[(c + 1) % 3]] - found_at_m_[triangle[c]]));
  Grid grid{longest + 2.0 * margin_m_, {}};
  for (std::size_t t = 0; t < surface_.triangles.size(); ++t) {
    const auto& triangle = surface_.triangles[t];
    Vec3 low = found_at_m_[triangle[0]], high = low;
    for (std::size_t c = 1; c < 3; ++c)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], found_at_m_[triangle[c]][k]);
        high[k] = std::max(high[k], found_at_m_[triangle[c]][k]);
      }
    const auto from = grid.find(low), to = grid.find(high);
    for (std::int64_t i = from[0]; i <= to[0]; ++i)
      for (std::int64_t j = from[1]; j <= to[1]; ++j)
        for (std::int64_t k = from[2]; k <= to[2]; ++k) grid.at[Grid::hash({i, j, k})].push_back(static_cast<std::int32_t>(t));
  }
  return grid;
}

void Contacts::find_candidates(const Grid& grid, std::int32_t vertex, std::int32_t body, const Vec3& p, double reach,
                               std::vector<bool>& is_active) {
  const auto from = grid.find(p - Vec3{reach, reach, reach}), to = grid.find(p + Vec3{reach, reach, reach});
  std::map<std::int32_t, std::vector<std::int32_t>> near;  // by body
  for (std::int64_t i = from[0]; i <= to[0]; ++i)
    for (std::int64_t j = from[1]; j <= to[1]; ++j)
      for (std::int64_t k = from[2]; k <= to[2]; ++k) {
        const auto cell = grid.at.find(Grid::hash({i, j, k}));
        if (cell == grid.at.end()) continue;
        for (const std::int32_t t : cell->second) {
          const auto& triangle = surface_.triangles[t];
          const std::size_t a = triangle[0], b = triangle[1], c = triangle[2];
          if (surface_.nodes[a].body == body) continue;
          const Vec3 w = weigh_corners(p, found_at_m_[a], found_at_m_[b], found_at_m_[c]);
          const Vec3 at = w[0] * found_at_m_[a] + w[1] * found_at_m_[b] + w[2] * found_at_m_[c];
          if (norm(p - at) < reach + surface_.nodes[a].reach_m) near[surface_.nodes[a].body].push_back(t);
        }
      }
  for (auto& [other, triangles] : near) {
    std::sort(triangles.begin(), triangles.end());
    triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
    for (const std::int32_t t : triangles)
      for (const std::int32_t node : surface_.triangles[t]) is_active[node] = true;
    if (vertex >= 0) is_active[vertex] = true;
    candidates_.push_back({vertex, other, std::move(triangles)});
  }
}

void Contacts::order_active(const std::vector<bool>& is_active) {
  active_.clear();
  std::vector<std::vector<std::int32_t>> by_rank(comm_.size());
  for (std::size_t i = 0; i < is_active.size(); ++i) {
    if (!is_active[i]) continue;
    active_index_[i] = static_cast<std::int32_t>(active_.size());
    active_.push_back(static_cast<std::int32_t>(i));
    by_rank[owner_[i]].push_back(static_cast<std::int32_t>(i));
  }
  active_counts_.clear();
  active_begin_.assign(1, 0);
  active_order_.clear();
  for (const auto& list : by_rank) {
    active_counts_.push_back(static_cast<int>(6 * list.size()));
    active_begin_.push_back(active_begin_.back() + active_counts_.back());
    active_order_.insert(active_order_.end(), list.begin(), list.end());
  }
  sent_.resize(active_counts_[comm_.rank()]);
  received_.resize(6 * active_.size());
  x_.resize(active_.size());
  v_.resize(active_.size());
}

void Contacts::gather_active(const Quad* u, const Quad* v) {
  std::size_t at = 0;
  const std::size_t rank = comm_.rank();
  for (std::size_t k = static_cast<std::size_t>(active_begin_[rank]) / 6; k < static_cast<std::size_t>(active_begin_[rank + 1]) / 6; ++k) {
    const std::size_t i = active_order_[k];
    const Vec3 x = surface_.nodes[i].rest_m + to_vector(u[place_[i]]), speed = to_vector(v[place_[i]]);
    for (std::size_t c = 0; c < 3; ++c) sent_[at++] = x[c];
    for (std::size_t c = 0; c < 3; ++c) sent_[at++] = speed[c];
  }
  MPI_Allgatherv(sent_.data(), static_cast<int>(sent_.size()), MPI_DOUBLE, received_.data(), active_counts_.data(), active_begin_.data(),
                 MPI_DOUBLE, comm_);
  for (std::size_t k = 0; k < active_order_.size(); ++k) {
    const std::size_t i = active_index_[active_order_[k]];
    for (std::size_t c = 0; c < 3; ++c) {
      x_[i][c] = received_[6 * k + c];
      v_[i][c] = received_[6 * k + 3 + c];
    }
  }
}

Vec3 Contacts::calc_force(const StepTime& time, const Key& key, const Pair& pair, Account& account) {
  const auto found = touches_.find(key);
  // Second half of the previous step's work: with the resulting velocity.
  if (found != touches_.end()) account.lost_j -= 0.5 * time.act_before_s * dot(found->second.loss_n, pair.relative_m_s);
  if (!(pair.depth_m > 0)) {
    if (found != touches_.end()) touches_.erase(found);
    return {};
  }
  ++touching_;
  const double closing = -dot(pair.relative_m_s, pair.normal);
  Touch& touch = found != touches_.end()
                     ? found->second
                     : touches_.emplace(key, Touch{std::max(closing, kMinClosingMs), pair.stiffness_n_m, {}}).first->second;
  const double elastic = touch.stiffness_n_m * pair.depth_m;
  // Bodies that separate faster than allowed are released, never pulled.
  const double force = elastic * std::max(0.0, 1.0 + damping_ * closing / touch.closing_m_s);
  touch.loss_n = (force - elastic) * pair.normal;
  const Vec3 slide = pair.relative_m_s + closing * pair.normal;
  const double size = norm(slide);
  if (rules_.friction > 0 && size > 0)
    touch.loss_n = touch.loss_n - (std::min(rules_.friction * force, kStopShare * pair.mass_kg * size / time.act_s) / size) * slide;
  account.stored_j += 0.5 * touch.stiffness_n_m * pair.depth_m * pair.depth_m;
  account.lost_j -= 0.5 * time.act_s * dot(touch.loss_n, pair.relative_m_s);
  return elastic * pair.normal + touch.loss_n;
}

void Contacts::add_obstacles(const StepTime& time, const Quad* u, const Quad* v, Quad* f) {
  for (const auto& [i, o] : near_obstacles_) {
    const std::size_t s = i;
    const TouchNode& node = surface_.nodes[s];
    const Clearance at = find_clearance(obstacles_[o], node.rest_m + to_vector(u[place_[s]]));
    const Pair pair{node.stiffness_n_m, node.reach_m - at.distance_m, mass_kg_[s], at.normal, to_vector(v[place_[s]])};
    Account account;
    add(f[place_[s]], calc_force(time, {i, -1 - o}, pair, account));
    if (account.stored_j != 0) stored_own_.add(account.stored_j);
    if (account.lost_j != 0) lost_own_.add(account.lost_j);
  }
}

void Contacts::add_pairs(const StepTime& time, Quad* f) {
  on_striker_n_.assign(strikers_.size(), Vec3{});
  on_striker_n_m_.assign(strikers_.size(), Vec3{});
  Account account;
  const auto find_active = [&](std::int32_t node) { return static_cast<std::size_t>(active_index_[node]); };
  const auto give = [&](std::int32_t node, const Vec3& force) {
    const std::int32_t place = place_[node];
    if (place >= 0) add(f[place], force);
  };
  for (const Candidate& candidate : candidates_) {
    const bool is_striker = candidate.vertex < 0;
    const std::size_t striker = is_striker ? -1 - candidate.vertex : 0;
    const std::size_t vertex = is_striker ? 0 : candidate.vertex;
    const Vec3 p = is_striker ? strikers_[striker].position_m : x_[find_active(candidate.vertex)];
    const Nearest nearest = find_nearest(p, candidate.triangles, [&](std::int32_t node) { return x_[find_active(node)]; });
    const auto& triangle = surface_.triangles[nearest.triangle];
    Pair pair;
    pair.normal = nearest.normal;
    pair.depth_m = (is_striker ? strikers_[striker].radius_m : surface_.nodes[vertex].reach_m) + surface_.nodes[triangle[0]].reach_m -
                   nearest.distance_m;
    pair.relative_m_s = is_striker ? calc_touching_velocity(strikers_[striker], pair.normal) : v_[find_active(candidate.vertex)];
    double per_mass = is_striker ? kBallSlide / strikers_[striker].mass_kg : 1.0 / mass_kg_[vertex];
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t corner = triangle[c];
      const double w = nearest.weights[c];
      pair.relative_m_s = pair.relative_m_s - w * v_[find_active(triangle[c])];
      pair.stiffness_n_m += w * surface_.nodes[corner].stiffness_n_m;
      per_mass += w * w / mass_kg_[corner];
    }
    if (!is_striker) pair.stiffness_n_m = std::min(pair.stiffness_n_m, surface_.nodes[vertex].stiffness_n_m);
    pair.mass_kg = 1.0 / per_mass;
    const Vec3 force = calc_force(time, {candidate.vertex, candidate.body}, pair, account);
    if (is_striker)
      push_striker(striker, pair.normal, force);
    else
      give(candidate.vertex, force);
    for (std::size_t c = 0; c < 3; ++c) give(triangle[c], -nearest.weights[c] * force);
  }
  add_striker_obstacles(time, account);
  stored_shared_ = account.stored_j;
  lost_shared_ += account.lost_j;
}

Vec3 Contacts::calc_touching_velocity(const BallStriker& striker, const Vec3& normal) {
  return striker.velocity_m_s - striker.radius_m * cross(striker.spin_rad_s, normal);
}

void Contacts::push_striker(std::size_t striker, const Vec3& normal, const Vec3& force) {
  on_striker_n_[striker] = on_striker_n_[striker] + force;
  on_striker_n_m_[striker] = on_striker_n_m_[striker] - strikers_[striker].radius_m * cross(normal, force);
}

void Contacts::move_strikers(const StepTime& time) {
  if (time.act_before_s == 0.0) return;  // no forces yet
  for (std::size_t s = 0; s < strikers_.size(); ++s) {
    BallStriker& striker = strikers_[s];
    const Vec3 before = striker.velocity_m_s;
    striker.velocity_m_s = before + (time.act_before_s / striker.mass_kg) * on_striker_n_[s];
    striker.spin_rad_s = striker.spin_rad_s + (time.act_before_s / striker.find_inertia_kg_m2()) * on_striker_n_m_[s];
    striker.position_m = striker.position_m + time.step_before_s * striker.velocity_m_s;
    gravity_work_ += time.act_before_s * striker.mass_kg * dot(rules_.gravity_m_s2, 0.5 * (before + striker.velocity_m_s));
  }
}

void Contacts::add_striker_obstacles(const StepTime& time, Account& account) {
  for (std::size_t s = 0; s < strikers_.size(); ++s) {
    const BallStriker& striker = strikers_[s];
    on_striker_n_[s] = on_striker_n_[s] + striker.mass_kg * rules_.gravity_m_s2;
    for (std::size_t o = 0; o < obstacles_.size(); ++o) {
      const Clearance at = find_clearance(obstacles_[o], striker.position_m);
      const double soft = kStrikerPhase / time.step_s;
      const Pair pair{striker.mass_kg * soft * soft, striker.radius_m - at.distance_m, striker.mass_kg / kBallSlide, at.normal,
                      calc_touching_velocity(striker, at.normal)};
      const Key key{-1 - static_cast<std::int32_t>(s), -1 - static_cast<std::int32_t>(o)};
      push_striker(s, at.normal, calc_force(time, key, pair, account));
    }
  }
}

void Contacts::look_around(const StepTime& time, const Quad* u, const Quad* v) {
  double moved = 0, fastest = 0;
  for (const std::int32_t i : own_) {
    const std::size_t s = i;
    take_larger(norm(surface_.nodes[s].rest_m + to_vector(u[place_[s]]) - found_at_m_[s]), moved);
    take_larger(norm(to_vector(v[place_[s]])), fastest);
  }
  for (std::size_t s = 0; s < strikers_.size(); ++s) {
    if (s < strikers_at_m_.size()) take_larger(norm(strikers_[s].position_m - strikers_at_m_[s]), moved);
    take_larger(norm(strikers_[s].velocity_m_s), fastest);
  }
  std::array<double, 2> most{moved, fastest};
  // Forces grow with the cube of the displacement: detect divergence before positions become non-finite.
  for (double& value : most)
    if (!std::isfinite(value)) value = std::numeric_limits<double>::infinity();
  comm_.max(std::span<double>(most));
  if (!(most[0] < kMaxPositionM && most[1] < kMaxSpeedMs))
    throw SolveError(fmt::format("the bodies move without bounds at {:.6g} s, step {}: use a weaker blow, a shorter step or a finer mesh",
                                 time.time_s, time.step));
  const bool is_first = active_index_.empty();
  if (is_first || most[0] > 0.25 * margin_m_) search(u);
  if (is_first && time.step == 0) comm_.agree([&] { check_start(); });
  // Two approaching bodies use up the margin from both sides, and a struck body may double its speed before the next check.
  const double per_step = 4.0 * most[1] * time.step_s;
  steps_to_look_ =
      per_step > 0 ? std::clamp(static_cast<std::int64_t>(0.25 * margin_m_ / per_step), std::int64_t{1}, kMaxCheckSteps) : kMaxCheckSteps;
}

void Contacts::add_forces(const StepTime& time, const Quad* u, const Quad* v, Quad* f) {
  if (!is_needed()) return;
  move_strikers(time);
  act_s_ = time.act_s;
  if (steps_to_look_ == 0) look_around(time, u, v);
  --steps_to_look_;
  stored_own_ = {};
  stored_shared_ = 0;
  touching_ = 0;
  add_obstacles(time, u, v, f);
  if (!active_.empty()) gather_active(u, v);
  if (!candidates_.empty() || !strikers_.empty()) add_pairs(time, f);
}

double Contacts::calc_longest_step_s(const std::vector<double>& omega_rad_s) const {
  double longest = std::numeric_limits<double>::infinity();
  if (is_needed())
    for (const std::int32_t i : own_) {
      const std::size_t s = i;
      const double omega = omega_rad_s[surface_.nodes[s].body];
      longest = std::min(longest, 2.0 / std::sqrt(omega * omega + surface_.nodes[s].stiffness_n_m / mass_kg_[s]));
    }
  return comm_.min(longest);
}

ExternalForces::Energy Contacts::calc_energy() {
  std::array<OrderFreeSum, 2> sums{stored_own_, lost_own_};
  const std::vector<double> own = calc_sums(comm_, sums);
  Energy energy{own[0] + stored_shared_, own[1] + lost_shared_, gravity_work_};
  // As in the energy book: mid-step, kinetic energy from the velocities of both halves.
  for (std::size_t s = 0; s < strikers_.size(); ++s) {
    const BallStriker& striker = strikers_[s];
    const Vec3& v = striker.velocity_m_s;
    energy.stored_j += 0.5 * (striker.mass_kg * dot(v, v) + act_s_ * dot(v, on_striker_n_[s]));
    const Vec3& spin = striker.spin_rad_s;
    energy.stored_j += 0.5 * (striker.find_inertia_kg_m2() * dot(spin, spin) + act_s_ * dot(spin, on_striker_n_m_[s]));
    energy.put_in_j += 0.5 * act_s_ * striker.mass_kg * dot(rules_.gravity_m_s2, v);
  }
  return energy;
}

namespace {

/// Checkpointed contact.
struct KeptTouch {
  std::int32_t first, second;
  double closing_m_s, stiffness_n_m;
  Vec3 loss_n;
};

struct KeptHead {
  std::int64_t strikers, touches;
  double lost_j, gravity_j, act_s;
};

}  // namespace

std::vector<std::byte> Contacts::save() {
  // Contacts of nodes with obstacles are known to their owner only.
  std::vector<KeptTouch> own;
  for (const auto& [key, touch] : touches_) {
    const bool is_local = key[0] >= 0 && key[1] < 0;
    if (is_local || comm_.is_root()) own.push_back({key[0], key[1], touch.closing_m_s, touch.stiffness_n_m, touch.loss_n});
  }
  const std::vector<KeptTouch> all = comm::gather(comm_, own);
  OrderFreeSum lost = lost_own_;
  const double lost_j = calc_sum(comm_, lost) + lost_shared_;
  return comm_.agree([&] {
    std::vector<std::byte> bytes;
    if (!comm_.is_root()) return bytes;
    const auto put = [&](const void* data, std::size_t size) {
      const auto* from = static_cast<const std::byte*>(data);
      bytes.insert(bytes.end(), from, from + size);
    };
    const KeptHead head{static_cast<std::int64_t>(strikers_.size()), static_cast<std::int64_t>(all.size()), lost_j, gravity_work_, act_s_};
    put(&head, sizeof head);
    put(strikers_.data(), strikers_.size() * sizeof(BallStriker));
    put(on_striker_n_.data(), on_striker_n_.size() * sizeof(Vec3));
    put(on_striker_n_m_.data(), on_striker_n_m_.size() * sizeof(Vec3));
    put(all.data(), all.size() * sizeof(KeptTouch));
    return bytes;
  });
}

void Contacts::load(std::span<const std::byte> bytes) {
  const std::vector<std::byte> all = comm_.broadcast(std::vector<std::byte>(bytes.begin(), bytes.end()));
  comm_.agree([&] {
    KeptHead head{};
    constexpr std::size_t kStrikerBytes = sizeof(BallStriker) + 2 * sizeof(Vec3);
    const auto refuse = [] { throw InputError("the checkpoint's contacts are cut off or of other bodies; start again without it"); };
    if (all.size() < sizeof head) refuse();
    std::memcpy(&head, all.data(), sizeof head);
    const std::size_t strikers = head.strikers, touches = head.touches;
    if (strikers != strikers_.size() || touches > all.size() ||
        all.size() != sizeof head + strikers * kStrikerBytes + touches * sizeof(KeptTouch))
      refuse();
    std::memcpy(strikers_.data(), all.data() + sizeof head, strikers * sizeof(BallStriker));
    std::memcpy(on_striker_n_.data(), all.data() + sizeof head + strikers * sizeof(BallStriker), strikers * sizeof(Vec3));
    std::memcpy(on_striker_n_m_.data(), all.data() + sizeof head + strikers * (sizeof(BallStriker) + sizeof(Vec3)),
                strikers * sizeof(Vec3));
    touches_.clear();
    for (std::size_t t = 0; t < touches; ++t) {
      KeptTouch kept{};
      std::memcpy(&kept, all.data() + sizeof head + strikers * kStrikerBytes + t * sizeof kept, sizeof kept);
      if (kept.first >= static_cast<std::int32_t>(surface_.nodes.size())) refuse();
      const bool is_local = kept.first >= 0 && kept.second < 0;
      if (!is_local || place_[kept.first] >= 0) touches_[{kept.first, kept.second}] = {kept.closing_m_s, kept.stiffness_n_m, kept.loss_n};
    }
    lost_own_ = {};
    lost_shared_ = head.lost_j;
    gravity_work_ = head.gravity_j;
    act_s_ = head.act_s;
  });
  active_index_.clear();
  steps_to_look_ = 0;
}

}  // namespace carillon::transient
