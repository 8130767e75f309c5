// How long every rank takes to order the separator: carillon::ldlt::order_separator on the separator of a cut mesh.
// usage: time_planning FILE   (int32: nodes, ranks, then per node the count and the list of its links, then of its near ranks) -> seconds
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <exception>
#include <stdexcept>

#include "precompute/ldlt/separator.hpp"

namespace {

std::int32_t read_int(std::FILE* file) {
  std::int32_t value = 0;
  if (std::fread(&value, sizeof value, 1, file) != 1 || value < 0) throw std::runtime_error("the file ends too early or is no separator");
  return value;
}

carillon::ldlt::Ragged read_lists(std::FILE* file, std::int32_t count) {
  carillon::ldlt::Ragged lists;
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
  carillon::ldlt::Separator separator;
  const std::int32_t nodes = read_int(file);
  for (std::int32_t i = 0; i < nodes; ++i) separator.nodes.push_back(i);
  separator.first_of_rank.assign(static_cast<std::size_t>(read_int(file)) + 1, 0);
  separator.links = read_lists(file, nodes);
  separator.adjacent_ranks = read_lists(file, nodes);
  std::fclose(file);
  const std::clock_t start = std::clock();
  order_separator(separator);
  std::printf("%.6f\n", static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
} catch (const std::exception& error) {
  std::fprintf(stderr, "time_planning: %s\n", error.what());
  return 1;
}
