// Penalty contact of deformable bodies with each other, with free rigid balls and with rigid obstacles; Coulomb friction.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/simulation/transient/domain.hpp"
#include "precompute/simulation/transient/motion.hpp"
#include "precompute/simulation/transient/order_free_sum.hpp"
#include "precompute/simulation/transient/quad.hpp"
#include "precompute/simulation/transient/touch_surface.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::transient {

using job::BallStriker;

struct TouchRules {
  double restitution = 1.0;  // of contact alone: separation over closing speed of rigid bodies
  double friction = 0.0;     // Coulomb
  Vec3 gravity_m_s2{};       // of strikers
};

/// Finds contacts and adds their forces. Pairs that may touch are known to all ranks and computed redundantly, bit-identical; contacts with
/// obstacles only stay with the node's owner. The search repeats when something may have moved by part of its margin.
class Contacts : public ExternalForces {
 public:
  /// Collective.
  Contacts(const Domain& domain, TouchSurface surface, std::vector<BallStriker> strikers, std::vector<RigidObstacle> obstacles,
           const TouchRules& rules);

  /// The first call throws InputError on every rank if bodies, strikers or obstacles overlap by more than a tenth of an edge.
  void add_forces(const StepTime& time, const Quad* u, const Quad* v, Quad* f) override;
  double calc_longest_step_s(const std::vector<double>& omega_rad_s) const override;
  Energy calc_energy() override;

  const std::vector<BallStriker>& get_strikers() const { return strikers_; }
  /// True if any contact is possible.
  bool is_needed() const { return !obstacles_.empty() || !strikers_.empty() || bodies_ > 1; }
  /// Contacts in the last step, on this rank.
  std::size_t count_touching() const { return touching_; }

  /// State as bytes on rank 0, empty elsewhere, independent of the number of ranks. Collective.
  std::vector<std::byte> save();
  /// Resumes from such bytes. Throws InputError on every rank for truncated data or other bodies. Collective.
  void load(std::span<const std::byte> bytes);

 private:
  struct Touch {
    double closing_m_s = 0;    // speed at the beginning of the contact
    double stiffness_n_m = 0;  // constant during the contact: conserves the stored energy
    Vec3 loss_n{};             // friction and damping of the previous step
  };
  using Key = std::array<std::int32_t, 2>;  // contact pair: a surface node or -1 - striker; a body or -1 - obstacle
  /// Candidate pair.
  struct Pair {
    double stiffness_n_m = 0, depth_m = 0;
    double mass_kg = 0;   // combined effective mass at the contact, tangential
    Vec3 normal{};        // from the second to the first
    Vec3 relative_m_s{};  // of the first relative to the second
  };

  struct Nearest {
    double distance_m = 0;  // negative: inside a solid
    Vec3 weights{}, normal{};
    std::int32_t triangle = -1;
  };
  /// At least one triangle.
  template <typename FindPosition>
  Nearest find_nearest(const Vec3& p, const std::vector<std::int32_t>& triangles, FindPosition&& find_position) const;

  void check_start() const;
  void search(const Quad* u);
  struct Grid;
  void gather_positions(const Quad* u);
  Grid make_grid() const;
  /// Triangles of other bodies within reach of a vertex, or of striker -1 - vertex.
  void find_candidates(const Grid& grid, std::int32_t vertex, std::int32_t body, const Vec3& p, double reach, std::vector<bool>& is_active);
  void order_active(const std::vector<bool>& is_active);
  void look_around(const StepTime& time, const Quad* u, const Quad* v);
  void gather_active(const Quad* u, const Quad* v);
  void add_obstacles(const StepTime& time, const Quad* u, const Quad* v, Quad* f);
  void add_pairs(const StepTime& time, Quad* f);
  struct Account {
    double stored_j = 0, lost_j = 0;
  };
  Vec3 calc_force(const StepTime& time, const Key& key, const Pair& pair, Account& account);
  /// Velocity of a ball's contact point on a surface with this normal.
  static Vec3 calc_touching_velocity(const BallStriker& striker, const Vec3& normal);
  void push_striker(std::size_t striker, const Vec3& normal, const Vec3& force);
  /// By the forces of the previous step.
  void move_strikers(const StepTime& time);
  void add_striker_obstacles(const StepTime& time, Account& account);

  comm::Communicator comm_;
  TouchSurface surface_;
  std::vector<BallStriker> strikers_;
  std::vector<RigidObstacle> obstacles_;
  TouchRules rules_;
  double damping_ = 0;  // Hunt-Crossley damping, over the closing speed
  std::int32_t bodies_ = 0;
  std::vector<std::int32_t> place_;  // (surface nodes) index on this rank, -1
  std::vector<std::int32_t> own_;    // surface nodes of this rank
  std::vector<std::int32_t> owner_;  // (surface nodes) rank
  std::vector<double> mass_kg_;      // (surface nodes)
  std::vector<std::string> names_;   // of bodies
  double margin_m_ = 0, edge_m_ = 0;
  // Last search:
  std::vector<Vec3> found_at_m_;  // (surface nodes) positions at the search
  std::vector<Vec3> strikers_at_m_;
  std::vector<std::array<std::int32_t, 2>> near_obstacles_;  // own surface node, obstacle
  std::vector<std::int32_t> active_;                         // surface nodes whose state every rank gets, ascending
  std::vector<std::int32_t> active_index_;                   // (surface nodes) into active_, -1
  struct Candidate {
    std::int32_t vertex;  // surface node, or -1 - striker
    std::int32_t body;    // of the triangles
    std::vector<std::int32_t> triangles;
  };
  std::vector<Candidate> candidates_;
  std::vector<int> active_counts_, active_begin_;  // (ranks) doubles
  std::vector<double> sent_, received_;
  std::vector<std::int32_t> active_order_;  // (received) surface node
  std::vector<Vec3> on_striker_n_;          // forces of this step
  std::vector<Vec3> on_striker_n_m_;        // moments about the centre
  double act_s_ = 0;                        // duration of their action
  std::vector<Vec3> x_, v_;                 // (active)
  std::int64_t steps_to_look_ = 0;
  std::map<Key, Touch> touches_;
  OrderFreeSum stored_own_, lost_own_;                             // [J] of this rank's nodes and obstacles
  double stored_shared_ = 0, lost_shared_ = 0, gravity_work_ = 0;  // [J] the same on every rank
  std::size_t touching_ = 0;
};

/// Damping a of Hunt and Crossley's contact f = k d (1 + a d' / v) with separation speed `restitution` times v: (1 + a) / (1 - a e) = exp(a
/// (1 + e)) (Gonthier et al. 2004), independent of the mass. 0 for e = 1.
double calc_hunt_crossley(double restitution);

}  // namespace carillon::transient
