// Effects of strikes: modes, acceleration noise, pulse length, directivity and nonlinear motion.
#pragma once

#include "runtime/scene/effects/selected_body.hpp"

namespace carillon::effects {

void judge(SelectedBody& body, const events::Impulse& impulse, Hearing& hearing);
/// A pulse in pieces is judged by the sum of its known pieces.
void judge(SelectedBody& body, const events::Force& force, Hearing& hearing);

}  // namespace carillon::effects
