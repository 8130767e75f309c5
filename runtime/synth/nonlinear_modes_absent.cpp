#include "runtime/base/component.hpp"
#include "runtime/synth/nonlinear_modes.hpp"

namespace carillon::synth {

std::unique_ptr<NonlinearModes> make_nonlinear_modes(const Model&, bool) {
  base::refuse_missing("the effect \"nonlinear\", large motion,", "NONLINEAR");
}

}  // namespace carillon::synth
