// write_cube_bank OUT.h5 [GAIN [DECAY]]: a bank with modes at 820, 1730, 2950, 4410 and 7020 Hz, for tests of programs.
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "tests/unit/runtime/synth/cube_bank.hpp"

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fputs("usage: write_cube_bank OUT.h5 [GAIN [DECAY]]\n", stderr);
    return 1;
  }
  const double gain = argc > 2 ? std::atof(argv[2]) : 0.3;
  const double decay = argc > 3 ? std::atof(argv[3]) : 12.0;
  std::vector<carillon::testing::InventedMode> modes;
  for (const double freq : {820.0, 1730.0, 2950.0, 4410.0, 7020.0}) modes.push_back({freq, decay, gain, {0.4, 0.7, 1.1}, 0.07});
  try {
    carillon::bank::write_bank(carillon::testing::make_cube_bank(modes), argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
