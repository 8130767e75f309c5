// make_example_bank OUT [squares a side] [modes] [supports|corrected|radiation|mounted]: writes the example bank for test scripts.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include "tests/unit/runtime/bank/example_bank.hpp"

int main(int argc, char** argv) try {
  if (argc < 2) {
    std::fputs("usage: make_example_bank OUT [squares a side] [modes] [supports|corrected|radiation|mounted]\n", stderr);
    return 1;
  }
  const int n = argc > 2 ? std::atoi(argv[2]) : 2;
  const int modes = argc > 3 ? std::atoi(argv[3]) : 5;
  namespace example = carillon::bank::example;
  const std::size_t count = modes;
  const std::string kind = argc > 4 ? argv[4] : "";
  carillon::bank::write_bank(kind == "supports"    ? example::make_supported_bank(n, count)
                             : kind == "corrected" ? example::make_corrected_bank(n, count)
                             : kind == "radiation" ? example::make_radiating_bank(n, count)
                             : kind == "mounted"   ? example::make_mounted_bank(n, count)
                                                   : example::make_bank(n, count),
                             argv[1]);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
