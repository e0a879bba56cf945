"""Deformed structures: a field of displacements on the mesh, as a figure, and motions over one period as a moving one.

Fields are plain arrays, (n,) or (T, n), by the degrees of freedom of a structure, such as a mode; or motions, of which
instants are drawn.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Unpack

import numpy as np

from suboctave.arguments import Rule, array_like
from suboctave.atomic import replace_file
from suboctave.errors import InputError, check_numbers, path_of, shortened
from suboctave.options import with_options
from suboctave.pictures import style
from suboctave.pictures.nodal import nodal_displacements, outline, segments, surface
from suboctave.pictures.options import PageOptions
from suboctave.pictures.paper import check_path, image_of, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suboctave.structures.structure import Structure

_SIZE = (5.4, 3.6)
#: largest displacement as it is drawn, as a share of the largest extent of the mesh
_DRAWN = 0.15
#: extents below this share of the largest one are drawn as if they were so large: a beam has room around it
_THIN = 0.12
#: where shapes are drawn: left, right, bottom and top as shares of the page
_ROOM = (0.03, 0.8, 0.07, 0.9)
#: instants of a period
_FRAMES = 48
#: faces from which edges between them are not drawn
_MANY = 1200


class ShapeOptions(PageOptions, total=False):
    """Keywords of pictures of shapes."""

    scale: Annotated[
        float | None,
        "Factor on displacements as they are drawn; by default the largest one is 15 % of the largest extent.",
    ]
    label: Annotated[str | None, 'Text at the colours; "displacement" by default.']
    seen_from: Annotated[tuple[float, float] | None, "Elevation and azimuth of the eye, degrees; (25, -60) by default."]


Field = Annotated[
    Any,
    Rule(
        "displacements, or a motion",
        lambda given: hasattr(getattr(given, "orbit", given), "displacement") or array_like(given, "biufc"),
    ),
]


@with_options(ShapeOptions)
def plot_shape(
    structure: Structure, field: Field, path: str | Path | None = None, **options: Unpack[ShapeOptions]
) -> Figure:
    """Draw a field of displacements on the mesh of a structure, over its outline at rest.

    Colours show the displacement with its sign where nodes move along one axis alone, else its modulus. Faces are
    those of shells and the outer ones of solids; beams are lines.

    Parameters
    ----------
    structure
        With mesh and labels.
    field
        Displacements (n,) of its degrees of freedom, in any unit; or a periodic motion, a point of a branch, a
        bifurcation, or the `critical_motion` of one, drawn at the instant of the largest displacements.
    path
        Where the figure is saved: .png, .svg or .pdf.
    """
    check_path(path)
    shape = np.asarray(field) if (motion := _instants(field)) is None else max(motion, key=np.linalg.norm)
    drawn = _Shape(structure, shape[None], dict(options))
    drawn.show(0)
    if path is not None:
        save_figure(drawn.figure, path)
    setattr(drawn.figure, "_repr_png_", partial(image_of, drawn.figure, "png", dpi=110.0))  # noqa: B010
    return drawn.figure


@with_options(ShapeOptions)
def animate_shape(
    structure: Structure, snapshots: Field, path: str | Path, *, duration: float = 2.0, **options: Unpack[ShapeOptions]
) -> Path:
    """Write a motion as a moving picture that repeats for ever.

    Parameters
    ----------
    structure
        With mesh and labels.
    snapshots
        Displacements (T, n) at T equal steps over one period, the first instant not repeated at the end; or a periodic
        motion, a point of a branch, a bifurcation or its `critical_motion`, for 48 of them.
    path
        A .gif file; one that is there is replaced.
    duration
        How long a period is shown, in seconds.
    """
    target = path_of(path)
    if target.suffix.lower() != ".gif":
        raise InputError(f"{target.name}: moving pictures are .gif files")
    check_numbers(duration=duration)
    if not duration > 0.0:
        raise InputError(f"duration={duration}: must be above 0")
    snapshots = snapshots if (motion := _instants(snapshots)) is None else motion
    if np.ndim(snapshots) != 2:
        raise InputError(f"snapshots are an array (T, {structure.n}), not of the shape {np.shape(snapshots)}")
    from PIL import Image

    drawn = _Shape(structure, snapshots, dict(options))
    images, palette = [], Image.new("P", (1, 1))
    # one palette for all: those made for each image would flicker
    palette.putpalette(drawn.palette().ravel().tolist())
    for index in range(len(drawn.moved)):
        drawn.show(index)
        canvas: Any = drawn.figure.canvas
        canvas.draw()
        images.append(
            Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3]).quantize(
                palette=palette, dither=Image.Dither.NONE
            )
        )
    # GIF counts in hundredths of a second
    instants = np.round(100.0 * duration * np.arange(len(images) + 1) / len(images))
    durations = (10 * np.maximum(np.diff(instants), 2)).astype(int).tolist()
    more: dict[str, Any] = {"save_all": True, "append_images": images[1:], "duration": durations, "loop": 0}
    target.parent.mkdir(parents=True, exist_ok=True)
    replace_file(target, lambda place: images[0].save(place, format="GIF", **more))
    return target


def _instants(given: Any) -> np.ndarray | None:
    """Displacements (T, n) over the period of a motion, or of the motion of what was given; None for an array."""
    orbit = getattr(given, "orbit", given)
    if not callable(getattr(orbit, "displacement", None)):
        return None
    return np.asarray(orbit.displacement(np.arange(_FRAMES) / _FRAMES * orbit.period).T)


class _Shape:
    """A figure of a structure whose shape changes.

    `moved`: displacements (T, N, 3) of its nodes.
    """

    def __init__(self, structure: Structure, fields: Any, options: dict[str, Any]) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.moved = nodal_displacements(structure, fields)
        assert structure.mesh is not None
        self.points, cells = structure.mesh.points, structure.mesh.cells
        self.faces, self.lines = surface(cells), segments(cells)
        if not self.faces and not len(self.lines):
            raise InputError(f"the mesh has no cells that can be drawn, only {', '.join(cells) or 'points'}")
        self.scale = self._scale(options.get("scale"))
        sheet = style.sheet_of(options.get("size") or _SIZE)
        self.figure, self.look = Figure(figsize=sheet.inches, dpi=110.0, facecolor="white"), sheet.look
        FigureCanvasAgg(self.figure)
        self.axes: Any = self.figure.add_axes((0.0, 0.0, 0.8, 1.0), projection="3d", computed_zorder=False)
        self._set_up(options.get("seen_from") or (25.0, -60.0))
        self._colours(options.get("label") or "displacement")
        self._rest()
        if title := style.checked_text(options.get("title")):
            self.figure.suptitle(title, fontsize=self.look.large, color=style.INK, y=0.98)
        self.artists: list[Any] = []

    def _scale(self, given: float | None) -> float:
        if given is not None:
            check_numbers(scale=given)
            return float(given)
        largest = np.linalg.norm(self.moved, axis=-1).max()
        extent = np.ptp(self.points, axis=0).max()
        return float(_DRAWN * extent / largest) if largest > 0.0 and extent > 0.0 else 1.0

    def _set_up(self, seen_from: Any) -> None:
        """Show everything that is drawn, at rest and in motion, as large as the page allows, without distortion."""
        from mpl_toolkits.mplot3d.proj3d import proj_transform

        if np.shape(seen_from) != (2,):
            raise InputError(f"seen_from: elevation and azimuth in degrees, not {shortened(seen_from)}")
        moving = self.points + self.scale * self.moved
        everywhere = np.concatenate([moving.min(axis=0), moving.max(axis=0), self.points])
        low, high = everywhere.min(axis=0), everywhere.max(axis=0)
        half = np.maximum(high - low, _THIN * (high - low).max() or 1.0) / 2.0
        for letter, at, by in zip("xyz", (low + high) / 2.0, half, strict=True):
            getattr(self.axes, f"set_{letter}lim")(at - by, at + by)
        self.axes.set_axis_off()
        self.axes.set_proj_type("ortho")
        self.axes.view_init(*seen_from)
        self.axes.set_box_aspect(half)
        self.axes.apply_aspect()
        seen = np.stack(proj_transform(*everywhere.T, self.axes.get_proj())[:2], axis=1)
        seen = self.axes.transData.transform(seen)
        page = self.figure.bbox
        room = np.array([_ROOM[1] - _ROOM[0], _ROOM[3] - _ROOM[2]]) * (page.width, page.height)
        zoom = float(np.min(room / np.maximum(np.ptp(seen, axis=0), 1.0)))
        self.axes.set_box_aspect(half, zoom=zoom)
        box = self.axes.bbox
        centre = np.array([box.x0 + box.width / 2.0, box.y0 + box.height / 2.0])
        middle = centre + zoom * ((seen.min(axis=0) + seen.max(axis=0)) / 2.0 - centre)
        wanted = np.array([_ROOM[0] + _ROOM[1], _ROOM[2] + _ROOM[3]]) / 2.0 * (page.width, page.height)
        x, y = (wanted - middle) / (page.width, page.height)
        place = self.axes.get_position(original=True)
        self.axes.set_position((place.x0 + x, place.y0 + y, place.width, place.height))

    def _colours(self, label: str) -> None:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        along = np.flatnonzero(np.any(self.moved, axis=(0, 1)))
        one = len(along) <= 1
        self.values = self.moved[..., along[0] if len(along) else 2] if one else np.linalg.norm(self.moved, axis=-1)
        top = float(np.abs(self.values).max()) or 1.0
        self.colours = ScalarMappable(Normalize(-top if one else 0.0, top), "RdBu_r" if one else "cividis")
        place = self.figure.add_axes((0.84, 0.2, 0.025, 0.6))
        bar = self.figure.colorbar(self.colours, cax=place)
        bar.set_label(style.checked_text(label), fontsize=self.look.normal, color=style.INK)
        bar.ax.tick_params(labelsize=self.look.small, color=style.INK)
        bar.outline.set_linewidth(0.5)
        bar.ax.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4))
        bar.ax.yaxis.get_offset_text().set_fontsize(self.look.small)

        text = f"displacements \u00d7 {self.scale:.3g}"
        self.figure.text(0.02, 0.02, text, fontsize=self.look.small, color=style.SOFT)

    def _rest(self) -> None:
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        ends = np.concatenate([outline(self.points, self.faces), self.lines])
        rest = Line3DCollection(self.points[ends], colors=style.SOFT, linewidths=0.6 * self.look.line, zorder=1)
        rest.set_clip_on(False)
        self.axes.add_collection3d(rest)

    def palette(self) -> np.ndarray:
        """The 256 colours (256, 3), from 0 to 255, that its pictures consist of: those of the values, and greys."""
        low, high = self.colours.get_clim()
        values = self.colours.to_rgba(np.linspace(low, high, 216), bytes=True)[:, :3]
        ink = 255.0 * np.array(style.rgb(style.INK))
        greys = ink + (255.0 - ink) * np.linspace(0.0, 1.0, 40)[:, None]
        return np.concatenate([values, np.round(greys)]).astype(np.uint8)

    def show(self, index: int) -> None:
        """Draw one of the fields in the place of the one before."""
        from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

        for artist in self.artists:
            artist.remove()
        at, values = self.points + self.scale * self.moved[index], self.values[index]
        self.artists = []
        if self.faces:
            faces = [face for several in self.faces for face in at[several]]
            colours = self.colours.to_rgba(np.concatenate([values[several].mean(axis=1) for several in self.faces]))
            fine = len(faces) > _MANY
            # without edges, seams between faces would show
            edges: Any = colours if fine else style.INK
            width = 0.3 if fine else 0.15 * self.look.line
            self.artists.append(
                Poly3DCollection(faces, facecolors=colours, edgecolors=edges, linewidths=width, zorder=2)
            )
        if len(self.lines):
            colours = self.colours.to_rgba(values[self.lines].mean(axis=1))
            # a dark edge, as the colour of zero is nearly white
            for colour, width in ((style.INK, 2.6), (colours, 2.0)):
                more = {"linewidths": width * self.look.line, "capstyle": "round", "zorder": 3}
                self.artists.append(Line3DCollection(at[self.lines], colors=colour, **more))
        for artist in self.artists:
            artist.set_clip_on(False)
            self.axes.add_collection3d(artist)
