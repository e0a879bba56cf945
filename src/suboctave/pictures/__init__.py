"""What is seen: figures and report pages drawn from labelled datasets, the same from a live curve and from a file.

from suboctave.pictures import plot

plot(curve.to_xarray(), "curve.png")
"""

from suboctave.pictures.boundary import plot_boundaries, plot_space
from suboctave.pictures.motions import plot_history, plot_phase, plot_spectrum
from suboctave.pictures.options import View
from suboctave.pictures.paper import figure_file, save_figure
from suboctave.pictures.report import write_report
from suboctave.pictures.response import draw_response, plot, plot_panels, plot_response
from suboctave.pictures.shapes import animate_shape, plot_shape
from suboctave.pictures.vtk import to_pyvista, write_vtu

__all__ = [
    "View",
    "animate_shape",
    "draw_response",
    "figure_file",
    "plot",
    "plot_boundaries",
    "plot_history",
    "plot_panels",
    "plot_phase",
    "plot_response",
    "plot_shape",
    "plot_space",
    "plot_spectrum",
    "save_figure",
    "to_pyvista",
    "write_report",
    "write_vtu",
]
