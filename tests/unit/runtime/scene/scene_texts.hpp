// Texts of short scenes, and their parser.
#pragma once

#include <string>

#include "runtime/scene/scene.hpp"

namespace carillon::scene {

inline Scene parse(const std::string& text) { return parse_scene(base::parse_document(text, "/somewhere/scene.json")); }

inline const std::string kBody = R"("bodies": [{"name": "a", "bank": "a.h5"}])";
inline const std::string kTwo = R"("bodies": [{"name": "a", "bank": "a.h5"}, {"name": "b", "bank": "b.h5"}])";
inline const std::string kMalletPlace = R"("time_s": 0, "body": "a", "triangle": 0, )";
inline std::string with_strike(const std::string& keys) { return "{\"duration_s\": 1, " + kBody + ",\n\"strikes\": [{" + keys + "}]}"; }

}  // namespace carillon::scene
