// C callbacks of PETSc and SLEPc: no exception may pass through them.
#pragma once

#include <petscsys.h>

#include <exception>
#include <new>

namespace carillon::petsc {

/// Runs the work of a callback; converts an exception to a PETSc error with the same text, which check() converts back.
template <typename Work>
PetscErrorCode guard(Work&& work) {
  try {
    work();
  } catch (const std::bad_alloc&) {
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_MEM, "out of memory");
  } catch (const std::exception& error) {
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_LIB, "%s", error.what());
  }
  return 0;
}

}  // namespace carillon::petsc
