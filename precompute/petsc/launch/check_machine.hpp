// Requirements of Open MPI on the machine; its own messages about them are long and unclear.
#pragma once

namespace carillon::launch {

/// Throws SystemError for a folder of temporary files without write access, or a limit on file sizes below the needs of MPI's start.
void check_machine();

}  // namespace carillon::launch
