// Parts of the Python module _carillon; users import the package carillon (carillon/__init__.py).
#pragma once

#include <pybind11/pybind11.h>

namespace carillon::python {

/// Bank, and the table of materials.
void bind_bank(pybind11::module_& module);
/// Rendering of scenes.
void bind_render(pybind11::module_& module);
/// Synthesiser driven by calls.
void bind_synthesiser(pybind11::module_& module);
/// Scenes simulated and played by calls.
void bind_world(pybind11::module_& module);

}  // namespace carillon::python
