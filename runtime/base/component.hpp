// Products around the core that a build may leave out: docs/components.md.
#pragma once

#include <string_view>

namespace carillon::base {

/// For a job, scene, bank or command that needs a component of which this build has none. `component`: in capitals, as in its option.
/// Throws InputError "SUBJECT needs the component AIR, which this build leaves out: configure it with -DCARILLON_AIR=ON".
[[noreturn]] void refuse_missing(std::string_view subject, std::string_view component);

}  // namespace carillon::base
