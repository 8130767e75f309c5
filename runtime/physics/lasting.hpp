// Contacts that last: separated from impacts, followed while they last, and written down as stream events.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/physics/rigid/space.hpp"

namespace carillon::physics {

/// What of a body the records need that its motion does not.
struct Matter {
  std::string name;
  double young_modulus_pa = 0.0, poisson_ratio = 0.0, density_kg_m3 = 0.0;
};

/// Points of a pair nearer to each other than this belong to one spot [m]: a tenth of the smaller body's size.
double calc_spot_radius(const rigid::Space& space, int a, int b);

/// The place of a point of the world on a body's bank; `hint`: a triangle that may be it.
struct Spotted {
  std::int32_t triangle = 0;
  Vec3 barycentric{};
};
Spotted find_place(const rigid::Solid& solid, const rigid::State& state, const Vec3& where, const Vec3& outward, std::int32_t hint = -1);

/// The places where bodies touch, followed from step to step. A contact has one id, from kBegin over any number of kHold to kEnd; its
/// records come in the order of time, and no two open contacts have the same id.
class LastingContacts {
 public:
  /// One a body, and one for the ground at the end.
  explicit LastingContacts(std::vector<Matter> matter) : matter_(std::move(matter)) {}

  /// After a step: what touches now. Appends events.
  void update(const rigid::Space& space, std::vector<events::Event>& events);
  /// An impact at a place: what follows there is no lasting contact for the next moments.
  void note_impact(const rigid::Space& space, int a, int b, const Vec3& where, double time_s);

 private:
  /// What touches at one place now.
  struct Group {
    int a = 0, b = -1;
    Vec3 where{}, normal{}, turn{};
    Vec3 carried{};  // the velocity of the surface whose points carry
    double push_n = 0.0, curvature_per_m = 0.0;
    bool smooth = false;
    std::uint64_t features = 0;  // which of them carry
  };
  /// A place where two bodies touch, followed while they do.
  struct Spot {
    std::uint64_t id = 0;  // of the contact, from its first record on
    int a = 0, b = -1;
    Vec3 where{};
    Vec3 drift{};                // velocity of the place over the surface that carries, smoothed
    std::uint64_t features = 0;  // which points carry there
    double quiet_s = 0.0;        // time of the first touch, or of the last impact since
    double seen_s = 0.0;         // when it last touched
    double recorded_s = 0.0;
    double begun_s = -1.0;                       // time of its first record; below 0: none yet
    double rises_s = 0.0, from_n = 0.0;          // the force rises from there, since its first record or since it lay
    double load_n = 0.0;                         // smoothed
    bool lies = false;                           // both bodies lie still
    double radius_m = 0.0;                       // of the Hertz contact of both surfaces there
    std::array<events::LastingContact, 2> last;  // of both bodies
  };

  /// A contact that carries.
  struct Carrier {
    const rigid::Contact* contact = nullptr;
    double push_n = 0.0;
    bool is_taken = false;
  };

  void make_groups(const rigid::Space& space);
  Group make_group(const rigid::Space& space, std::span<Carrier> carriers);
  void stir(const rigid::Space& space, Spot& spot, std::vector<events::Event>& events);
  void record(const rigid::Space& space, const Group& group, Spot& spot, std::vector<events::Event>& events);
  void end_or_keep(const rigid::Space& space, std::vector<Spot>& spots, std::vector<events::Event>& events);
  std::uint64_t make_id(const Spot& spot);
  std::uint64_t hash_name(int body) const;
  const Matter& get_matter(int body) const { return body < 0 ? matter_.back() : matter_[body]; }
  double calc_patch(const Group& group, double radius_m) const;
  double calc_impedance(int body, double patch_m) const;

  std::vector<Matter> matter_;
  std::map<std::pair<int, int>, std::uint64_t> touches_;    // how many lasting contacts each pair has had
  std::map<std::pair<int, int>, std::vector<Spot>> spots_;  // by their bodies
  // Of the step that has been made:
  std::vector<const rigid::Contact*> contacts_;
  std::vector<Carrier> carriers_;
  std::vector<Group> groups_;
};

}  // namespace carillon::physics
