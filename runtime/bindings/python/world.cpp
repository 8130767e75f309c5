// Method: physics and synthesiser of carillon-live (runtime/render/stage.hpp), advanced in turn by the caller instead of a sound card.
#include "runtime/physics/world.hpp"

#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/bindings/python/module.hpp"
#include "runtime/render/stage.hpp"
#include "runtime/render/surface_playback.hpp"
#include "runtime/scene/banks.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::python {
namespace {

namespace py = pybind11;

constexpr double kEndlessS = 1e6, kMaxAdvanceS = 3600.0;
constexpr double kPieceS = 0.005;  // s; shorter than any look-ahead

/// A scene that is simulated and played by calls. Calls exclude each other.
class Scenery {
 public:
  Scenery(const std::filesystem::path& file, const std::string& text, double look_ahead_s) {
    if (!(look_ahead_s >= 0.02 && look_ahead_s <= 10.0))
      throw InputError(fmt::format("look_ahead_s: give 0.02 to 10, and not {}", look_ahead_s));
    {
      const py::gil_scoped_release others_run;
      scene_ = text.empty() ? scene::read_scene(file) : scene::parse_scene(base::parse_document(text, file));
      render::refuse_surfaces(scene_, "carillon.World");
      banks_ = scene::read_banks(scene_);
      scene_.duration_s = kEndlessS;
      stage_.emplace(scene_, render::StageOptions{.look_ahead_s = look_ahead_s, .is_handled = true});
      stage_->begin();
    }
    for (const std::vector<std::string>& warnings : {scene_.warnings, stage_->get_warnings()})
      for (const std::string& warning : warnings)
        if (PyErr_WarnEx(PyExc_UserWarning, base::printable(warning).c_str(), 1) != 0) throw py::error_already_set();
  }

  py::array_t<float> advance(double seconds) {
    if (!(seconds >= 0.0 && seconds <= kMaxAdvanceS)) throw InputError(fmt::format("advance: {} s; give 0 to {}", seconds, kMaxAdvanceS));
    synth::Synthesiser& synthesiser = stage_->get_synthesiser();
    const auto frames = static_cast<py::ssize_t>(std::llround(seconds * scene_.sample_rate_hz));
    const int channels = synthesiser.get_microphone_count();
    py::array_t<float> samples({frames, static_cast<py::ssize_t>(channels)});
    float* const out = samples.mutable_data();
    const py::gil_scoped_release others_run;
    const std::lock_guard one_at_a_time(calls_);
    const auto piece = static_cast<py::ssize_t>(kPieceS * scene_.sample_rate_hz);
    std::vector<float> planes(channels * piece);
    std::vector<float*> rows;
    for (int c = 0; c < channels; ++c) rows.push_back(planes.data() + c * piece);
    for (py::ssize_t first = 0, pieces = 0; first < frames; first += piece) {
      const py::ssize_t count = std::min(piece, frames - first);
      while (stage_->step(synthesiser.get_time_s())) {
      }
      synthesiser.process(rows.data(), channels, static_cast<int>(count));
      for (py::ssize_t i = 0; i < count; ++i)
        for (int c = 0; c < channels; ++c) out[(first + i) * channels + c] = rows[c][i];
      if (++pieces % 64 != 0) continue;
      if (const py::gil_scoped_acquire lock; PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
    return samples;
  }

  void push(const std::string& name, const Vec3& impulse_n_s, const std::optional<Vec3>& at_m) {
    act(name, [&](physics::World& world, int body) { world.push(body, at_m.value_or(world.get_centre(body)), impulse_n_s); });
  }

  void grab(const std::string& name, const std::optional<Vec3>& at_m, double frequency_hz, double damping_ratio, double max_force_n) {
    act(name, [&](physics::World& world, int body) {
      world.grab(body, at_m.value_or(world.get_centre(body)),
                 {.frequency_hz = frequency_hz, .damping_ratio = damping_ratio, .max_force_n = max_force_n});
    });
  }

  void drag(const std::string& name, const Vec3& target_m, double over_s) {
    act(name, [&](physics::World& world, int body) { world.drag(body, target_m, over_s); });
  }

  void release(const std::string& name) {
    act(name, [](physics::World& world, int body) { world.release(body); });
  }

  void add(const std::string& name, const Vec3& position_m, const std::optional<events::Quaternion>& rotation, const Vec3& velocity_m_s,
           const Vec3& angular_velocity_rad_s) {
    act(name, [&](physics::World& world, int body) {
      physics::Entry entry{world.get_pose(body), velocity_m_s, angular_velocity_rad_s};
      entry.pose.position_m = position_m;
      if (rotation) entry.pose.rotation = *rotation;
      world.add(body, entry);
    });
  }

  std::string add_body(const std::string& text) {
    const py::gil_scoped_release others_run;
    const std::lock_guard one_at_a_time(calls_);
    return stage_->add_body(text, banks_);
  }

  void remove(const std::string& name) {
    act(name, [](physics::World& world, int body) { world.remove(body); });
  }

  py::tuple get_pose(const std::string& name) {
    physics::Pose pose;
    act(name, [&](physics::World& world, int body) { pose = world.get_pose(body); });
    return py::make_tuple(pose.position_m, pose.rotation);
  }

  Vec3 get_centre(const std::string& name) {
    Vec3 centre{};
    act(name, [&](physics::World& world, int body) { centre = world.get_centre(body); });
    return centre;
  }

  bool is_absent(const std::string& name) {
    bool is_absent = false;
    act(name, [&](physics::World& world, int body) { is_absent = world.is_absent(body); });
    return is_absent;
  }

  std::vector<std::string> list_bodies() {
    const py::gil_scoped_release others_run;
    const std::lock_guard one_at_a_time(calls_);
    return list_names();
  }
  double get_rate_hz() const { return scene_.sample_rate_hz; }
  double get_time_s() { return stage_->get_synthesiser().get_time_s(); }

 private:
  std::vector<std::string> list_names() const {
    std::vector<std::string> names;
    for (const scene::SceneBody& body : scene_.bodies) names.push_back(body.name);
    return names;
  }

  template <typename Act>
  void act(const std::string& name, Act&& act) {
    const py::gil_scoped_release others_run;  // a running advance() needs the GIL to end
    const std::lock_guard one_at_a_time(calls_);
    const int body = render::find_body(list_names(), name);
    physics::World* const world = stage_->get_world();
    if (world == nullptr) throw InputError("no body of the scene can move");
    act(*world, body);
  }

  scene::Scene scene_;
  scene::Banks banks_;
  std::optional<render::Stage> stage_;
  std::mutex calls_;
};

}  // namespace

void bind_world(py::module_& module) {
  using py::literals::operator""_a;
  py::class_<Scenery>(
      module, "World",
      "A scene that is simulated and played step by step, and whose bodies are pushed, held, added and removed meanwhile, as "
      "by carillon-live. Bodies are given by name; points are in the world [m]. Actions take effect look_ahead_s after the "
      "sound so far. Raises InputError, and changes nothing, for what cannot be done.")
      .def(py::init<const std::filesystem::path&, const std::string&, double>(), "file"_a, "text"_a = "", "look_ahead_s"_a = 0.05)
      .def("advance", &Scenery::advance, "seconds"_a,
           "The sound of the next seconds: (frames, channels) float32 [Pa]. The scene has no end here. Raises SolveError if the physics "
           "fails.")
      .def("push", &Scenery::push, "body"_a, "impulse_n_s"_a, "at_m"_a = py::none(),
           "Gives a body an impulse [N s] at a point, or at its centre of mass.")
      .def("grab", &Scenery::grab, "body"_a, "at_m"_a = py::none(), "frequency_hz"_a = 4.0, "damping_ratio"_a = 1.0, "max_force_n"_a = 0.0,
           "Holds a body at a point, or at its centre of mass, by a damped spring: its frequency with the body's mass [Hz], damping over "
           "the critical one, and largest force [N]; 0: 30 times the weight.")
      .def("drag", &Scenery::drag, "body"_a, "target_m"_a, "over_s"_a = 0.02,
           "Moves the held point evenly to a target [m] within a time [s].")
      .def("release", &Scenery::release, "body"_a, "Lets a body go; it keeps its velocity.")
      .def("add", &Scenery::add, "body"_a, "position_m"_a, "rotation"_a = py::none(), "velocity_m_s"_a = Vec3{},
           "angular_velocity_rad_s"_a = Vec3{},
           "Puts a body that is absent into the world: position of its mesh frame [m], unit quaternion w x y z (default: as it was).")
      .def("add_body", &Scenery::add_body, "text"_a,
           "Puts a new body into the world: JSON with the keys of a body in a scene file. Returns its name. The first body of a bank "
           "reads it.")
      .def("remove", &Scenery::remove, "body"_a, "Takes a body without joints and cords out of the world; it rings on.")
      .def("pose", &Scenery::get_pose, "body"_a, "(position [m], rotation w x y z) of the body's mesh frame, look_ahead_s after the sound.")
      .def("centre", &Scenery::get_centre, "body"_a, "Centre of mass [m], look_ahead_s after the sound.")
      .def("is_absent", &Scenery::is_absent, "body"_a, "True if the body is not in the world.")
      .def_property_readonly("bodies", &Scenery::list_bodies, "Names of the bodies.")
      .def_property_readonly("rate_hz", &Scenery::get_rate_hz)
      .def_property_readonly("time_s", &Scenery::get_time_s, "Time of the next frame [s].");
}

}  // namespace carillon::python
