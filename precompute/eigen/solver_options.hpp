// What may follow "--" on the command line: the options of SLEPc that leave the search what it is.
#pragma once

#include <slepceps.h>

namespace carillon::eigen {

/// How a type of SLEPc's eigensolver has to be asked for the modes about a shift.
enum class Family {
  block,     // ours: the interval, starting block and locked columns of its own
  krylov,    // shift and invert, nearest ones first, a basis without restart, our convergence test
  plain,     // shift and invert, nearest ones first, SLEPc's own sizes and test
  davidson,  // K and M as they are; the factor is the preconditioner
  dense,     // K and M as they are, everything at once
};

/// Of an eigensolver whose type is set.
Family find_family(EPS eps);

/// Throws InputError, naming the option, why it cannot be and what to do instead: an -eps_type that SLEPc does not know (with those it
/// knows) or that cannot find the modes of a band; options that would move the band, the shift or the factorisation, which the proof rests
/// on. unknowns: rows of K, or 0 while they are not known. Local; the same on every rank.
void check_solver_options(PetscInt unknowns = 0);

}  // namespace carillon::eigen
