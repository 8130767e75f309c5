// make_example_bank OUT [squares a side] [modes]: writes the example bank, for the scripts among the tests.
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "tests/bank/example_bank.hpp"

int main(int argc, char** argv) try {
  if (argc < 2) {
    std::fputs("usage: make_example_bank OUT [squares a side] [modes]\n", stderr);
    return 1;
  }
  const int n = argc > 2 ? std::atoi(argv[2]) : 2;
  const int modes = argc > 3 ? std::atoi(argv[3]) : 5;
  carillon::bank::write_bank(carillon::bank::example::make_bank(n, static_cast<std::size_t>(modes)), argv[1]);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
