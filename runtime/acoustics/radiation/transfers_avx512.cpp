namespace carillon::radiation {
namespace {
constexpr int kLanes = 16;
}
}  // namespace carillon::radiation

#include "runtime/acoustics/radiation/transfers.inl"

namespace carillon::radiation {

void calc_harmonics_avx512(const HarmonicWork& work, float* harmonics) { calc_harmonics(work, harmonics); }
void calc_transfers_avx512(const TransferWork& work) { calc_transfers(work); }

}  // namespace carillon::radiation
