// Never made in a build without the component HEADS, in which there is no head.
#include <memory>

#include "runtime/acoustics/head/ear_filter.hpp"
#include "runtime/synth/head_ears.hpp"

namespace carillon::synth {

HeadEars::HeadEars(std::shared_ptr<const head::Head>) {}
HeadEars::HeadEars(HeadEars&&) noexcept = default;
HeadEars::~HeadEars() = default;
void HeadEars::process(const Vec3&, std::span<const double>, std::span<double>, std::span<double>) noexcept {}

}  // namespace carillon::synth
