// Windows of 2 ms: near pairs, free flights, and the small steps of the other bodies.
#pragma once

#include <cstdint>
#include <list>
#include <vector>

#include "runtime/base/groups.hpp"
#include "runtime/physics/rigid/modal_impact.hpp"
#include "runtime/physics/rigid/options.hpp"
#include "runtime/physics/rigid/step.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"

namespace carillon::rigid {

/// The current window. Invariants: pairs that are not near cannot touch before its end; a flying body is at its end-of-window state and
/// meets nothing on its way; the steps of an island do not depend on other islands.
class Windows {
 public:
  static constexpr double kLength = 2e-3;  // s

  Windows(Bodies& bodies, TouchSets& touches, const Options& options, Ledger& ledger);

  // Call in this order: new window, flights, small steps.
  /// Determines the pairs that are near until the end of the window, `end_s` at the latest. All bodies are at its start.
  void open(double end_s, const std::list<ModalImpact>& impacts);
  /// Moves bodies that can meet nothing to the end of the window; returns them.
  const std::vector<int>& fly_bodies();
  /// True if an articulation can meet nothing.
  bool may_fly(const Articulation& articulation) const;
  void fly(Articulation& articulation);
  /// Step length of each group of bodies that may meet in this window: some take several small steps at once.
  void choose_steps();
  /// A window in which all bodies sleep.
  void skip(double end_s);

  double get_start() const { return start_s_; }
  double get_end() const { return end_s_; }
  double get_length() const { return end_s_ - start_s_; }
  /// Start time of a small step.
  double find_time(int step) const { return step >= steps_ ? end_s_ : start_s_ + (end_s_ - start_s_) * step / steps_; }
  double get_time() const { return find_time(step_); }
  /// Length of the next `steps` small steps.
  double calc_length(int steps) const { return find_time(step_ + steps) - get_time(); }
  void next_step() { ++step_; }
  bool is_over() const { return step_ == steps_; }
  /// True if any body does not fly.
  bool has_steps() const { return any_active_; }
  /// True if a step of the body starts now.
  bool is_due(int body) const { return step_ % strides_[body] == 0; }
  /// Small steps until both bodies of a pair are due again; 0: not due now, or both static.
  int find_stride(const Pair& pair) const;

  /// Pairs that may touch; sorted after sort_near().
  const std::vector<Pair*>& near() const { return near_; }
  void sort_near();
  void add(Pair& pair);
  /// Drops the pairs of a body, which are about to be removed.
  void forget(int body);
  void add(int a, int b);
  /// Islands whose steps start now.
  std::vector<Island> make_islands(const std::list<ModalImpact>& impacts);
  /// Groups of moving bodies that may touch each other in the window.
  int count_islands() const { return islands_; }

  /// A woken body takes the steps of the one that wakes it, which is due: so they do not depend on other islands.
  void wake(int body, int by);
  /// Adds the pairs that a body may reach after an impact beyond its planned speed, or at a speed of at least `least_m_s`.
  void extend(int body, double least_m_s);

 private:
  /// A body that may roll alone, on smooth persistent touches.
  struct Rolling {
    bool spans = false;  // its touches are far apart
    int steps = 0;       // in the last window; 0: did not roll
    double asked = 0.0;  // in this window; 0: does not roll
  };

  void open_cords();
  void find_rolling(base::Groups& groups);
  void join_sleeping(base::Groups& groups) const;
  void undo_flight(int body, int by);

  Bodies& bodies_;
  TouchSets& touches_;
  const Options& options_;
  Ledger& ledger_;
  double start_s_ = 0.0, end_s_ = 0.0;
  std::int64_t number_ = 0;
  int step_ = 0, steps_ = 1, islands_ = 0;
  bool any_active_ = false, near_is_sorted_ = true;
  std::vector<Pair*> near_;
  PerBody<char> active_, flying_;  // active: may meet something
  std::vector<int> flown_;
  PerBody<int> strides_;  // small steps that a body takes at once
  PerBody<Rolling> rolling_;
  PerBody<double> reach_m_s_;  // planned speed
  PerBody<State> flew_from_;   // of flying bodies; and of the articulations:
  std::vector<joints::Coordinates> articulation_flew_from_;
};

}  // namespace carillon::rigid
