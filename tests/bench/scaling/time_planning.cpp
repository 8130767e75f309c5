// How long every rank takes to order the interface: carillon::ldlt::order_interface on the interface of a cut mesh.
// usage: time_planning FILE   (int32: nodes, ranks, then per node the count and the list of its links, then of its near ranks) -> seconds
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <exception>
#include <stdexcept>

#include "precompute/ldlt/interface.hpp"

namespace {

std::int32_t read_int(std::FILE* file) {
  std::int32_t value = 0;
  if (std::fread(&value, sizeof value, 1, file) != 1 || value < 0) throw std::runtime_error("the file ends too early or is no interface");
  return value;
}

carillon::ldlt::Lists read_lists(std::FILE* file, std::int32_t count) {
  carillon::ldlt::Lists lists;
  for (std::int32_t i = 0; i < count; ++i) {
    for (std::int32_t left = read_int(file); left > 0; --left) lists.items.push_back(read_int(file));
    lists.close();
  }
  return lists;
}

}  // namespace

int main(int argc, char** argv) try {
  std::FILE* file = argc > 1 ? std::fopen(argv[1], "rb") : nullptr;
  if (file == nullptr) {
    std::fputs("usage: time_planning FILE\n", stderr);
    return 1;
  }
  carillon::ldlt::Interface interface;
  const std::int32_t nodes = read_int(file);
  for (std::int32_t i = 0; i < nodes; ++i) interface.nodes.push_back(i);
  interface.first_of_rank.assign(static_cast<std::size_t>(read_int(file)) + 1, 0);
  interface.links = read_lists(file, nodes);
  interface.near_ranks = read_lists(file, nodes);
  std::fclose(file);
  const std::clock_t start = std::clock();
  order_interface(interface);
  std::printf("%.6f\n", static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
} catch (const std::exception& error) {
  std::fprintf(stderr, "time_planning: %s\n", error.what());
  return 1;
}
