// Method: numpy arrays are read-only views of the bank's memory (no copies).
#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "runtime/bank/corrected.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/mounting/heard.hpp"
#include "runtime/bank/of_material.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/bindings/python/module.hpp"
#include "runtime/bindings/python/shared_bank.hpp"
#include "runtime/material/table.hpp"

namespace carillon::python {
namespace {

namespace py = pybind11;

using Shape = std::vector<py::ssize_t>;

/// Read-only view of numbers kept alive by `owner`.
template <typename T>
py::array view(const T* numbers, const Shape& shape, const py::handle& owner) {
  py::array array(py::dtype::of<T>(), shape, numbers, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

py::array view(const std::vector<double>& numbers, const py::handle& owner) {
  return view(numbers.data(), {static_cast<py::ssize_t>(numbers.size())}, owner);
}

template <typename T, std::size_t N>
py::array view(const std::vector<std::array<T, N>>& rows, const py::handle& owner) {
  return view(rows.empty() ? nullptr : rows.front().data(), {static_cast<py::ssize_t>(rows.size()), static_cast<py::ssize_t>(N)}, owner);
}

/// One number per mode.
template <class Find>
py::array_t<double> make_per_mode(const bank::Bank& bank, Find&& find) {
  py::array_t<double> array(static_cast<py::ssize_t>(bank.mode_count()));
  auto numbers = array.mutable_unchecked<1>();
  for (std::size_t m = 0; m < bank.mode_count(); ++m) numbers(static_cast<py::ssize_t>(m)) = find(m);
  return array;
}

/// Error bar per mode; infinite if unknown.
py::array_t<double> make_bars(const bank::Bank& bank, const std::vector<double>& bars) {
  return make_per_mode(bank, [&](std::size_t m) { return m < bars.size() ? bars[m] : std::numeric_limits<double>::infinity(); });
}

py::object parse_json(const std::string& text) {
  if (text.empty()) return py::dict();
  return py::module_::import("json").attr("loads")(
      py::reinterpret_steal<py::str>(PyUnicode_DecodeUTF8(text.data(), static_cast<py::ssize_t>(text.size()), "backslashreplace")));
}

bank::Frequencies to_frequencies(const std::string& name) {
  if (name == "corrected") return bank::Frequencies::kCorrected;
  if (name == "mesh") return bank::Frequencies::kMesh;
  throw InputError(fmt::format("frequencies \"{}\": give \"corrected\" or \"mesh\"", name));
}

SharedBank make_shared(bank::Bank bank, bank::Frequencies frequencies, std::string name) {
  SharedBank shared{.stored = std::make_shared<bank::Bank>(std::move(bank)), .played = {}, .name = std::move(name)};
  shared.is_corrected = frequencies == bank::Frequencies::kCorrected;
  const bool is_other = (shared.is_corrected && !shared.stored->corrected.is_empty()) || !shared.stored->multipoles.is_empty();
  shared.played = is_other ? std::make_shared<bank::Bank>(bank::choose_frequencies(*shared.stored, frequencies)) : shared.stored;
  return shared;
}

SharedBank open(const std::filesystem::path& file, const std::string& frequencies) {
  const bank::Frequencies chosen = to_frequencies(frequencies);
  const py::gil_scoped_release others_run;
  return make_shared(bank::read_bank(file), chosen, file.string());
}

SharedBank parse(const py::bytes& bytes, const std::string& frequencies) {
  const bank::Frequencies chosen = to_frequencies(frequencies);
  const std::string_view text = bytes;
  const py::gil_scoped_release others_run;
  return make_shared(bank::parse_bank(std::as_bytes(std::span(text))), chosen, "bank in memory");
}

SharedBank edit(const SharedBank& of, const std::optional<std::string>& material, double density, double stiffness, double size) {
  bank::Edits edits;
  if (material) {
    if (density != 1.0 || stiffness != 1.0)
      throw InputError("a material has a density and a stiffness of its own; leave density and stiffness out");
    edits = bank::make_edits(*of.stored, material::MaterialTable::get().require("material", *material).material);
  } else {
    edits.density_scale = density;
    edits.stiffness_scale = stiffness;
  }
  edits.size_scale = size;
  const py::gil_scoped_release others_run;
  return make_shared(bank::calc_edited(*of.stored, edits), of.is_corrected ? bank::Frequencies::kCorrected : bank::Frequencies::kMesh,
                     of.name);
}

/// (V, 3) for one mode, (V, k, 3) for several [kg^-1/2]; any numpy index of modes.
py::object calc_shapes(const py::object& self, const py::object& modes) {
  const py::object steps = self.attr("shape_steps"), scale = self.attr("shape_scale");
  const py::object wanted = modes.is_none() ? py::slice(std::nullopt, std::nullopt, std::nullopt) : modes;
  const py::object some = steps[py::make_tuple(py::slice(std::nullopt, std::nullopt, std::nullopt), wanted)];
  const py::object factors = scale[wanted];
  const bool is_one = py::cast<int>(some.attr("ndim")) == 2;
  return some * (is_one ? factors : factors[py::make_tuple(py::ellipsis(), py::none())]);
}

py::tuple find_nearest(SharedBank& bank, const Vec3& point_m) {
  const bank::NearestPlace place = bank.get_tree().find(point_m);
  if (place.triangle < 0) throw InputError("point_m is not finite or too far away");
  return py::make_tuple(place.triangle, py::array(3, place.barycentric.data()), py::array(3, place.point_m.data()), place.distance_m);
}

std::string describe(const SharedBank& shared) {
  const bank::Bank& bank = *shared.played;
  const std::string range =
      bank.mode_count() == 0 ? "" : fmt::format(" from {:.1f} to {:.1f} Hz", bank.freq_hz(0), bank.freq_hz(bank.mode_count() - 1));
  return fmt::format("<carillon.Bank {}: {} modes{}, {} vertices>", base::quote(base::printable(shared.name)), bank.mode_count(), range,
                     bank.vertex_count());
}

py::dict describe_material(const bank::Bank& bank) {
  using py::literals::operator""_a;
  const bank::Material& m = bank.material;
  return py::dict("young_modulus_pa"_a = m.young_modulus_pa, "poisson_ratio"_a = m.poisson_ratio, "density_kg_m3"_a = m.density_kg_m3,
                  "alpha1_s"_a = m.alpha1_s, "alpha2_per_s"_a = m.alpha2_per_s, "damping"_a = bank.damping.law,
                  "coefficient"_a = bank.damping.coefficient, "power"_a = bank.damping.power, "freq_hz"_a = bank.damping.freq_hz,
                  "loss_factor"_a = bank.damping.loss_factor);
}

py::dict list_materials() {
  using py::literals::operator""_a;
  py::dict all;
  for (const material::Row& row : material::MaterialTable::get().rows()) {
    const material::Material& m = row.material;
    const py::str name = base::printable(m.name);
    if (all.contains(name)) continue;  // user tables take precedence
    all[name] =
        py::dict("group"_a = base::printable(row.group), "young_modulus_pa"_a = m.young_modulus_pa, "poisson_ratio"_a = m.poisson_ratio,
                 "density_kg_m3"_a = m.density_kg_m3, "is_orthotropic"_a = m.orthotropic.has_value(), "damping"_a = m.describe_damping(),
                 "elasticity_source"_a = base::printable(row.elasticity_source), "loss_source"_a = base::printable(row.loss_source));
  }
  return all;
}

/// The key "bank" of a job as an absolute path; empty if absent. `text`: the job; empty: contents of the file.
std::optional<std::filesystem::path> find_bank(const std::filesystem::path& file, const std::string& text) {
  const base::Document document = text.empty() ? base::read_document(file) : base::parse_document(text, file);
  base::Object job = document.root();
  return job.has("bank") ? std::optional(job.path("bank")) : std::nullopt;
}

using Class = py::class_<SharedBank>;

void bind_arrays(Class& type) {
  const auto array = [&](const char* name, auto&& find, const char* text) {
    type.def_property_readonly(
        name, [find](const py::object& self) { return find(*py::cast<const SharedBank&>(self).played, self); }, text);
  };
  array(
      "vertices_m", [](const bank::Bank& b, const py::object& self) { return view(b.vertices_m, self); }, "(V, 3) float64 [m].");
  array(
      "triangles", [](const bank::Bank& b, const py::object& self) { return view(b.triangles, self); },
      "(T, 3) int32: corners, counter-clockwise from outside.");
  array(
      "frequency_hz", [](const bank::Bank& b, const py::object&) { return make_per_mode(b, [&](std::size_t m) { return b.freq_hz(m); }); },
      "(m) float64 [Hz], ascending: undamped.");
  array(
      "decay_per_s", [](const bank::Bank& b, const py::object& self) { return view(b.decay_per_s, self); },
      "(m) float64 [1/s]: amplitudes fall as exp(-d t), by material and radiation.");
  array(
      "t60_s",
      [](const bank::Bank& b, const py::object&) {
        const std::vector<bank::HeardMode> heard = mounting::calc_heard_as_played(b);
        return make_per_mode(b, [&](std::size_t m) { return heard[m].calc_t60_s(); });
      },
      "(m) float64 [s]: time to decay by 60 dB, as in carillon-bank info: including support losses, unlike decay_per_s.");
  array(
      "radiation_gain", [](const bank::Bank& b, const py::object& self) { return view(b.radiation_gain, self); },
      "(m) float64: pressure [Pa] at 1 m for unit modal velocity (1 m kg^1/2 / s), by O'Brien, Shen and Gatchalian 2002.");
  array(
      "residual", [](const bank::Bank& b, const py::object& self) { return view(b.residual, self); },
      "(m) float64: ||K phi - lambda M phi|| / (lambda ||M phi||).");
  array(
      "error_cents", [](const bank::Bank& b, const py::object&) { return make_bars(b, b.discretisation_error_cents); },
      "(m) float64 [cent]: estimated distance of frequency_hz from that of the body; infinite where it is unknown.");
  array(
      "facet_error_cents",
      [](const bank::Bank& b, const py::object&) {
        return make_per_mode(b, [&](std::size_t m) { return b.facet_error_cents.empty() ? 0.0 : b.facet_error_cents[m]; });
      },
      "(m) float64 [cent]: additional error_cents if ambiguous facets (true planes, or samples of a smooth "
      "surface) are of the other kind; 0 if there are none.");
  array(
      "algebraic_error_cents", [](const bank::Bank& b, const py::object&) { return make_bars(b, b.algebraic_error_cents); },
      "(m) float64 [cent]: bound on the distance of the solver from the modes of the mesh; infinite where it is unknown.");
  array(
      "shape_steps",
      [](const bank::Bank& b, const py::object& self) {
        return view(b.shape.data(), {static_cast<py::ssize_t>(b.vertex_count()), static_cast<py::ssize_t>(b.mode_count()), 3}, self);
      },
      "(V, m, 3) int16: shapes in steps of shape_scale.");
  array(
      "shape_scale", [](const bank::Bank& b, const py::object& self) { return view(b.shape_scale, self); },
      "(m) float64 [kg^-1/2]: one step of shape_steps.");
}

void bind_operations(Class& type) {
  using py::literals::operator""_a;
  type.def(
      py::init(&open), "file"_a, "frequencies"_a = "corrected",
      "Reads a bank. frequencies: \"corrected\" has the estimated error of the mesh removed, where the bank has it; \"mesh\" takes those "
      "of the mesh. Raises InputError for an invalid or incomplete bank.");
  type.def_static("parse", &parse, "data"_a, "frequencies"_a = "corrected", "The same from the bytes of a file.");
  type.def("shapes", &calc_shapes, "modes"_a = py::none(),
           "Shapes on the surface, mass-normalised [kg^-1/2], float64: (V, 3) of one mode, (V, k, 3) of a slice or list; default: all. "
           "A blow J [N s] at vertex v starts mode k with the velocity shapes(k)[v] @ J.");
  type.def("nearest", &find_nearest, "point_m"_a,
           "The point of the surface nearest to a point: (triangle, barycentric (3), point_m (3), distance_m).");
  type.def("edited", &edit, py::kw_only(), "material"_a = py::none(), "density"_a = 1.0, "stiffness"_a = 1.0, "size"_a = 1.0,
           "The bank of the same body in another material (a name), or with density, stiffness and size multiplied, without a solve. "
           "Poisson's ratio stays.");
  type.def(
      "write",
      [](const SharedBank& bank, const std::filesystem::path& file) {
        bank::write_bank(*bank.stored, file);
      },  // HDF5: one thread at a time
      "file"_a, "Writes the bank as it was read or edited, complete or not at all.");
  type.def("__len__", [](const SharedBank& bank) { return bank.played->mode_count(); });
  type.def("__repr__", &describe);
}

void bind_facts(Class& type) {
  type.def_property_readonly(
      "name", [](const SharedBank& bank) { return base::printable(bank.name); }, "The file that it was read from.");
  const auto number = [&](const char* name, auto&& find, const char* text) {
    type.def_property_readonly(
        name, [find](const SharedBank& shared) { return find(*shared.played); }, text);
  };
  number("material", &describe_material,
         "dict: elasticity, density and damping law; of an orthotropic body or one of several materials the isotropic equivalent.");
  number(
      "provenance", [](const bank::Bank& b) { return parse_json(b.provenance); }, "dict: the record of the run that made it.");
  number(
      "supports", [](const bank::Bank& b) { return parse_json(b.supports.text); }, "dict: what fixes the body; empty for a free one.");
  number(
      "mass_kg", [](const bank::Bank& b) { return b.rigid.mass_kg; }, "[kg]");
  number(
      "volume_m3", [](const bank::Bank& b) { return b.rigid.volume_m3; }, "[m^3]");
  number(
      "centre_m", [](const bank::Bank& b) { return py::array(3, b.rigid.centre_m.data()); }, "(3) [m]: centre of mass.");
  number(
      "inertia_kg_m2",
      [](const bank::Bank& b) {
        return py::array(Shape{3, 3}, b.rigid.inertia_kg_m2.data());
      },
      "(3, 3) [kg m^2], about the centre of mass.");
  number(
      "band_hz", [](const bank::Bank& b) { return std::pair(b.band_hz[0], b.band_hz[1]); }, "(low, high) [Hz]");
  number(
      "complete", [](const bank::Bank& b) { return b.complete; }, "Whether every mode of band_hz is in the bank.");
  number(
      "element", [](const bank::Bank& b) { return b.element; }, "\"T4\", \"T10\", \"analytic\" or \"imported\".");
}

}  // namespace

void bind_bank(py::module_& module) {
  using py::literals::operator""_a;
  Class type(module, "Bank",
             "The modes of a body, as written by carillon-precompute: m modes, V vertices and T triangles of the surface, in the frame of "
             "the mesh. "
             "Stored arrays are read-only views.");
  bind_operations(type);
  bind_arrays(type);
  bind_facts(type);
  module.def("find_bank", &find_bank, "file"_a, "text"_a, "The bank file of a job; None if it names none.");
  module.def("materials", &list_materials, "All known materials, by name: dicts of SI values with their sources.");
}

}  // namespace carillon::python
