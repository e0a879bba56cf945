"""Whether a curve comes back to a point that it has passed, or to an image of it."""

from __future__ import annotations

from dataclasses import replace

from suboctave.continuation.linear import distance, length
from suboctave.continuation.point import CurvePoint, between
from suboctave.continuation.problem import Array, Curve


class Place:
    """A point of a curve that a march may come back to."""

    def __init__(self, point: CurvePoint) -> None:
        self.point = point
        #: values of the parameter at its images
        self._values = [image[point.curve.parameter] for image in point.curve.images(point.u)]
        #: its images in the discretisation of the last point
        self._images: tuple[Curve, list[Array]] | None = None

    def passed(self, point: CurvePoint, new: CurvePoint) -> CurvePoint | None:
        """It again, if the step from `point` to `new` passes it in the same direction."""
        w, own = new.weights, self.point
        step = distance(new.u, point.u, w)
        here, reach = new.parameter, 1.5 * step / w[new.curve.parameter]
        if all(abs(here - value) > reach for value in self._values):
            return None
        if self._images is None or self._images[0] is not new.curve:
            self._images = (new.curve, new.curve.images(new.curve.transfer(own.u, own.curve)))
        for i, turned in enumerate(self._images[1]):
            image = new.curve.unwrapped(turned, point.u)
            if max(distance(image, point.u, w), distance(new.u, image, w)) > 1.5 * step:
                continue
            from_point, to_new = w * (image - point.u), w * (new.u - image)
            # a shift in time turns the vector and, where there are instants among the unknowns, moves it
            start, way = (new.curve.transfer(v, own.curve) for v in (own.u, own.tangent))
            leaving = new.curve.images(start + way)[i] - turned
            ahead = from_point @ (w * point.tangent) >= 0.0 and to_new @ (w * new.tangent) > 0.0
            same_way = (w * leaving) @ (w * new.tangent) > 0.5 * length(w * leaving)
            if not (ahead and same_way):
                continue
            fraction = length(from_point) / (length(from_point) + length(to_new))
            miss = length(w * (between(point, new, fraction) - image))
            if miss < 0.05 * step + 1e-6:
                return replace(own, arclength=point.arclength + length(from_point))
        return None
