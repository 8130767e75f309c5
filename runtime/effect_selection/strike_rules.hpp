// The effects that strikes call for: modes, acceleration noise, pulse length, directivity and nonlinear motion.
#pragma once

#include "runtime/effect_selection/selected_body.hpp"

namespace carillon::effect_selection {

void judge(SelectedBody& body, const events::Impulse& impulse, Hearing& hearing);
/// A pulse in pieces is judged by the sum of its known pieces.
void judge(SelectedBody& body, const events::Force& force, Hearing& hearing);

}  // namespace carillon::effect_selection
