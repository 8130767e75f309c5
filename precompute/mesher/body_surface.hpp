// The surface of a body before it is meshed: smoothed, rounded and of the height asked for.
#pragma once

#include "precompute/mesher/body.hpp"

namespace carillon::mesher {

/// Smooths the noise of a scan, by less than the elements resolve.
void smooth(Body& body, const SurfaceOptions& options, SurfaceReport& report);

/// Replaces the facets by the smooth surface through their corners, unless only the smooth one would run through itself.
void round(Body& body, const SurfaceOptions& options, SurfaceReport& report);

/// round(), unless excluded, and the scale for the height asked for, which rounding, joining and wrapping change.
void round_to_height(Body& body, const SurfaceOptions& options, SurfaceReport& report);

/// Wall, thickness and count model of a body by the volume and area of its surface.
void set_model(Body& body, const SurfaceOptions& options, double volume_m3, double area_m2);

/// First edge of the search for the count [m].
double find_first_edge(const Body& body, const SurfaceOptions& options);
/// The fewest nodes allowed by the thickness.
double calc_min_nodes(const Body& body);

}  // namespace carillon::mesher
