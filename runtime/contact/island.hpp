// Bodies that may touch each other within a window of time, as one Simbody system: how they fall, strike and rest.
#pragma once

#include <Simbody.h>

#include <cstdint>
#include <vector>

#include "runtime/contact/engine.hpp"
#include "runtime/contact/lasting.hpp"
#include "runtime/stream/events.hpp"

namespace carillon::contact {

/// A point that was in contact a moment ago.
struct OldPoint {
  int a = 0, b = -1;
  SimTK::Vec3 in_a{0};
  double time_s = 0.0;
};

/// Its own numbers of bodies are those of its world; what comes out (events, recent points) has the numbers of the scene.
class Island {
 public:
  /// `world`: the bodies that belong together and all that stand still, as they are at time_s. members[i]: the number in the scene of its
  /// body i, rising. `recent`, `rested`, `spots`: the points of the whole scene that were in contact within the last moments, those that
  /// hold bodies up, and what touches. `touches`: counted before the window; must outlive this. `options`: of the world.
  Island(WorldModel world, std::vector<int> members, SurfaceSet& surfaces, double time_s, const std::vector<OldPoint>& recent,
         const std::vector<RestedPoint>& rested, const std::vector<Spot>& spots, const TouchCounts& touches, const WorldOptions& options);

  /// From now on events and moves are counted anew.
  void begin_window();
  /// One step towards the time given; true when it is reached. Throws SolveError.
  bool step(double until_s);

  /// Whether all lies where it lies until another comes near: a step only lets time pass.
  bool is_asleep() const;

  const std::vector<int>& get_members() const { return members_; }
  /// How far any point of its body i has moved since begin_window, at most [m].
  double get_moved_m(std::size_t i) const { return moved_m_[i]; }
  const std::vector<stream::Event>& get_events() const { return events_; }
  std::int64_t get_steps() const { return steps_; }
  /// The same, each times the bodies that it moved.
  std::int64_t calc_body_steps() const;
  /// Engine::calc_energy_j now, Engine::calc_kinetic_j, and what hits have taken since begin_window, all of them and the one that took
  /// least (below 0: gave). What hits took is only kept where WorldOptions::audits_energy asks for it.
  double calc_energy_j() const { return engine_.calc_energy_j(state_); }
  double calc_kinetic_j() const { return engine_.calc_kinetic_j(state_); }
  double get_taken_j() const { return taken_j_; }
  double get_least_taken_j() const { return least_taken_j_; }
  /// Writes where its moving bodies are and how they move into the scene's.
  void store(WorldModel& scene) const;
  void add_recent(std::vector<OldPoint>& out) const;
  void add_rested(std::vector<RestedPoint>& out) const;
  void add_spots(std::vector<Spot>& out) const;
  const TouchCounts& get_touches() const { return lasting_.get_touches(); }

 private:
  struct Step {
    Snapshot state;
    bool impact = false;
  };

  int find_member(int body) const { return body < 0 ? -1 : members_[body]; }
  void record();
  void follow_contacts();
  void note_moves();
  bool is_still(bool in_touch) const;
  std::vector<OldPoint> find_old(const Snapshot& now, const std::vector<TouchPoint>& touches) const;
  bool is_old(const TouchPoint& touch, const Snapshot& now, double approach) const;
  void remember(const Snapshot& now, const std::vector<TouchPoint>& touches);
  std::vector<TouchPoint> find_fresh(const Snapshot& now, double faster_than) const;
  Step calc_step(double step_s);
  double calc_duration(int a, int b, const Snapshot& now, const SimTK::Vec3& where, const SimTK::Vec3& normal, double mass,
                       double speed) const;
  bool leaves_again(const ImpactPoint& point, double approach, const Snapshot& now) const;
  void strike();
  void emit(const std::vector<ImpactPoint>& points, const std::vector<TouchPoint>& touches, const Snapshot& before);
  void emit_spot(const std::vector<const ImpactPoint*>& points, double touch_s, const Snapshot& before);

  WorldModel world_;
  std::vector<int> members_;
  Engine engine_;
  Snapshot state_;
  std::vector<OldPoint> old_;     // in contact when the step began and not about to leave
  std::vector<OldPoint> recent_;  // in contact within the last kRollingTime
  bool has_lasting_ = true;
  bool audits_ = false;
  double taken_j_ = 0.0, least_taken_j_ = 0.0;
  LastingContacts lasting_;
  int stuck_ = 0;  // impacts in a row with no time between them
  double still_since_s_ = 0.0;
  std::vector<SimTK::Transform> begin_poses_;
  std::vector<double> moved_m_;
  std::vector<stream::Event> events_;
  std::int64_t steps_ = 0;
};

}  // namespace carillon::contact
