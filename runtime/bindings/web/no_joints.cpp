// Pages have no Simbody: bodies on joints are refused.
#include "runtime/base/error.hpp"
#include "runtime/physics/joints/mechanism.hpp"

namespace carillon::joints {

std::unique_ptr<Mechanism> make_mechanism(const std::vector<Member>&, const std::vector<Joint>&, const Vec3&) {
  throw InputError("pages have no joints");
}

}  // namespace carillon::joints
