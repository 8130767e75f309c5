namespace carillon::radiation {
namespace {
constexpr int kLanes = 4;
}
}  // namespace carillon::radiation

#include "runtime/acoustics/radiation/through.inl"

namespace carillon::radiation {

void calc_through_plain(const Corners& corners, std::size_t modes, float* through, float* squares) {
  calc_through(corners, modes, through, squares);
}

}  // namespace carillon::radiation
