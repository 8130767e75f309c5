// Number of modes in a band, estimated from volume and surface (Weyl's law).
#pragma once

#include <vector>

#include "runtime/material/material.hpp"

namespace carillon::cost {

struct ModeEstimate {
  double count = 0;
  double low = 0;          // bounds that contain the known counts of test bodies (lower)
  double high = 0;         // (upper)
  double slenderness = 0;  // square root of the surface over the mean thickness 2 V / S
  bool is_thin = false;    // walls thinner than half a shear wave: bending dominates, and the estimate is rougher
};

/// Modes below high_hz minus those below low_hz. materials, volume_m3: regions of the body; area_m2: its whole surface.
ModeEstimate estimate_modes(const std::vector<material::Material>& materials, const std::vector<double>& volume_m3, double area_m2,
                            double low_hz, double high_hz);

}  // namespace carillon::cost
