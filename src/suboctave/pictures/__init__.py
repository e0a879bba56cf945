"""What is seen: figures drawn from labelled datasets, the same from a live curve and from a file.

from suboctave.pictures import response_figure

response_figure(curve.to_xarray(), "curve.png")
"""

from suboctave.pictures.response import draw_response, response_figure, response_panels
from suboctave.pictures.saving import save_figure

__all__ = ["draw_response", "response_figure", "response_panels", "save_figure"]
