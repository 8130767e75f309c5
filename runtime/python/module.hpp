// The parts of the Python module _carillon; the package carillon (carillon/__init__.py) is what people import.
#pragma once

#include <pybind11/pybind11.h>

namespace carillon::python {

/// Bank, and the materials that can be named.
void bind_bank(pybind11::module_& module);
/// Scenes from their beginning to their end.
void bind_render(pybind11::module_& module);
/// Synthesiser: bodies that are struck by hand.
void bind_synthesiser(pybind11::module_& module);

}  // namespace carillon::python
