// The Python module: errors become exceptions with the same one-line message.
#include "runtime/bindings/python/module.hpp"

#include <exception>
#include <utility>

#include "runtime/base/environment.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/version.hpp"

namespace carillon::python {
namespace {

namespace py = pybind11;

/// An exception class carillon.NAME, never freed.
PyObject* make_exception(py::module_& module, const char* name, PyObject* base, const char* text) {
  const std::string full = std::string("carillon.") + name;
  PyObject* const type = PyErr_NewExceptionWithDoc(full.c_str(), text, base, nullptr);
  if (type == nullptr) throw py::error_already_set();
  module.add_object(name, py::reinterpret_borrow<py::object>(type));
  return type;
}

PyObject *input_error = nullptr, *solve_error = nullptr, *system_error = nullptr;

/// File names may not be valid UTF-8, which would raise a different exception.
void set_error(PyObject* type, const std::exception& error) {
  PyErr_SetString(type, base::printable_lines(base::shorten(error.what())).c_str());
}

}  // namespace
}  // namespace carillon::python

PYBIND11_MODULE(_carillon, module) {
  using namespace carillon;
  using namespace carillon::python;
  module.doc() = "Mode banks, scenes and a synthesiser. Units are SI; vectors are x y z.";
  module.attr("__version__") = base::get_number();
  input_error = make_exception(module, "InputError", PyExc_ValueError,
                               "A file, a number or an option cannot be used; the message names the place and the remedy.");
  solve_error = make_exception(module, "SolveError", PyExc_RuntimeError, "The solver did not reach the required result.");
  system_error = make_exception(module, "SystemError", PyExc_OSError, "The machine refused: disk, memory, a missing program.");
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(std::move(pointer));
    } catch (const InputError& error) {
      set_error(input_error, error);
    } catch (const SolveError& error) {
      set_error(solve_error, error);
    } catch (const carillon::SystemError& error) {
      set_error(system_error, error);
    }
  });
  module.def(
      "_make_environment",
      [](bool is_alone) {
        py::list entries;
        for (const std::string& entry : is_alone ? base::make_lone_environment() : base::make_environment())
          entries.append(py::bytes(entry));
        return entries;
      },
      py::arg("is_alone"),
      "The environment of this process, NAME=value, without mpirun's variables for ranks; is_alone: for a single-rank solver.");
  bind_bank(module);
  bind_render(module);
  bind_synthesiser(module);
  bind_touches(module);
  bind_world(module);
}
