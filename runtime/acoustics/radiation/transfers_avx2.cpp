namespace carillon::radiation {
namespace {
constexpr int kLanes = 8;
}
}  // namespace carillon::radiation

#include "runtime/acoustics/radiation/transfers.inl"

namespace carillon::radiation {

void calc_harmonics_avx2(const HarmonicWork& work, float* harmonics) { calc_harmonics(work, harmonics); }
void calc_transfers_avx2(const TransferWork& work) { calc_transfers(work); }

}  // namespace carillon::radiation
