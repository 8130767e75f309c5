// write_report BANK RESOLVED_JOB FOLDER [carillon-draw, or "" for the one that is found [modes to draw [seconds for it [title]]]]: the
// library as a program, for the scripts among the tests.
#include <cstdio>
#include <cstdlib>

#include "jobs/front/report/report.hpp"

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fputs("usage: write_report BANK RESOLVED_JOB FOLDER [carillon-draw [modes [seconds [title]]]]\n", stderr);
    return 1;
  }
  try {
    carillon::report::Options options;
    if (argc > 4) options.draw_program = argv[4];
    if (argc > 5) options.drawn_modes = std::atoi(argv[5]);
    if (argc > 6) options.draw_limit_s = std::atof(argv[6]);
    if (argc > 7) options.title = argv[7];
    carillon::report::write_report(argv[1], argv[2], argv[3], options);
    return 0;
  } catch (const carillon::InputError& error) {
    std::fprintf(stderr, "write_report: %s\n", error.what());
    return carillon::kExitInput;
  } catch (const carillon::SystemError& error) {
    std::fprintf(stderr, "write_report: %s\n", error.what());
    return carillon::kExitSystem;
  }
}
