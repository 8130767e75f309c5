// Effects of lasting contacts: roughness, rolling and damping, and the modes that they drive.
#pragma once

#include "runtime/scene/effects/selected_body.hpp"

namespace carillon::effects {

void judge(SelectedBody& body, const events::LastingContact& contact, Hearing& hearing);
/// Repeats the calls of contacts without a new record.
void hold_contacts(SelectedBody& body, double time_s, Hearing& hearing);

}  // namespace carillon::effects
