// The parts of the Python module _carillon; users import the package carillon (carillon/__init__.py).
#pragma once

#include <pybind11/pybind11.h>

namespace carillon::python {

/// Bank, and the materials that can be named.
void bind_bank(pybind11::module_& module);
/// Scenes from their beginning to their end.
void bind_render(pybind11::module_& module);
/// Synthesiser: bodies that are struck by calls.
void bind_synthesiser(pybind11::module_& module);

}  // namespace carillon::python
