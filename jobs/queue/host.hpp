// What this machine can give: cores and memory, as this process may use them.
#pragma once

namespace carillon::queue {

struct Host {
  int cores = 1;              // that this process may run on: affinity, and what a control group allows
  double total_gb = 0.0;      // memory of the machine, or of the control group where that is less
  double available_gb = 0.0;  // of it, what could be taken now without swapping
};
Host find_host();

}  // namespace carillon::queue
