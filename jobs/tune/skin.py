"""Spots cut from the surface of a body with sensitivities, and the wall below them."""
import dataclasses
import functools
import math

import numpy
import scipy.spatial

import grid
import shapes
import solver
from errors import InputError

SAME_SIDE = 0.5  # cosine of the largest angle between the normals of a spot
MAX_RAYS = 64  # sites where the wall is measured


@dataclasses.dataclass(frozen=True)
class Skin:
    """Sites (S) on a surface; depths (S) [m] are along their normals."""

    vertices: numpy.ndarray
    triangles: numpy.ndarray
    sites: solver.Sites

    @functools.cached_property
    def place(self):
        return self.vertices[self.sites.vertex]

    def make_spot(self, at_m, radius_m, cut_m):
        """(nearest site, depth (S)) of a spot around it, on its side of the surface; docs/equations.md, E7a."""
        nearest = numpy.linalg.norm(self.place - at_m, axis=1).argmin()
        share = numpy.linalg.norm(self.place - self.place[nearest], axis=1) / radius_m
        depth = numpy.where(self.sites.normal @ self.sites.normal[nearest] > SAME_SIDE, cut_m * grid.fade(share), 0.0)
        return nearest, depth

    def find_share(self, depth):
        """(largest share of the wall that a cut (S) takes, from both sides if both are cut; the wall [m]). Sites of sharp edges, where no
        wall is defined, do not count."""
        inner = numpy.flatnonzero((numpy.bincount(self.sites.vertex)[self.sites.vertex] == 1) & (depth > 0.5 * depth.max()))
        if not len(inner):
            return 0.0, math.inf
        at = inner[numpy.argsort(-depth[inner], kind="stable")][:: 1 + len(inner) // MAX_RAYS]
        wall = shapes.find_wall(self.vertices, self.triangles, self.place[at], -self.sites.normal[at])
        _, other = scipy.spatial.cKDTree(self.place).query(self.place[at] - numpy.minimum(wall, 1e3)[:, None] * self.sites.normal[at])
        share = (depth[at] + depth[other] * numpy.isfinite(wall)) / wall
        return share.max(), wall[share.argmax()]

    def check_share(self, depth, what, most_share):
        """Share of the wall that a cut takes. InputError where nothing would be left: most_share is what it advises."""
        share, wall = self.find_share(depth)
        if share >= 1:
            most = f"{1e3 * depth.max() * most_share / share:.2g} mm"
            raise InputError(f"{what}: no wall is left where it is {1e3 * wall:.3g} mm thick; give at most {most}")
        return share

    def calc_motion(self, depth):
        """(V, 3) motion of the vertices that moves each of their sides inwards by its depth."""
        motion = numpy.zeros_like(self.vertices)
        sides = numpy.bincount(self.sites.vertex, minlength=len(self.vertices))[self.sites.vertex]
        lone = sides == 1
        motion[self.sites.vertex[lone]] = -depth[lone, None] * self.sites.normal[lone]
        for vertex in numpy.unique(self.sites.vertex[~lone & (depth > 0)]):
            here = self.sites.vertex == vertex
            motion[vertex] = numpy.linalg.lstsq(self.sites.normal[here], -depth[here], rcond=0.1)[0]
        return motion
