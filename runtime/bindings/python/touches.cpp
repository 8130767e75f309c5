// Contact tracker for engines with Python bindings: arrays are read in place, without the GIL.
#include "runtime/drive/touches.hpp"

#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "runtime/base/chance.hpp"
#include "runtime/bindings/python/module.hpp"
#include "runtime/bindings/python/shared_bank.hpp"
#include "runtime/events/file.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::python {
namespace {

namespace py = pybind11;

template <class T>
using Array = py::array_t<T, py::array::c_style | py::array::forcecast>;
template <class T>
using OptionalArray = std::optional<Array<T>>;

/// Rows of `width` numbers; null for a missing array. Throws InputError for another shape.
template <class T>
const T* find_rows(const OptionalArray<T>& array, const char* name, py::ssize_t rows, py::ssize_t width) {
  if (!array) return nullptr;
  const bool is_list = width == 1 && array->ndim() == 1;
  if (!is_list && !(array->ndim() == 2 && array->shape(1) == width))
    throw InputError(width == 1 ? fmt::format("{}: give an array ({},)", name, rows)
                                : fmt::format("{}: give an array ({}, {})", name, rows, width));
  if (array->shape(0) != rows) throw InputError(fmt::format("{}: {} rows; give {}", name, array->shape(0), rows));
  return array->data();
}

Vec3 get_vector(const double* rows, py::ssize_t row, const Vec3& missing) {
  return rows == nullptr ? missing : Vec3{rows[3 * row], rows[3 * row + 1], rows[3 * row + 2]};
}

struct PoseArrays {
  Array<double> position, rotation;
  OptionalArray<double> velocity, spin;
  OptionalArray<bool> asleep, teleported, jointed;
};

struct PointArrays {
  OptionalArray<std::int32_t> pair;
  OptionalArray<double> point, normal, gap, impulse, friction, curvature;
};

/// A drive::Touches with the banks of its bodies. One call at a time.
class Tracker {
 public:
  Tracker(synth::Synthesiser* synthesiser, const drive::TouchesOptions& options)
      : touches_(options, [this, synthesiser](const events::Event& event) {
          if (synthesiser != nullptr) return synthesiser->push(event);
          events::append_line(lines_, event);
          return true;
        }) {}

  int add(const std::optional<SharedBank>& bank, drive::TouchesBody body, const std::string& name) {
    const std::lock_guard one_at_a_time(calls_);
    if (bank) body.bank = bank->played.get();
    body.name_hash = base::hash_name(name);
    const int index = touches_.add(body);
    if (bank) banks_.push_back(bank->played);
    return index;
  }

  void remove(int index) {
    const std::lock_guard one_at_a_time(calls_);
    touches_.remove(index);
  }

  void start(double time_s, const PoseArrays& poses) {
    const PosePointers rows = find_pointers(poses);
    const py::gil_scoped_release others_run;
    const std::lock_guard one_at_a_time(calls_);
    set_poses(rows);
    touches_.start(time_s, poses_);
  }

  bool step(double time_s, const PoseArrays& poses, const PointArrays& points) {
    const PosePointers rows = find_pointers(poses);
    const PointPointers point_rows = find_pointers(points);
    const py::gil_scoped_release others_run;
    const std::lock_guard one_at_a_time(calls_);
    set_poses(rows);
    set_points(point_rows);
    return touches_.step(time_s, poses_, points_);
  }

  std::string take_lines() {
    const std::lock_guard one_at_a_time(calls_);
    return std::exchange(lines_, {});
  }
  double get_mark_s() const { return touches_.get_mark_s(); }

  py::dict describe_counters() const {
    using py::literals::operator""_a;
    const drive::TouchesCounters& c = touches_.get_counters();
    return py::dict("steps"_a = c.steps, "points"_a = c.points, "bad_points"_a = c.bad_points, "dropped_points"_a = c.dropped_points,
                    "hits"_a = c.hits, "impacts"_a = c.impacts, "simplified"_a = c.simplified, "limited"_a = c.limited,
                    "masked"_a = c.masked, "weights"_a = c.weights, "settled"_a = c.settled, "cut"_a = c.cut, "touches"_a = c.touches,
                    "records"_a = c.records, "teleports"_a = c.teleports, "waiting"_a = c.waiting, "lost"_a = c.lost,
                    "longest_hit_s"_a = c.longest_hit_s);
  }

 private:
  struct PosePointers {
    py::ssize_t count = 0;
    const double *position, *rotation, *velocity, *spin;
    const bool *asleep, *teleported, *jointed;
  };
  struct PointPointers {
    py::ssize_t count = 0;
    const std::int32_t* pair;
    const double *point, *normal, *gap, *impulse, *friction, *curvature;
  };

  PosePointers find_pointers(const PoseArrays& given) const {
    const py::ssize_t count = touches_.count();
    return {.count = count,
            .position = find_rows<double>(given.position, "position", count, 3),
            .rotation = find_rows<double>(given.rotation, "rotation", count, 4),
            .velocity = find_rows(given.velocity, "velocity", count, 3),
            .spin = find_rows(given.spin, "spin", count, 3),
            .asleep = find_rows(given.asleep, "asleep", count, 1),
            .teleported = find_rows(given.teleported, "teleported", count, 1),
            .jointed = find_rows(given.jointed, "jointed", count, 1)};
  }

  static PointPointers find_pointers(const PointArrays& given) {
    if (!given.pair) return {};
    if (!given.point || !given.normal) throw InputError("points need pair, point and normal");
    const py::ssize_t count = given.pair->ndim() == 2 ? given.pair->shape(0) : 0;
    return {.count = count,
            .pair = find_rows(given.pair, "pair", count, 2),
            .point = find_rows(given.point, "point", count, 3),
            .normal = find_rows(given.normal, "normal", count, 3),
            .gap = find_rows(given.gap, "gap", count, 1),
            .impulse = find_rows(given.impulse, "impulse", count, 1),
            .friction = find_rows(given.friction, "friction", count, 3),
            .curvature = find_rows(given.curvature, "curvature", count, 1)};
  }

  void set_poses(const PosePointers& rows) {
    poses_.resize(rows.count);
    for (py::ssize_t i = 0; i < rows.count; ++i) {
      drive::TouchesPose& pose = poses_[i];
      pose.position_m = get_vector(rows.position, i, {});
      std::copy_n(rows.rotation + 4 * i, 4, pose.rotation.begin());
      pose.velocity_m_s = get_vector(rows.velocity, i, {});
      pose.spin_rad_s = get_vector(rows.spin, i, {});
      pose.asleep = rows.asleep != nullptr && rows.asleep[i];
      pose.teleported = rows.teleported != nullptr && rows.teleported[i];
      pose.jointed = rows.jointed != nullptr && rows.jointed[i];
    }
  }

  void set_points(const PointPointers& rows) {
    constexpr double kUnknown = drive::TouchPoint::kUnknown;
    points_.clear();
    for (py::ssize_t i = 0; i < rows.count; ++i)
      points_.push_back({.a = rows.pair[2 * i],
                         .b = rows.pair[2 * i + 1],
                         .point_m = get_vector(rows.point, i, {}),
                         .normal = get_vector(rows.normal, i, {}),
                         .gap_m = rows.gap != nullptr ? rows.gap[i] : 0.0,
                         .impulse_n_s = rows.impulse != nullptr ? rows.impulse[i] : kUnknown,
                         .friction_n_s = get_vector(rows.friction, i, {kUnknown, kUnknown, kUnknown}),
                         .curvature_per_m = rows.curvature != nullptr ? rows.curvature[i] : kUnknown});
  }

  std::string lines_;
  drive::Touches touches_;
  std::vector<std::shared_ptr<const bank::Bank>> banks_;
  std::vector<drive::TouchesPose> poses_;
  std::vector<drive::TouchPoint> points_;
  std::mutex calls_;
};

using py::literals::operator""_a;

std::unique_ptr<Tracker> make_tracker(const py::object& synthesiser, const Vec3& gravity, bool compliant, bool early, bool points_after,
                                      int max_points, int max_impacts, double slowest_m_s, double longest_hit_s, double ground_restitution,
                                      double ground_friction) {
  return std::make_unique<Tracker>(synthesiser.is_none() ? nullptr : &find_synthesiser(synthesiser),
                                   drive::TouchesOptions{.max_points = max_points,
                                                         .points_after = points_after,
                                                         .compliant = compliant,
                                                         .early = early,
                                                         .max_impacts = max_impacts,
                                                         .gravity_m_s2 = gravity,
                                                         .slowest_m_s = slowest_m_s,
                                                         .longest_hit_s = longest_hit_s,
                                                         .ground_restitution = ground_restitution,
                                                         .ground_friction = ground_friction});
}

int add_body(Tracker& tracker, const std::optional<SharedBank>& bank, int body, const std::string& name, bool fixed, double restitution,
             double friction, double mass_kg, const std::optional<std::array<double, 9>>& inertia_kg_m2, double young_pa, double poisson,
             double density_kg_m3, double size_m) {
  return tracker.add(bank,
                     {.body = body,
                      .fixed = fixed,
                      .mass_kg = mass_kg,
                      .inertia_kg_m2 = inertia_kg_m2.value_or(std::array<double, 9>{}),
                      .young_pa = young_pa,
                      .poisson = poisson,
                      .density_kg_m3 = density_kg_m3,
                      .size_m = size_m,
                      .restitution = restitution,
                      .friction = friction},
                     name);
}

void bind_steps(py::class_<Tracker>& tracker) {
  tracker
      .def(
          "start",
          [](Tracker& self, double time_s, Array<double> position, Array<double> rotation, OptionalArray<double> velocity,
             OptionalArray<double> spin) {
            self.start(time_s, {std::move(position), std::move(rotation), std::move(velocity), std::move(spin), {}, {}, {}});
          },
          "time_s"_a, "position"_a, "rotation"_a, "velocity"_a = py::none(), "spin"_a = py::none(),
          "Time and poses before the first step, or after a break. Arrays as in step().")
      .def(
          "step",
          [](Tracker& self, double time_s, Array<double> position, Array<double> rotation, Array<double> velocity, Array<double> spin,
             OptionalArray<std::int32_t> pair, OptionalArray<double> point, OptionalArray<double> normal, OptionalArray<double> gap,
             OptionalArray<double> impulse, OptionalArray<double> friction, OptionalArray<double> curvature, OptionalArray<bool> asleep,
             OptionalArray<bool> teleported, OptionalArray<bool> jointed) {
            return self.step(time_s,
                             {std::move(position), std::move(rotation), std::move(velocity), std::move(spin), std::move(asleep),
                              std::move(teleported), std::move(jointed)},
                             {std::move(pair), std::move(point), std::move(normal), std::move(gap), std::move(impulse), std::move(friction),
                              std::move(curvature)});
          },
          "time_s"_a, "position"_a, "rotation"_a, "velocity"_a, "spin"_a, "pair"_a = py::none(), "point"_a = py::none(),
          "normal"_a = py::none(), "gap"_a = py::none(), "impulse"_a = py::none(), "friction"_a = py::none(), "curvature"_a = py::none(),
          "asleep"_a = py::none(), "teleported"_a = py::none(), "jointed"_a = py::none(),
          "A step that ends at time_s. Of B bodies: position (B, 3) of the centre of mass [m], rotation (B, 4) of the mesh frame w x y z, "
          "velocity (B, 3) [m/s], spin (B, 3) [rad/s], asleep, teleported and jointed (B,) bool. Of P contact points: pair (P, 2) int32, "
          "b = -1 for the ground; point (P, 3) on b [m]; normal (P, 3) from b into a; gap (P,) [m]; impulse (P,) and friction (P, 3) on a, "
          "of the whole step [N s], None: found from the velocities; curvature (P,) of both surfaces [1/m], None: of the banks. World "
          "axes. "
          "Contiguous float64 arrays are read in place. False if events wait for room in the synthesiser.");
}

}  // namespace

void bind_touches(py::module_& module) {
  py::class_<Tracker> tracker(
      module, "Touches",
      "What a physics engine computes in a step, turned into hits, lasting contacts and motions of a synthesiser "
      "(docs/howto/my-engine.md). Without a synthesiser take_lines() returns the events as lines of a contacts file.");
  tracker
      .def(
          py::init(&make_tracker), py::keep_alive<1, 2>(), "synthesiser"_a = py::none(), "gravity"_a = Vec3{0.0, 0.0, -9.81}, py::kw_only(),
          "compliant"_a = false, "early"_a = false, "points_after"_a = false, "max_points"_a = 4096, "max_impacts"_a = 8,
          "slowest_m_s"_a = 0.0, "longest_hit_s"_a = 0.06, "ground_restitution"_a = 0.5, "ground_friction"_a = 0.5,
          "gravity [m/s2]. compliant: hits last many steps (MuJoCo). early: hits are reported when they begin. points_after: points are of "
          "the poses after the step. Others as in carillon_touches_options.")
      .def(
          "add", &add_body, "bank"_a = py::none(), "body"_a = -1, "name"_a = "", "fixed"_a = false, "restitution"_a = 0.5,
          "friction"_a = 0.4, "mass_kg"_a = 0.0, "inertia_kg_m2"_a = py::none(), "young_pa"_a = 0.0, "poisson"_a = 0.0,
          "density_kg_m3"_a = 0.0, "size_m"_a = 0.0,
          "Adds a body; returns its row in the arrays. body: its number in the synthesiser, -1: silent, but strikes others. The name seeds "
          "the sound of its contacts. Zeros: the values of the bank; without a bank mass, modulus, density and size are needed.")
      .def("remove", &Tracker::remove, "index"_a, "Removes a body; its row is ignored until another body takes it.")
      .def("take_lines", &Tracker::take_lines, "Events since the last call, one JSON line each; with a synthesiser none.")
      .def_property_readonly("mark_s", &Tracker::get_mark_s, "No earlier events follow [s].")
      .def_property_readonly("counters", &Tracker::describe_counters, "dict: numbers of steps, points, hits and what was left out.");
  bind_steps(tracker);
}

}  // namespace carillon::python
