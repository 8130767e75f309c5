// Lasting contacts: separated from impacts, tracked while they last, and recorded as stream events.
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

/// Properties of a body needed by the records.
struct Matter {
  std::string name;
  double young_modulus_pa = 0.0, poisson_ratio = 0.0, density_kg_m3 = 0.0;
};

/// Maximum distance of points of a pair in one spot [m]: a tenth of the smaller body's size.
double calc_spot_radius(const rigid::Space& space, int a, int b);

/// Position of a world point on a body's bank; `hint`: a likely triangle.
struct Spotted {
  std::int32_t triangle = 0;
  Vec3 barycentric{};
};
Spotted find_place(const rigid::Solid& solid, const rigid::State& state, const Vec3& where, const Vec3& outward, std::int32_t hint = -1);

/// Contact positions of bodies, tracked from step to step. A contact has one id, from kBegin over any number of kHold to kEnd; its records
/// are in time order, and no two open contacts have the same id.
class LastingContacts {
 public:
  /// One per body, and one for the ground at the end.
  explicit LastingContacts(std::vector<Matter> matter) : matter_(std::move(matter)) {}

  /// Call after a step; appends events of the current contacts.
  void update(const rigid::Space& space, std::vector<events::Event>& events);
  /// Records an impact at a position: no lasting contact there for the next moments.
  void note_impact(const rigid::Space& space, int a, int b, const Vec3& where, double time_s);

 private:
  /// Current touches at one position.
  struct Group {
    int a = 0, b = -1;
    Vec3 where{}, normal{}, turn{};
    Vec3 carried{};  // velocity of the surface that owns the loaded points
    double push_n = 0.0, curvature_per_m = 0.0;
    bool smooth = false;
    std::uint64_t features = 0;  // hash of the loaded features
  };
  /// A contact position of two bodies, tracked while they touch.
  struct Spot {
    std::uint64_t id = 0;  // of the contact, from its first record on
    int a = 0, b = -1;
    Vec3 where{};
    Vec3 drift{};                // smoothed velocity of the position over the loaded surface
    std::uint64_t features = 0;  // hash of the loaded features
    double quiet_s = 0.0;        // time of the first touch, or of the last impact since
    double seen_s = 0.0;         // time of the last touch
    double recorded_s = 0.0;
    double begun_s = -1.0;                       // time of its first record; negative: none yet
    double rises_s = 0.0, from_n = 0.0;          // start of the fade-in of the force: first record, or end of rest
    double load_n = 0.0;                         // smoothed
    bool lies = false;                           // both bodies are at rest
    double radius_m = 0.0;                       // of the Hertz contact of both surfaces
    std::array<events::LastingContact, 2> last;  // of both bodies
  };

  /// A load-bearing contact.
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
  std::map<std::pair<int, int>, std::uint64_t> touches_;    // number of lasting contacts of each pair so far
  std::map<std::pair<int, int>, std::vector<Spot>> spots_;  // by bodies
  // Of the completed step:
  std::vector<const rigid::Contact*> contacts_;
  std::vector<Carrier> carriers_;
  std::vector<Group> groups_;
};

}  // namespace carillon::physics
