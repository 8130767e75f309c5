// What Open MPI needs of the machine and says in many words where it is missing.
#pragma once

namespace carillon::launch {

/// Throws SystemError where no file can be made in the folder of temporary files, or files may not be as long as those that MPI makes at
/// its start.
void check_machine();

}  // namespace carillon::launch
