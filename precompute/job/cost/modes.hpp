// The number of modes of a band, estimated from the body's volume and surface (Weyl's law).
#pragma once

#include <vector>

#include "runtime/material/material.hpp"

namespace carillon::cost {

struct ModeEstimate {
  double count = 0;
  double low = 0;          // bounds: bodies with known counts
  double high = 0;         // stay within these
  double slenderness = 0;  // root of the surface over the mean thickness 2 V / S
  bool is_thin = false;    // walls thinner than half a shear wave: bending decides, and the estimate is rougher
};

/// Modes below high_hz less those below low_hz. materials and volume_m3: what the body is made of; area_m2: of its whole surface.
ModeEstimate estimate_modes(const std::vector<material::Material>& materials, const std::vector<double>& volume_m3, double area_m2,
                            double low_hz, double high_hz);

}  // namespace carillon::cost
