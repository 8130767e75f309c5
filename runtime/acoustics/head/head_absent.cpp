// A build without the component HEADS makes no head.
#include "runtime/acoustics/head/head.hpp"
#include "runtime/acoustics/head/sofa.hpp"
#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/base/component.hpp"

namespace carillon::head {

int Head::get_latency() const noexcept { return 0; }

std::shared_ptr<const Head> make_sphere(double, const Sphere&) { base::refuse_missing("a listener with a head", "HEADS"); }

bool has_sofa() noexcept { return false; }

std::shared_ptr<const Head> read_sofa(const std::filesystem::path& file, double) { base::refuse_missing(file.string(), "HEADS"); }

}  // namespace carillon::head
