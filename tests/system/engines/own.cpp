// Our own contact as an engine of others: its poses and impulses, in steps of whole windows (2 ms), through carillon_touches. As the motion
// is the same, differences of the sound are the tracker's.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/physics/make_space.hpp"
#include "tests/system/engines/engine.hpp"

namespace carillon::testing {
namespace {

void copy(const Vec3& from, double (&to)[3]) { std::copy(from.begin(), from.end(), to); }
Vec3 make_vector(const double (&x)[3]) { return {x[0], x[1], x[2]}; }

class Own : public Engine {
 public:
  Own(const std::vector<Solid>& solids, carillon_touches* touches)
      : touches_(touches), space_(physics::make_space(make_spec(solids), {}, maker_)), poses_(solids.size()) {}

  carillon_status start(char* message, std::size_t size) override {
    read_poses();
    return carillon_touches_start(touches_, 0.0, poses_.data(), count_bodies(), message, size);
  }
  /// Advances to the nearest end of a window; no points if that is the present time.
  carillon_status step(double time_s, char* message, std::size_t size) override {
    bool has_moved = false;
    for (; space_.get_time() + 0.5 * rigid::Space::kWindow < time_s || !space_.is_at_window(); has_moved = true) {
      space_.step(1e9);
      for (const rigid::Strike& strike : space_.take_strikes())
        for (const rigid::Hit& hit : strike.hits) add(hit.a, hit.b, hit.touch, hit.impulse);
      for (const rigid::Forces& forces : space_.take_forces()) add(forces);
      space_.list_contacts(contacts_);
      for (const rigid::Contact* c : contacts_)
        if (c->touching && c->step_s > 0.0 && std::abs(c->until_s - space_.get_time()) < 1e-8) add(c->a, c->b, c->touch, c->impulse);
    }
    if (!has_moved) return CARILLON_OK;
    read_poses();
    make_points();
    return carillon_touches_step(touches_, space_.get_time(), poses_.data(), count_bodies(), points_.data(),
                                 static_cast<std::int32_t>(points_.size()), message, size);
  }

 private:
  /// Impulse on a at one touch in a step; stations (mesh axes, of the ground world) times their share of it.
  struct Sum {
    Vec3 impulse{}, normal{};
    std::array<Vec3, 2> stations{};
    double push = 0.0;
  };

  physics::WorldSpec make_spec(const std::vector<Solid>& solids) {
    physics::WorldSpec spec;
    spec.ground.emplace();
    for (const Solid& s : solids) {
      if (!banks_.contains(s.bank))
        banks_.emplace(s.bank, bank::choose_frequencies(bank::read_bank(s.bank), bank::Frequencies::kCorrected));
      physics::BodySpec& body = spec.bodies.emplace_back();
      body.name = s.name;
      body.bank = of_bodies_.emplace_back(&banks_.at(s.bank));
      body.initial.position_m = make_vector(s.position_m);
      std::copy_n(s.rotation, 4, body.initial.rotation.begin());
      body.velocity_m_s = make_vector(s.velocity_m_s);
      body.angular_velocity_rad_s = make_vector(s.spin_rad_s);
    }
    return spec;
  }
  std::int32_t count_bodies() const { return static_cast<std::int32_t>(poses_.size()); }

  void read_poses() {
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      const int body = static_cast<int>(i);
      const rigid::State& state = space_.state(body);
      carillon_pose& pose = poses_[i] = carillon_pose();
      copy(state.centre, pose.position_m);
      copy(state.velocity, pose.velocity_m_s);
      copy(rigid::place(space_.solid(body), state).spin, pose.spin_rad_s);
      std::copy(state.rotation.begin(), state.rotation.end(), pose.rotation);
      if (space_.is_still(body)) pose.flags = CARILLON_ASLEEP;
    }
  }
  void add(int a, int b, const geometry::Touch& touch, const Vec3& impulse) {
    add(a, b, touch.id, impulse, touch.normal, {touch.station_a, touch.station_b});
  }
  void add(int a, int b, std::uint64_t id, const Vec3& impulse, const Vec3& normal, const std::array<Vec3, 2>& stations) {
    const double push = dot(impulse, normal);
    if (!(push > 0.0)) return;
    Sum& sum = sums_[{a, b, id}];
    sum.push += push;
    sum.impulse = sum.impulse + impulse;
    sum.normal = sum.normal + push * normal;
    for (const std::size_t side : {0, 1}) sum.stations[side] = sum.stations[side] + push * stations[side];
  }
  /// Of an impact with modes: along the surface of b, or of a on the ground.
  void add(const rigid::Forces& forces) {
    const Mat3 turn = rigid::make_rotation(space_.state(forces.a).rotation);
    Vec3 impulse{}, normal{0.0, 0.0, 1.0};
    for (const Vec3& part : forces.on_a) impulse = impulse + turn * part;
    std::array<Vec3, 2> stations{locate(forces.a, forces.place_a), Vec3{}};
    if (forces.b >= 0) {
      stations[1] = locate(forces.b, forces.place_b);
      normal = rigid::make_rotation(space_.state(forces.b).rotation) * find_outward(forces.b, forces.place_b.triangle);
    } else {
      stations[1] = place(forces.a, stations[0]);
      stations[1][2] = 0.0;
    }
    add(forces.a, forces.b, (std::uint64_t{1} << 63) + static_cast<std::uint64_t>(forces.place_a.triangle), impulse, normal, stations);
  }
  std::array<Vec3, 3> get_corners(int body, int triangle) const {
    const bank::Bank& bank = *of_bodies_[static_cast<std::size_t>(body)];
    std::array<Vec3, 3> corners;
    for (std::size_t k = 0; k < 3; ++k)
      corners[k] = bank.vertices_m[static_cast<std::size_t>(bank.triangles[static_cast<std::size_t>(triangle)][k])];
    return corners;
  }
  Vec3 locate(int body, const geometry::Place& at) const {
    const std::array<Vec3, 3> x = get_corners(body, at.triangle);
    return at.barycentric[0] * x[0] + at.barycentric[1] * x[1] + at.barycentric[2] * x[2];
  }
  Vec3 find_outward(int body, int triangle) const {
    const std::array<Vec3, 3> x = get_corners(body, triangle);
    return calc_unit(cross(x[1] - x[0], x[2] - x[0]));
  }
  Vec3 place(int body, const Vec3& station) const {
    if (body < 0) return station;
    const rigid::State& state = space_.state(body);
    return state.centre + rigid::make_rotation(state.rotation) * (station - space_.solid(body).centre_m);
  }
  void make_points() {
    points_.clear();
    for (const auto& [key, sum] : sums_) {
      carillon_point point = carillon_point();
      std::tie(point.a, point.b, std::ignore) = key;
      const Vec3 normal = calc_unit(sum.normal);
      const Vec3 on_a = place(point.a, (1.0 / sum.push) * sum.stations[0]), on_b = place(point.b, (1.0 / sum.push) * sum.stations[1]);
      point.gap_m = dot(on_a - on_b, normal);
      copy(on_a - point.gap_m * normal, point.point_m);
      copy(normal, point.normal);
      point.impulse_n_s = dot(sum.impulse, normal);
      copy(sum.impulse - point.impulse_n_s * normal, point.friction_n_s);
      point.curvature_per_m = NAN;
      points_.push_back(point);
    }
    sums_.clear();
  }

  carillon_touches* touches_;
  std::map<std::string, bank::Bank> banks_;
  physics::SolidMaker maker_{true};
  std::vector<const bank::Bank*> of_bodies_;
  rigid::Space space_;
  std::vector<const rigid::Contact*> contacts_;
  std::map<std::tuple<std::int32_t, std::int32_t, std::uint64_t>, Sum> sums_;
  std::vector<carillon_pose> poses_;
  std::vector<carillon_point> points_;
};

}  // namespace

void set_options(carillon_touches_options& options) { options.points_after = 1; }
std::unique_ptr<Engine> make_engine(const std::vector<Solid>& solids, double, carillon_touches* touches) {
  return std::make_unique<Own>(solids, touches);
}

}  // namespace carillon::testing
