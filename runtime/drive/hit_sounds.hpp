// Hits of a step as pulses or as impacts with modes. Internal to this folder.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "runtime/drive/corners.hpp"
#include "runtime/drive/lasting.hpp"
#include "runtime/drive/pulses.hpp"
#include "runtime/drive/ringing.hpp"
#include "runtime/drive/touch_spots.hpp"
#include "runtime/physics/impact/face.hpp"

namespace carillon::drive {

/// Invariant: no hit gives the modes of its bodies more energy than it took from their motion, and at no instant more than that of the
/// blow.
class HitSounds {
 public:
  void resize(int bodies) {
    masks_.resize(bodies);
    ringing_.resize(static_cast<std::size_t>(bodies));
  }
  void forget(int body) {
    masks_.forget(body);
    ringing_[static_cast<std::size_t>(body)] = {};
  }

  /// Sounds the hits of a step, strongest first. `open_s`: later ones touch no earlier. Appends events and notifies `lasting`.
  void add(const StepView& step, std::vector<FinishedHit>& hits, double open_s, LastingContacts& lasting, TouchesCounters& counters,
           std::vector<events::Event>& events);
  /// True while ringing bodies rattle at a position after an impact there: nothing rests on it.
  bool is_rattling(std::uint64_t spot, double time_s) const {
    const auto found = rattles_s_.find(spot);
    return found != rattles_s_.end() && time_s < found->second;
  }

 private:
  /// A hit as an impact of two points.
  struct RigidBlow {
    double mass_kg = 0.0, speed_m_s = 0.0, restitution = 0.0;

    /// Kinetic energy before [J].
    double calc_energy_j() const;
    /// Of it lost [J], at least 1 %.
    double calc_lost_j() const;
  };

  /// A hit and the properties of its pulse.
  struct Contact {
    const FinishedHit& hit;
    RigidBlow rigid{};
    double radius_m = 0.0, compliance = 0.0;
    Blow blow{};                                  // the hit as a Hertz pulse,
    double modal_j = 0.0;                         // and the energy it would give to the modes
    std::array<std::vector<double>, 2> shapes{};  // (n, 3) at the places of the blow, mesh axes; empty: no modes
    double ringing_m_s = 0.0;                     // speed of the surfaces by earlier hits, amplitudes added

    /// True if the hit must be integrated with the modes of its bodies.
    bool needs_modes() const;
  };

  /// An impact before its integration. `contacts`: hits, added corners, then supports; they refer to `made`. `gaps_m`, `shapes`, `springs`,
  /// `faces`: one per contact; `bodies`, `names`: one per body.
  struct Setup {
    Setup() = default;
    Setup(Setup&&) = default;
    double touch_s = 0.0;
    std::vector<FinishedHit> made;
    std::vector<Contact> contacts;
    std::size_t struck = 0;  // contacts that are no supports
    std::vector<double> gaps_m;
    std::vector<std::array<std::vector<double>, 2>> shapes;  // of a and b, world axes
    std::vector<impact::Contact> springs;
    std::vector<impact::FaceCorner> faces;
    std::vector<impact::Body> bodies;
    std::vector<int> names;  // of the bodies
  };

  static RigidBlow make_rigid(const FinishedHit& hit);
  static void share_energy(const StepView& step, std::span<FinishedHit* const> hits);
  Contact make_contact(const StepView& step, const FinishedHit& hit) const;
  double calc_ringing(const StepView& step, const Contact& contact, double time_s, bool is_speed) const;
  double find_rattle_end(const StepView& step, const Contact& contact, double time_s) const;
  void excite(const StepView& step, const Contact& contact, const Blow& blow);
  std::vector<Contact> gather(const StepView& step, std::span<const FinishedHit* const> hits, std::size_t first);
  void sound(const StepView& step, const std::vector<Contact>& contacts, TouchesCounters& counters, std::vector<events::Event>& events);
  std::vector<StruckBody> find_struck(const StepView& step, const Contact& contact);
  static std::vector<double> calc_rigid_pushes(const StepView& step, std::span<const FinishedHit* const> hits);
  static void join_predicted(const StepView& step, std::vector<FinishedHit>& hits);
  bool advance(impact::Impact& impact, std::span<const impact::FaceCorner> faces, double hertz_s);
  void add_corners(const StepView& step, const FinishedHit& first, std::span<const Corner> corners,
                   std::span<const FinishedHit* const> supports, Setup& setup) const;
  Setup choose_contacts(const StepView& step, const std::vector<Contact>& hits) const;
  Setup set_up(const StepView& step, const std::vector<Contact>& hits);
  bool integrate(const StepView& step, const std::vector<Contact>& contacts, TouchesCounters& counters, std::vector<events::Event>& events);
  impact::Body make_body(const StepView& step, int index, const Motion& before, bool has_modes, double touch_s);
  static double keep_ringing(const impact::Impact& impact, std::vector<impact::Body> before, std::vector<StruckBody>& struck,
                             double touch_s, double scale, double blow_j, double most_j);
  static void add_modal_forces(std::span<const Contact> contacts, std::span<const impact::Contact> springs,
                               std::span<const impact::Pulse> pulses, double touch_s, std::vector<StruckBody>& struck);
  static void add_forces(const StepView& step, const Contact& contact, double touch_s, std::size_t index,
                         std::span<const impact::Pulse> pulses, double scale, std::vector<events::Event>& events);

  std::vector<char> taken_;  // per hit of the step: part of an impact already
  Masks masks_{0};
  std::vector<Ringing> ringing_;                // per body
  std::map<std::uint64_t, double> included_s_;  // by position: end of the last hit whose impact included it as a support,
  std::map<std::uint64_t, double> rattles_s_;   // and end of its rattling
  double work_left_ = 0.0;                      // for impacts with modes, in steps of an impact with one contact,
  double worked_s_ = -1e9;                      // at this time
};

}  // namespace carillon::drive
