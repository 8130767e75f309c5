// Method: synth::Synthesiser with both of its threads in one caller: events and blocks alternate.
#include "runtime/synth/synthesiser.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/mounting/losses.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/bindings/python/module.hpp"
#include "runtime/bindings/python/shared_bank.hpp"
#include "runtime/events/events.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/sensor.hpp"

namespace carillon::python {
namespace {

namespace py = pybind11;

constexpr py::ssize_t kMaxFrames = 1 << 30, kPiece = 4096;

synth::EffectSet to_effects(const std::vector<std::string>& names) {
  synth::EffectSet effects;
  for (const std::string& name : names) {
    const std::optional<synth::Effect> effect = synth::find_effect(name);
    if (!effect) throw InputError(fmt::format("there is no effect \"{}\"; docs/howto/scene-files.md lists them", name));
    effects = effects.with(*effect);
  }
  return effects;
}

/// A bank with the support losses that it specifies, as in carillon-render.
std::shared_ptr<const synth::Model> make_model(const bank::Bank& bank, const std::string& kind_name, double rate_hz) {
  const radiation::GainKind kind = radiation::choose_gain_kind(bank, radiation::require_gain_kind("radiation", kind_name));
  const py::gil_scoped_release others_run;
  std::optional<bank::Bank> mounted;
  if (const mounting::Losses losses = mounting::calc_losses(bank, {}); !losses.is_empty()) mounting::apply(losses, mounted.emplace(bank));
  const bank::Bank& played = mounted ? *mounted : bank;
  radiation::Radiation radiation = radiation::calc_radiation(played, kind);
  if (kind == radiation::GainKind::kSphere) radiation::limit_gains(radiation.gains, played.decay_per_s);
  return synth::Model::make(played, {.rate_hz = rate_hz, .gains = radiation.gains, .sphere_radius_m = radiation.sphere_radius_m});
}

/// A synthesiser and the surfaces of its bodies. Calls of process() exclude each other; all others hold the GIL.
class Instrument {
 public:
  Instrument(double rate_hz, std::vector<Vec3> microphones_m, const Vec3& listener_m, int max_bodies,
             const std::optional<double>& head_radius_m, const std::optional<double>& floor_reflection, double floor_height_m)
      : rate_hz_(rate_hz), has_head_(head_radius_m.has_value()), has_floor_(floor_reflection.has_value()) {
    synth::SynthesiserOptions options{
        .rate_hz = rate_hz, .microphones_m = std::move(microphones_m), .listener_m = listener_m, .max_bodies = max_bodies};
    if (head_radius_m)
      options.head = synth::make_level_head(head::make_sphere(rate_hz, {.radius_m = *head_radius_m}), options.microphones_m);
    if (floor_reflection) options.floor = synth::Floor{.point_m = {0.0, 0.0, floor_height_m}, .reflection = *floor_reflection};
    synthesiser_ = std::make_unique<synth::Synthesiser>(std::move(options));
  }

  int add_body(const SharedBank& bank, const Vec3& position_m, const events::Quaternion& rotation, const std::string& radiation,
               const std::optional<std::vector<std::string>>& effects) {
    synth::BodySettings settings{.position_m = position_m, .rotation = rotation};
    if (has_head_) settings.effects = settings.effects.with(synth::Effect::kHead);
    if (has_floor_) settings.effects = settings.effects.with(synth::Effect::kGroundReflection);
    if (effects) settings.effects = to_effects(*effects);
    const int body = get().add_body(make_model(*bank.played, radiation, rate_hz_), settings);
    banks_[body] = bank;
    return body;
  }

  void swap_bank(int body, const SharedBank& bank, const std::string& radiation) {
    require(body);
    get().swap_model(body, make_model(*bank.played, radiation, rate_hz_));
    banks_[body] = bank;
  }

  void remove_body(int body) {
    require(body);
    get().remove_body(body);
    banks_.erase(body);
  }

  void strike(int body, const Vec3& impulse_n_s, const std::optional<Vec3>& point_m, const std::optional<std::int32_t>& triangle,
              double duration_s, const std::optional<double>& time_s) {
    SharedBank& bank = require(body);
    if (point_m.has_value() == triangle.has_value()) throw InputError("strike: give point_m or triangle");
    events::Impulse impulse{.body = body, .impulse_n_s = impulse_n_s, .duration_s = duration_s};
    impulse.time_s = time_s.value_or(get().get_horizon_s() + 0.5 * duration_s);
    if (triangle) {
      if (*triangle < 0 || *triangle >= std::ssize(bank.played->triangles))
        throw InputError(fmt::format("strike: there is no triangle {}; there are {}", *triangle, bank.played->triangles.size()));
      impulse.triangle = *triangle;
      impulse.barycentric = {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0};
    } else {
      const bank::NearestPlace place = bank.get_tree().find(*point_m);
      if (place.triangle < 0) throw InputError("strike: point_m is not finite or too far away");
      impulse.triangle = place.triangle;
      impulse.barycentric = place.barycentric;
    }
    push(impulse);
  }

  void move(int body, const Vec3& position_m, const Vec3& velocity_m_s, const events::Quaternion& rotation,
            const std::optional<double>& time_s) {
    require(body);
    push(events::BodyMotion{.time_s = time_s.value_or(get().get_horizon_s()),
                            .body = body,
                            .position_m = position_m,
                            .velocity_m_s = velocity_m_s,
                            .rotation = rotation});
  }

  py::array_t<float> process(py::ssize_t frames) {
    if (frames < 0 || frames > kMaxFrames) throw InputError(fmt::format("process: {} frames; give 0 to {}", frames, kMaxFrames));
    synth::Synthesiser& synthesiser = get();
    synthesiser.collect();
    const int channels = synthesiser.get_microphone_count();
    py::array_t<float> samples({frames, static_cast<py::ssize_t>(channels)});
    float* const out = samples.mutable_data();
    const py::gil_scoped_release others_run;
    const std::lock_guard one_at_a_time(playing_);
    std::vector<float> planes(channels * kPiece);
    std::vector<float*> rows;
    for (int c = 0; c < channels; ++c) rows.push_back(planes.data() + c * kPiece);
    for (py::ssize_t first = 0; first < frames; first += kPiece) {
      const py::ssize_t count = std::min(kPiece, frames - first);
      synthesiser.process(rows.data(), channels, static_cast<int>(count));
      for (py::ssize_t i = 0; i < count; ++i)
        for (int c = 0; c < channels; ++c) out[(first + i) * channels + c] = rows[c][i];
      if (const py::gil_scoped_acquire lock; PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
    return samples;
  }

  int add_sensor(int body, const Vec3& direction, const std::optional<Vec3>& point_m, const std::optional<std::int32_t>& triangle,
                 const std::string& quantity, const std::optional<double>& rate_hz, bool held, double buffer_s) {
    SharedBank& bank = require(body);
    if (point_m.has_value() == triangle.has_value()) throw InputError("add_sensor: give point_m or triangle");
    const auto name = std::find(synth::kQuantityNames.begin(), synth::kQuantityNames.end(), quantity);
    if (name == synth::kQuantityNames.end())
      throw InputError(fmt::format("add_sensor: quantity \"{}\" is none of {}", quantity, fmt::join(synth::kQuantityNames, ", ")));
    synth::SensorSettings settings{.triangle = triangle.value_or(0),
                                   .direction = direction,
                                   .quantity = static_cast<synth::Quantity>(name - synth::kQuantityNames.begin()),
                                   .rate_hz = rate_hz.value_or(0.0),
                                   .is_held = held,
                                   .buffer_s = buffer_s};
    if (point_m) {
      const bank::NearestPlace place = bank.get_tree().find(*point_m);
      if (place.triangle < 0) throw InputError("add_sensor: point_m is not finite or too far away");
      const auto [low, high] = bank::find_extent(bank.played->vertices_m);
      if (!(place.distance_m <= bank::kFarthestShare * calc_length(high - low)))
        throw InputError(fmt::format("add_sensor: point_m is {:.4g} m away from the body; its nearest point is [{:.6g}, {:.6g}, {:.6g}]",
                                     place.distance_m, place.point_m[0], place.point_m[1], place.point_m[2]));
      settings.triangle = place.triangle;
      settings.barycentric = place.barycentric;
    }
    return get().add_sensor(body, *bank.played, settings);
  }

  synth::Sensor& find_sensor(int sensor) {
    if (synth::Sensor* found = get().find_sensor(sensor)) return *found;
    throw InputError(fmt::format("there is no sensor {}; add_sensor() returns their numbers", sensor));
  }

  py::array_t<double> read_sensor(int sensor) {
    synth::Sensor& from = find_sensor(sensor);
    std::vector<double> samples(from.count_ready());
    from.read(samples);
    return py::array_t<double>(static_cast<py::ssize_t>(samples.size()), samples.data());
  }

  synth::Synthesiser& get() { return *synthesiser_; }
  double get_rate_hz() const { return rate_hz_; }
  int get_channels() const { return synthesiser_->get_microphone_count(); }
  double get_time_s() const { return synthesiser_->get_time_s(); }
  py::dict describe_counters() const {
    using py::literals::operator""_a;
    const synth::SynthesiserCounters c = synthesiser_->get_counters();
    return py::dict("strikes"_a = c.strikes, "refused"_a = c.refused, "late"_a = c.late, "faults"_a = c.faults, "overflows"_a = c.overflows,
                    "resets"_a = c.resets, "mode_samples"_a = c.mode_samples, "faded"_a = c.faded);
  }

 private:
  SharedBank& require(int body) {
    const auto found = banks_.find(body);
    if (found == banks_.end()) throw InputError(fmt::format("there is no body {}; add_body() returns the numbers of bodies", body));
    return found->second;
  }

  void push(const events::Event& event) {
    if (const char* fault = events::find_fault(event)) throw InputError(fmt::format("this cannot be played: {}", fault));
    if (!get().push(event)) throw InputError("too many events are queued; call process() between them");
  }

  double rate_hz_;
  bool has_head_, has_floor_;
  std::unique_ptr<synth::Synthesiser> synthesiser_;
  std::map<int, SharedBank> banks_;  // by body number
  std::mutex playing_;
};

}  // namespace

synth::Synthesiser& find_synthesiser(const py::object& object) {
  if (!py::isinstance<Instrument>(object)) throw py::type_error("synthesiser: give a carillon.Synthesiser");
  return object.cast<Instrument&>().get();
}

void bind_synthesiser(py::module_& module) {
  using py::literals::operator""_a;
  py::class_<Instrument>(module, "Synthesiser",
                         "The synthesiser of carillon-render and carillon-live, block by block: bodies that are struck, and microphones. "
                         "Times are seconds since the first frame; a strike or move without a time_s takes effect as soon as "
                         "possible. Points and impulses are in the frame of the body's mesh.")
      .def(py::init<double, std::vector<Vec3>, const Vec3&, int, const std::optional<double>&, const std::optional<double>&, double>(),
           "rate_hz"_a = 48000.0, "microphones_m"_a = std::vector<Vec3>{{-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}}, "listener_m"_a = Vec3{},
           "max_bodies"_a = 64, "head_radius_m"_a = py::none(), "floor_reflection"_a = py::none(), "floor_height_m"_a = 0.0,
           "microphones_m: positions relative to the listener [m], one channel each (1 or more); default two ears 20 cm apart. "
           "head_radius_m: a head between two microphones, left and right, a rigid sphere (0.0875 is average), upright; bodies then have "
           "the effect \"head\" by default. floor_reflection: share of the pressure, 0..1, that a rigid floor z = floor_height_m throws "
           "back; "
           "bodies then have \"ground_reflection\" by default.")
      .def("add_body", &Instrument::add_body, "bank"_a, "position_m"_a = Vec3{0.0, 1.0, 0.0},
           "rotation"_a = events::Quaternion{1.0, 0.0, 0.0, 0.0}, "radiation"_a = "auto", "effects"_a = py::none(),
           "Adds a body with its centre of mass at a position [m], rotated by a unit quaternion w x y z; returns its number. radiation and "
           "effects are those of scene files.")
      .def("swap_bank", &Instrument::swap_bank, "body"_a, "bank"_a, "radiation"_a = "auto",
           "Replaces the bank of a body by one of the same shape, usually an edited one; the body keeps ringing.")
      .def("remove_body", &Instrument::remove_body, "body"_a, "Removes a body; it falls silent.")
      .def("strike", &Instrument::strike, "body"_a, "impulse_n_s"_a, py::kw_only(), "point_m"_a = py::none(), "triangle"_a = py::none(),
           "duration_s"_a = 1e-3, "time_s"_a = py::none(),
           "A blow [N s] with a pulse of this length about time_s, at the point of the surface nearest to a point [m], or in the middle of "
           "a "
           "triangle.")
      .def("move", &Instrument::move, "body"_a, "position_m"_a, "velocity_m_s"_a = Vec3{}, "rotation"_a = events::Quaternion{1.0, 0, 0, 0},
           "time_s"_a = py::none(), "Sets position, velocity and rotation of a body from time_s on [m, m/s].")
      .def("add_sensor", &Instrument::add_sensor, "body"_a, "direction"_a, py::kw_only(), "point_m"_a = py::none(),
           "triangle"_a = py::none(), "quantity"_a = "acceleration", "rate_hz"_a = py::none(), "held"_a = false, "buffer_s"_a = 60.0,
           "A sensor at the point of the surface nearest to a point [m], or in the middle of a triangle, along a direction in the frame of "
           "the mesh; strain: axis of the gauge. quantity: \"acceleration\" [m/s2], \"velocity\" [m/s], \"displacement\" [m] or "
           "\"strain\". rate_hz: of its samples, by default that of the sound. held: the body does not move as a rigid body. buffer_s: "
           "samples that wait for read_sensor(). Returns its number. A sensor ends with its body: read the rest before the next "
           "add_sensor(), which may take its number.")
      .def("read_sensor", &Instrument::read_sensor, "sensor"_a,
           "The readings since the last call: (n) float64, SI units. Sample n of a sensor is the reading at sensor_begin_s() + n / "
           "rate_hz, without delay.")
      .def(
          "sensor_begin_s", [](Instrument& self, int sensor) { return self.find_sensor(sensor).get_begin_s(); }, "sensor"_a,
          "Time of the first sample of a sensor [s].")
      .def(
          "sensor_lost", [](Instrument& self, int sensor) { return self.find_sensor(sensor).get_lost(); }, "sensor"_a,
          "Samples lost because the buffer of a sensor was full.")
      .def("process", &Instrument::process, "frames"_a, "The next frames: (frames, channels) float32 [Pa].")
      .def_property_readonly("rate_hz", &Instrument::get_rate_hz)
      .def_property_readonly("channels", &Instrument::get_channels)
      .def_property_readonly("time_s", &Instrument::get_time_s, "Time of the next frame [s].")
      .def_property_readonly("counters", &Instrument::describe_counters,
                             "dict: numbers of strikes, refused and late events, faults and others.");
}

}  // namespace carillon::python
