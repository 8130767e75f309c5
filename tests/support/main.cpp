// main() of the GoogleTest programs without MPI.
#include <gtest/gtest.h>

#include "tests/support/choose_sources.hpp"

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (!carillon::tests::choose_sources(argc, argv)) return 2;
  return RUN_ALL_TESTS();
}
