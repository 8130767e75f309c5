#include "runtime/bank/packed/stencil.hpp"

#include "runtime/bank/packed/loops.hpp"
#include "runtime/base/instructions.hpp"

namespace carillon::packed {

const Loops& find_loops() {
#if defined(__x86_64__)
  if (base::has_instructions(base::Instructions::kAvx512)) return kLoopsAvx512;
  if (base::has_instructions(base::Instructions::kAvx2)) return kLoopsAvx2;
#endif
  return kLoopsPlain;
}

void calc_stencils(std::span<const Place> centres, std::span<const Neighbours> neighbours, std::span<const Place> places,
                   std::span<Stencil> stencils) {
  find_loops().calc_stencils(centres.data(), neighbours.data(), places.data(), centres.size(), stencils.data());
}

}  // namespace carillon::packed
