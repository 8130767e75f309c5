// Positions of contact, tracked from step to step: beginnings and ends of hits, and loads. Internal to this folder.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "runtime/drive/lasting.hpp"
#include "runtime/drive/touch_bodies.hpp"

namespace carillon::drive {

/// A complete hit.
struct FinishedHit {
  int a = 0, b = -1;
  double opened_s = 0.0;  // start of its first step
  double touch_s = 0.0, end_s = 0.0;
  double approach_m_s = 0.0, parting_m_s = 0.0;  // before and after; parting >= 0
  double inverse_mass = 0.0;                     // 1/m_eff along the normal [1/kg]
  double push_n_s = 0.0;                         // along the normal, without weight
  double energy_share = 1.0;                     // at most this part of m v^2/2 is its own, as further hits share the motion
  bool is_predicted = false;                     // the impulse is that of a rigid impact at this point alone
  double curvature_per_m = 0.0;                  // NaN: unknown
  Vec3 normal{};                                 // world, from b to a
  std::array<Vec3, 2> stations_m{}, outwards{};  // on a and b, mesh axes; outward normals
  std::array<Vec3, 2> impulses_n_s{};            // on a and b, mesh axes
  std::array<Motion, 2> before{};                // motions of a and b before its first step, velocities at the touch
  std::uint64_t spot = 0;                        // number of its position
  bool is_shared = false;                        // its bodies did not close here: they pass on a hit elsewhere
  std::vector<FinishedHit> supports{};           // loaded positions of the struck bodies at its begin, without impulses
};

/// Invariant: a position belongs to one pair (a, b), in the order of the names; it lives until it has had no load for a few steps.
class TouchSpots {
 public:
  /// A step with its points, sorted by pair and impulse. Appends finished hits and the averaged load of every position.
  void advance(const StepView& step, std::span<const StepPoint> points, TouchesCounters& counters, std::vector<FinishedHit>& hits,
               std::vector<Load>& loads);
  /// Forgets all positions of a body.
  void forget(int body);
  /// Begin of the earliest hit that is not appended yet; at most `now_s`.
  double find_first_open(double now_s) const;

 private:
  /// Points of a step at one position.
  struct Group {
    int a = 0, b = -1;
    double push_n_s = 0.0, approach_m_s = 0.0, gap_m = 0.0, curvature_per_m = 0.0;
    Vec3 where_m{}, normal{}, impulse_n_s{};  // where: at the end of the step
    std::array<Vec3, 2> stations_m{};         // mesh frames
  };
  struct Spot {
    std::uint64_t number = 0;  // identity for LastingContacts
    int a = 0, b = -1;
    Vec3 where_m{}, normal{};
    std::array<Vec3, 2> stations_m{};
    double curvature_per_m = -1.0;                     // of both surfaces; negative: unknown
    int owner = -2;                                    // body with the sharper surface; -2: unknown
    bool is_round = false;                             // the owner: the position may roll over it
    double born_s = 0.0, seen_s = 0.0, quiet_s = 0.0;  // first and last step with a push; end of the last hit
    double load_n = 0.0, mean_n = 0.0;                 // averaged: without hits, with hits
    Vec3 slip_m_s{};                                   // averaged slip,
    double slip_speed_m_s = 0.0;                       // and averaged magnitude of it
    bool is_gone = false, is_open = false, is_reported = false;
    double peak_n = 0.0;  // of the open hit
    FinishedHit hit;      // sums of the open hit, weighted by impulse
  };

  std::vector<Group> make_groups(const StepView& step, std::span<const StepPoint> points) const;
  Spot& find_spot(const StepView& step, const Group& group, std::vector<Spot>& spots);
  void follow(const StepView& step, Group group, int count, Spot& spot, std::vector<FinishedHit>& hits);
  void open(const StepView& step, const Group& group, double wait_s, double inverse_mass, Spot& spot);
  static FinishedHit make_support(const StepView& step, const Spot& spot);
  static bool carries(const StepView& step, const Spot& spot);
  std::vector<FinishedHit> find_supports(const StepView& step, const Spot& struck) const;
  void hold_shared(std::vector<FinishedHit>& hits);
  void gather(const StepView& step, const Group& group, double push_n_s, Spot& spot);
  void report_early(const StepView& step, Spot& spot, std::vector<FinishedHit>& hits);
  void close(const StepView& step, Spot& spot, std::vector<FinishedHit>& hits);
  static Vec3 calc_where(const StepView& step, const Group& group, const Spot& spot);
  void miss(const StepView& step, Spot& spot, std::vector<FinishedHit>& hits);
  static void note_slip(const StepView& step, const Group& group, Spot& spot);
  void add_load(const StepView& step, Spot& spot, std::vector<Load>& loads) const;

  std::map<std::pair<int, int>, std::vector<Spot>> spots_;
  std::vector<FinishedHit> held_;  // shared hits, until those that caused them are complete
  std::vector<double> struck_s_;   // per body: first touch in this step; infinity: none
  std::vector<double> fastest_;    // per body: largest speed of approach in this step [m/s]
  std::uint64_t numbers_ = 0;
  TouchesCounters* counters_ = nullptr;
};

}  // namespace carillon::drive
