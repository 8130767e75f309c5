namespace carillon::radiation {
namespace {
constexpr int kLanes = 4;
}
}  // namespace carillon::radiation

#include "runtime/acoustics/radiation/transfers.inl"

namespace carillon::radiation {

void calc_harmonics_plain(const HarmonicWork& work, float* harmonics) { calc_harmonics(work, harmonics); }
void calc_transfers_plain(const TransferWork& work) { calc_transfers(work); }

}  // namespace carillon::radiation
