// Arbitrary bytes as a contacts file of a scene of two cubes: played, or rejected with an InputError.
#include "tests/fuzz/play.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  const fuzz::Folder& folder = fuzz::get_folder();
  static const std::filesystem::path scene =
      folder.write("scene.json", R"({"duration_s": 0.05, "bodies": [{"name": "cube", "bank": "cube.h5"},
    {"name": "shelf", "bank": "cube.h5", "fixed": true}],
    "effects": ["modal", "hertz_pulse", "acceleration_noise", "air_delay", "doppler", "two_ears", "roughness", "rolling"]})");
  fuzz::play({.scene = scene, .contacts = folder.write("contacts.jsonl", fuzz::to_text(data, size))});
  return 0;
}
