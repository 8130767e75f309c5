// The flow of a row of modes through a triangle, kLanes modes at once; the file that includes this says how many. To be compiled without
// contraction, so that all instruction sets give the same numbers.
#include <utility>

#include "runtime/acoustics/radiation/flow.hpp"

namespace carillon::radiation {
namespace {

typedef std::int16_t Shorts __attribute__((vector_size(2 * kLanes)));
typedef std::int32_t Ints __attribute__((vector_size(4 * kLanes)));
typedef float Floats __attribute__((vector_size(4 * kLanes)));

template <class Vector, class Number>
Vector load(const Number* from) {
  Vector vector;
  __builtin_memcpy(&vector, from, sizeof vector);
  return vector;
}

/// Every third lane of three vectors, from lane `kAxis` on.
template <int kAxis, int... kLane>
Floats pick(Floats low, Floats middle, Floats high, std::integer_sequence<int, kLane...>) {
  const Floats both = __builtin_shufflevector(low, middle, (3 * kLane + kAxis < 2 * kLanes ? 3 * kLane + kAxis : 0)...);
  return __builtin_shufflevector(both, high, (3 * kLane + kAxis < 2 * kLanes ? kLane : 3 * kLane + kAxis - kLanes)...);
}

void calc_through(const Corners& corners, std::size_t modes, float* through, float* squares) {
  constexpr std::make_integer_sequence<int, kLanes> kAll{};
  const auto [s0, s1, s2] = corners.share;
  std::size_t m = 0;
  for (; m + kLanes <= modes; m += kLanes) {
    Floats motion[3];
    for (int i = 0; i < 3; ++i) {
      Ints sum{};
      for (const std::int16_t* steps : corners.steps) sum += __builtin_convertvector(load<Shorts>(steps + 3 * m + i * kLanes), Ints);
      motion[i] = __builtin_convertvector(sum, Floats);
    }
    const Floats x = pick<0>(motion[0], motion[1], motion[2], kAll);
    const Floats y = pick<1>(motion[0], motion[1], motion[2], kAll);
    const Floats z = pick<2>(motion[0], motion[1], motion[2], kAll);
    const Floats flow = s0 * x + s1 * y + s2 * z;
    const Floats square = load<Floats>(squares + m) + flow * flow * corners.per_share;
    __builtin_memcpy(through + m, &flow, sizeof flow);
    __builtin_memcpy(squares + m, &square, sizeof square);
  }
  for (; m < modes; ++m) {
    float motion[3];
    for (std::size_t i = 0; i < 3; ++i)
      motion[i] = static_cast<float>(corners.steps[0][3 * m + i] + corners.steps[1][3 * m + i] + corners.steps[2][3 * m + i]);
    through[m] = s0 * motion[0] + s1 * motion[1] + s2 * motion[2];
    squares[m] += through[m] * through[m] * corners.per_share;
  }
}

}  // namespace
}  // namespace carillon::radiation
