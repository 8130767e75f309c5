// Lasting contacts: separated from impacts, tracked while they last, and recorded as stream events.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "runtime/drive/scene.hpp"
#include "runtime/events/events.hpp"

namespace carillon::drive {

/// A load-bearing point of two bodies.
struct Load {
  int a = 0, b = -1;             // -1: the ground
  int owner = 0;                 // of the surface that owns the point, and carries it along
  Vec3 where_m{}, normal{};      // normal: unit, from b to a
  double push_n = 0.0;           // normal force, > 0
  double curvature_per_m = 0.0;  // of both surfaces
  double slip_share = 1.0;       // share of the slip that is motion, not solver jitter
  bool smooth = false;           // the point moves over a curved surface
  bool rattles = false;          // the surfaces part again and again: their contact damps no modes
  std::uint64_t feature = 0;     // of the surfaces; constant while the same ones touch
  std::uint64_t spot = 0;        // identity of the position, if known; 0: by nearness
};

/// Contact positions of bodies, tracked from step to step. A contact has one id, from kBegin over any number of kHold to kEnd; its records
/// are in time order, and no two open contacts have the same id.
class LastingContacts {
 public:
  /// Call after a step with the loads of it, which are sorted in place; those of a pair must be adjacent. Appends events of the current
  /// contacts. `ends`: contacts without load may end, and contacts at rest are kept; not in the middle of a window.
  void update(const Scene& scene, std::span<Load> loads, bool ends, std::vector<events::Event>& events);
  /// Records an impact at a position: no lasting contact there for the next moments.
  void note_impact(const Scene& scene, int a, int b, const Vec3& where, double time_s);
  /// Ends the contacts of a body that is gone.
  void end(const Scene& scene, int body, std::vector<events::Event>& events);
  std::int64_t count_begun() const { return begun_; }

 private:
  /// Current touches at one position.
  struct Group {
    int a = 0, b = -1;
    Vec3 where{}, normal{}, turn{};
    Vec3 carried{};  // velocity of the surface that owns the loaded points
    double push_n = 0.0, curvature_per_m = 0.0, slip_share = 0.0;
    bool smooth = false, rattles = false;
    std::uint64_t features = 0;  // hash of the loaded features
    std::uint64_t spot = 0;
  };
  /// A contact position of two bodies, tracked while they touch.
  struct Spot {
    std::uint64_t id = 0;    // of the contact, from its first record on
    std::uint64_t spot = 0;  // of its loads
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

  void make_groups(const Scene& scene, std::span<Load> loads);
  Group make_group(const Scene& scene, std::span<const Load> loads, char* taken);
  Spot& find_spot(const Scene& scene, const Group& group);
  void stir(const Scene& scene, Spot& spot, std::vector<events::Event>& events);
  void record(const Scene& scene, const Group& group, Spot& spot, std::vector<events::Event>& events);
  void end_or_keep(const Scene& scene, std::vector<Spot>& spots, std::vector<events::Event>& events);
  static void end_records(const Spot& spot, double time_s, std::vector<events::Event>& events);
  std::uint64_t make_id(const Scene& scene, const Spot& spot);

  std::map<std::pair<int, int>, std::uint64_t> touches_;    // number of lasting contacts of each pair so far
  std::map<std::pair<int, int>, std::vector<Spot>> spots_;  // by bodies
  std::int64_t begun_ = 0;                                  // contacts
  // Of the completed step:
  std::vector<char> taken_;
  std::vector<Group> groups_;
};

}  // namespace carillon::drive
