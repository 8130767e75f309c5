// The solver on the ranks started by mpirun. Executed by carillon-precompute (precompute/petsc/launch).
#include "precompute/run/program.hpp"

int main(int argc, char** argv) { return carillon::run::run_program(argc, argv); }
