// States by name.
#include "jobs/registry/registry.hpp"

namespace carillon::registry {

std::string to_text(State state) {
  switch (state) {
    case State::queued:
      return "queued";
    case State::running:
      return "running";
    case State::waiting:
      return "waiting";
    case State::done:
      return "done";
    case State::failed:
      return "failed";
    case State::cancelled:
      return "cancelled";
  }
  return "failed";
}

}  // namespace carillon::registry
