// Parts of the Python module _carillon; users import the package carillon (carillon/__init__.py).
#pragma once

#include <pybind11/pybind11.h>

namespace carillon::synth {
class Synthesiser;
}

namespace carillon::python {

/// Bank, and the table of materials.
void bind_bank(pybind11::module_& module);
/// Rendering of scenes.
void bind_render(pybind11::module_& module);
/// Synthesiser driven by calls.
void bind_synthesiser(pybind11::module_& module);
/// That of an object of the class Synthesiser; it lives as long as the object. Throws pybind11::type_error for other objects.
synth::Synthesiser& find_synthesiser(const pybind11::object& object);
/// Contact tracker for other engines.
void bind_touches(pybind11::module_& module);
/// Scenes simulated and played by calls.
void bind_world(pybind11::module_& module);

}  // namespace carillon::python
