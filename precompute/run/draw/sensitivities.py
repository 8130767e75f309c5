"""Pictures of where a cut raises or lowers the frequency of a mode."""
import numpy

import modes
import sites
from picture import vtk


def make_colours():
    """Blue lowers, white does not matter, red raises; grey is doubtful."""
    table = vtk.vtkColorTransferFunction()
    for at, colour in (
        (0.0, (0.07, 0.31, 0.64)),
        (0.25, (0.45, 0.68, 0.87)),
        (0.5, (0.97, 0.97, 0.96)),
        (0.75, (0.93, 0.56, 0.42)),
        (1.0, (0.69, 0.09, 0.14)),
    ):
        table.AddRGBPoint(at, *colour)
    table.SetNanColor(0.62, 0.64, 0.67)
    return table


def draw_sensitivities(bank, sensitivities, numbers, up):
    triangles = sites.find_sites(bank.vertices, bank.triangles, sensitivities.vertex, sensitivities.normal)
    place = bank.vertices[sensitivities.vertex]
    painted = []
    for number in numbers:
        density = sensitivities.density[:, number - 1].astype(float)
        density[sensitivities.doubtful != 0] = numpy.nan
        most = numpy.nanmax(numpy.abs(density), initial=0.0)
        painted.append((place, 0.5 + 0.5 * density / most if most > 0 else numpy.full(len(density), 0.5)))
    note = "removed material; colours scaled to each mode; grey: doubtful"
    return modes.draw_panels(bank, numbers, up, triangles, painted, make_colours(), ("lowers", "raises"), note)
