// Arbitrary bytes as a scene: read and played, or rejected with an InputError. Long scenes and those of many bodies or strikes are read
// only.
#include "runtime/scene/scene.hpp"
#include "tests/fuzz/play.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  const fuzz::Folder& folder = fuzz::get_folder();
  const std::filesystem::path file = folder.write("scene.json", fuzz::to_text(data, size));
  try {
    const scene::Scene scene = scene::read_scene(file);
    const bool is_small =
        scene.duration_s <= 0.15 && scene.bodies.size() <= 4 && scene.strikes.size() <= 100 && scene.sample_rate_hz <= 96000;
    for (const scene::SceneBody& body : scene.bodies)
      if (body.bank.empty()) {  // requires the solver
        fuzz::report("only read");
        return 0;
      }
    if (!is_small || scene.quality.contact_step_s < 1e-4) {
      fuzz::report("only read");
      return 0;
    }
  } catch (const InputError&) {
    fuzz::report("refused");
    return 0;
  }
  fuzz::play({.scene = file});
  return 0;
}
