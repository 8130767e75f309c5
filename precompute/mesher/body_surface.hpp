// Body surface before meshing: smoothed, rounded and scaled to the requested height.
#pragma once

#include "precompute/mesher/body.hpp"

namespace carillon::mesher {

/// Smooths scan noise, below the element resolution.
void smooth(Body& body, const SurfaceOptions& options, SurfaceReport& report);

/// Replaces the facets by the smooth surface through their corners, unless that surface would self-intersect.
void round(Body& body, const SurfaceOptions& options, SurfaceReport& report);

/// round(), unless excluded, and the scale for the requested height, which rounding, joining and wrapping change.
void round_to_height(Body& body, const SurfaceOptions& options, SurfaceReport& report);

/// Wall, thickness and count model of a body from volume and area of its surface.
void set_model(Body& body, const SurfaceOptions& options, double volume_m3, double area_m2);

/// First edge of the search for the count [m].
double find_first_edge(const Body& body, const SurfaceOptions& options);
/// Fewest nodes allowed by the thickness.
double calc_min_nodes(const Body& body);

}  // namespace carillon::mesher
