// Method: as carillon-render, in this process: scene, banks, events, plan, sound. The GIL is released; signals (Ctrl-C) end it.
#include "runtime/render/render.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/bindings/python/module.hpp"
#include "runtime/render/surface_playback.hpp"
#include "runtime/scene/banks.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/planning.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::python {
namespace {

namespace py = pybind11;

constexpr int kMinRateHz = 8000, kMaxRateHz = 192000;

/// Called periodically without the GIL.
void look_for_signals(double) {
  const py::gil_scoped_acquire lock;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

/// Sound of a scene before conversion to an array.
struct Rendered {
  sound::SoundStore store;
  std::vector<std::string> warnings;
};

Rendered render(scene::Scene scene) {
  render::read_surfaces(scene);
  const scene::Banks banks = scene::read_banks(scene);
  std::vector<const bank::Bank*> body_banks;
  for (const scene::SceneBody& body : scene.bodies) body_banks.push_back(body.spec.bank);
  effects::SceneFacts facts = scene::make_facts(scene, scene::make_microphones(scene), scene::has_physics(scene));
  const bool has_contacts = effects::EffectSelector(facts).needs_contacts();
  const scene::SceneEvents happened = scene::simulate(scene, has_contacts, false, look_for_signals);
  const scene::Plan plan = scene::make_plan(std::move(facts), happened.events);
  Rendered rendered{sound::SoundStore(scene.sample_rate_hz, scene::count_channels(scene)), std::move(scene.warnings)};
  const render::Sound sound = render::calc_sound(
      scene, body_banks, happened.events,
      {.rate_hz = scene.sample_rate_hz, .plan = &plan, .fades_end = scene.output.fade_end, .progress = look_for_signals}, rendered.store);
  rendered.warnings.insert(rendered.warnings.end(), happened.warnings.begin(), happened.warnings.end());
  if (sound.refused > 0) rendered.warnings.push_back(std::to_string(sound.refused) + " events could not be played: too many at once");
  if (sound.faults > 0) rendered.warnings.push_back(std::to_string(sound.faults) + " events have numbers that cannot be played");
  for (std::size_t i = 0; i < scene.bodies.size(); ++i)
    if (std::string warning = render::describe_bending(scene.bodies[i].name, *body_banks[i], sound.body_deflection[i]); !warning.empty())
      rendered.warnings.push_back(std::move(warning));
  return rendered;
}

/// (frames, channels) [Pa].
py::array_t<float> to_array(const sound::SoundStore& store) {
  const auto channels = static_cast<py::ssize_t>(store.get_channels());
  py::array_t<float> samples({static_cast<py::ssize_t>(store.get_frames()), channels});
  store.read(0, std::span(samples.mutable_data(), static_cast<std::size_t>(samples.size())));
  return samples;
}

/// `text`: a scene; empty: contents of the file. The file anchors relative paths and appears in messages.
py::tuple render_scene(const std::filesystem::path& file, const std::string& text, std::optional<int> rate_hz) {
  if (rate_hz && (*rate_hz < kMinRateHz || *rate_hz > kMaxRateHz))
    throw InputError("rate_hz: give 8000 to 192000, and not " + std::to_string(*rate_hz));
  std::optional<Rendered> rendered;
  {
    const py::gil_scoped_release others_run;
    scene::Scene scene = text.empty() ? scene::read_scene(file) : scene::parse_scene(base::parse_document(text, file));
    if (rate_hz) scene.sample_rate_hz = *rate_hz;
    rendered.emplace(render(std::move(scene)));
  }
  for (const std::string& warning : rendered->warnings)
    if (PyErr_WarnEx(PyExc_UserWarning, base::printable(warning).c_str(), 1) != 0) throw py::error_already_set();
  return py::make_tuple(to_array(rendered->store), rendered->store.get_rate_hz());
}

}  // namespace

void bind_render(py::module_& module) {
  using py::literals::operator""_a;
  module.def("render", &render_scene, "file"_a, "text"_a = "", "rate_hz"_a = py::none(),
             "The sound of a scene: ((frames, channels) float32 [Pa], rate [Hz]).");
}

}  // namespace carillon::python
