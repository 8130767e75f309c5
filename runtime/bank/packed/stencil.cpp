#include "runtime/bank/packed/stencil.hpp"

#include "runtime/bank/packed/loops.hpp"

namespace carillon::packed {

void calc_stencils(std::span<const Place> centres, std::span<const Neighbours> neighbours, std::span<const Place> places,
                   std::span<Stencil> stencils) {
  find_loops().calc_stencils(centres.data(), neighbours.data(), places.data(), centres.size(), stencils.data());
}

}  // namespace carillon::packed
