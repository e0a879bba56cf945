"""What is seen: figures drawn from labelled datasets, the same from a live curve and from a file.

from suboctave.pictures import plot_response

plot_response(curve.to_xarray(), "curve.png")
"""

from suboctave.pictures.response import draw_response, plot_panels, plot_response
from suboctave.pictures.saving import save_figure

__all__ = ["draw_response", "plot_panels", "plot_response", "save_figure"]
