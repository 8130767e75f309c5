#include "runtime/base/component.hpp"

#include <fmt/format.h>

#include "runtime/base/error.hpp"

namespace carillon::base {

void refuse_missing(std::string_view subject, std::string_view component) {
  throw InputError(
      fmt::format("{0} needs the component {1}, which this build leaves out: configure it with -DCARILLON_{1}=ON", subject, component));
}

}  // namespace carillon::base
