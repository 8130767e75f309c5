// Keys of a job that a body of a scene may have instead of "bank".
#pragma once

#include <array>

namespace carillon::scene {

inline constexpr std::array kJobKeys{"shape",     "body",    "mesh",           "mesh_scale", "material",
                                     "materials", "element", "accuracy_cents", "band_hz",    "max_modes"};

}  // namespace carillon::scene
