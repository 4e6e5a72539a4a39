"""Tags of known ids about known places, found by their whole print: where edges of shadows break their outlines. Pure.

Shades are compared as logarithms: a shadow lowers them by a constant on one side of its edge, which is fitted together
with the print. The pose is refined by inverse compositional alignment (Baker and Matthews, 2004), as an affine one.
"""

import math
from functools import lru_cache
from typing import Dict, Iterator, List, NamedTuple, Optional, Tuple

import cv2
import numpy as np

from hero_node import clamp

from ..prints.tag_images import FAMILIES, draw_tag
from .tag_pose import TagCorners

DARK = 10.0
"""Added to shades, of 255, before their logarithm is taken: noise, of which the dark ones consist."""
BLACK = 0.1
"""Light that black reflects, with that addition, by white's."""

CELLS = FAMILIES["36h11"].cells
BLUR_PX = 0.85
MIN_BLUR_CELLS, BLUR_RATIO = 0.35, 1.25
"""The least blurred template, and how much more each next one is; images of larger tags are blurred as much."""
STEPS = 8
"""Steps of a cell in the drawn print."""
SAMPLES = 2
"""Samples of an image along a cell."""

TURNS = 60
"""Headings that are tried where none is known."""
NEARBY_TURNS = [0, -1, 1, -2, 2]
"""Numbers of these from a known heading, in the order in which they are tried."""
MAX_STARTS = 6

ROUGH_ROUNDS, ROUNDS = 4, 6
MAX_STEP, MAX_STRETCH = 1.0, 0.2
"""Most cells, and share of the size, that a round of the refinement changes."""
SETTLED_STEP, SETTLED_STRETCH = 0.01, 0.002
"""The last round changes less; the next one would change a hundredth of that."""

MIN_ROUGH_MATCH, MIN_CODE_MATCH, MIN_BORDER_MATCH = 0.6, 0.85, 0.8
"""Least correlation with the print: to go on, of the cells that hold the code (other tags: 0.78), and around them."""
MAX_MISREAD, MISREAD = 1, 1.0
"""Cells of the code that may differ from the print by more than the second, in standard deviations of the print's."""
MIN_CONTRAST = 0.15
"""Least difference of the logarithms of white and black, in standard deviations of the print's, in light and shadow."""

_EDGES = [(turn * math.pi / 12.0, float(place)) for turn in range(12) for place in range(-4, 5)]
"""Directions of shadows, rad, and places of their edges along these, cells."""
EDGE_CELLS = 0.5

SIDE = CELLS + 2
"""Cells along a side of the print with its white margin."""


def _list_places(samples: int) -> np.ndarray:
    axis = (np.arange(SIDE * samples) + 0.5) / samples - SIDE / 2.0
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


POINTS, CELL_CENTERS = _list_places(SAMPLES), _list_places(1)
"""Places of the samples (M, 2) and of the cells' centers (C * C, 2), in cells from the center of the print."""
_IS_CODE, _IS_CODE_CELL = (np.abs(places).max(axis=1) < SIDE / 2.0 - 2.0 for places in (POINTS, CELL_CENTERS))


class _Fit(NamedTuple):
    """A place of the print in an image, and how well it explains it there.

    shape: (2, 2), px per cell; center: (2,), px; code, border: correlations with the cells of the code, and the others.
    """

    shape: np.ndarray
    center: np.ndarray
    code: float
    border: float
    misread: int
    contrast: float
    is_settled: bool

    @property
    def is_sure(self) -> bool:
        """True if this is the tag, and no other."""
        is_alike = self.code >= MIN_CODE_MATCH and self.border >= MIN_BORDER_MATCH
        return is_alike and self.misread <= MAX_MISREAD and self.contrast >= MIN_CONTRAST


class TagTemplate:
    """The print of a tag with its white margin, as blurred as in an image. Places are in cells: x right, y down."""

    def __init__(self, family: str, tag_id: int, blur_cells: float) -> None:
        """Raises: ValueError for an unknown id."""
        cells, pad = np.pad(draw_tag(family, tag_id) > 0, 1, constant_values=True), 2
        drawn = np.kron(np.pad(cells, pad, mode="edge"), np.ones((STEPS, STEPS)))
        drawn = np.log(cv2.GaussianBlur(np.where(drawn > 0, 1.0, BLACK), (0, 0), STEPS * blur_cells)).astype(np.float32)
        down, right = (STEPS * slope for slope in np.gradient(drawn))
        coarse = CELL_CENTERS
        pixels = STEPS * (POINTS + SIDE / 2.0 + pad) - 0.5
        self._print, across, along = (_sample(part, pixels[None])[0] for part in (drawn, right, down))
        spread, self._print = self._print.std(), (self._print - self._print.mean()) / self._print.std()
        x, y = POINTS.T
        self._slopes = np.column_stack((across, along, across * x, across * y, along * x, along * y)) / spread
        print_ = _coarsen(self._print[None])[0]
        self._even = np.linalg.qr(np.column_stack((np.ones(len(coarse)), coarse, print_)))[0]
        self._even[:, 3] *= np.sign(self._even[:, 3] @ print_)
        shadows = _shade(coarse)
        self._shadows, self._faded = self._make_basis(shadows, shadows * print_)
        self._lights: Dict[int, Tuple[np.ndarray, np.ndarray]] = {}
        """For each of _EDGES met so far: columns that explain samples, (M, 6), and what solves for their factors."""

    def _make_basis(self, shadows: np.ndarray, faded: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return for each edge what a shadow and its loss of contrast add to an evenly lit print, (E, C * C) each."""
        first, second = (part - part @ self._even @ self._even.T for part in (shadows, faded))
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second -= (first * second).sum(axis=1, keepdims=True) * first
        return first, second / np.linalg.norm(second, axis=1, keepdims=True)

    def find(self, gray: np.ndarray, center: np.ndarray, shapes: np.ndarray) -> Optional[np.ndarray]:
        """Return the corners (4, 2) of the tag within 1.5 cells or so of a place in gray (H, W, 8 bit), or None.

        shapes: (N, 2, 2), px per cell: headings, sizes and slants to begin with, the likeliest first.
        """
        shades = np.log(gray.astype(np.float32) + DARK)
        cell_px = math.sqrt(abs(np.linalg.det(shapes[0])))
        if cell_px * MIN_BLUR_CELLS > BLUR_PX:
            shades = cv2.GaussianBlur(shades, (0, 0), math.sqrt((cell_px * MIN_BLUR_CELLS) ** 2 - BLUR_PX**2))
        for start in self._list_starts(shades, center, shapes, cell_px):
            fit = self._refine(shades, *start, ROUGH_ROUNDS)
            if min(fit.code, fit.border) < MIN_ROUGH_MATCH:
                continue
            if not (fit.is_sure and fit.is_settled):
                fit = self._refine(shades, fit.shape, fit.center, ROUNDS)
            if fit.is_sure:
                half = SIDE / 2.0 - 1.0
                return half * np.array(((-1, -1), (1, -1), (1, 1), (-1, 1))) @ fit.shape.T + fit.center
        return None

    def _list_starts(
        self, shades: np.ndarray, center: np.ndarray, shapes: np.ndarray, cell_px: float
    ) -> Iterator[Tuple[np.ndarray, np.ndarray]]:
        """Yield shapes and centers to begin with, those that explain the image best first, one for each shift."""
        yield shapes[0], center
        shifts = cell_px * np.stack(np.meshgrid((-1, 0, 1), (-1, 0, 1)), axis=-1).reshape(-1, 2)
        places = CELL_CENTERS @ shapes.transpose(0, 2, 1)
        places = (places[:, None] + (shifts + center)[:, None]).reshape(-1, SIDE**2, 2)
        contrast, rest, _ = self._explain(_sample(cv2.GaussianBlur(shades, (0, 0), 0.25 * cell_px), places))
        scores = np.where(contrast > 0.0, contrast**2 / (contrast**2 + rest + 1e-9), 0.0).reshape(len(shapes), -1)
        best = scores.argmax(axis=0)
        for index in np.argsort(-scores.max(axis=0))[:MAX_STARTS]:
            yield shapes[best[index]], center + shifts[index]

    def _explain(self, cells: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return contrast, squared rest, and the best of _EDGES, (N,) each, of the logarithms of cells (N, C * C)."""
        parts = cells @ self._even
        rests = cells - parts @ self._even.T
        explained = (rests @ self._shadows.T) ** 2 + (rests @ self._faded.T) ** 2
        return parts[:, 3], (rests**2).sum(axis=1) - explained.max(axis=1), explained.argmax(axis=1)

    def _refine(self, shades: np.ndarray, shape: np.ndarray, center: np.ndarray, rounds: int) -> _Fit:
        """Return a fit, some rounds after this shape and center; shades: logarithms (H, W)."""
        samples = _sample(shades, (POINTS @ shape.T + center)[None])[0]
        light, _, contrast = self._fit_light(samples)
        solve = _invert(np.column_stack((light, self._slopes * contrast[:, None])))[light.shape[1] :]
        is_settled = False
        for _ in range(rounds):
            *steps, a, b, c, d = (solve @ samples).tolist()
            across, down = (clamp(step, MAX_STEP) for step in steps)
            a, b, c, d = (clamp(part, MAX_STRETCH) for part in (a, b, c, d))
            stretch = np.array(((1.0 + d, -b), (-c, 1.0 + a))) / ((1.0 + a) * (1.0 + d) - b * c)
            center = center - shape @ stretch @ (across, down)
            shape = shape @ stretch
            samples = _sample(shades, (POINTS @ shape.T + center)[None])[0]
            changes = max(abs(across), abs(down)), max(map(abs, (a, b, c, d)))
            is_settled = changes[0] < SETTLED_STEP and changes[1] < SETTLED_STRETCH
            if is_settled:
                break
        final_light, evenness, contrast = self._fit_light(samples)
        is_settled &= final_light is light  # or the edge of a shadow turned out to be another one
        seen = (samples - evenness) / np.maximum(contrast, MIN_CONTRAST)
        code, border = (_correlate(seen[part], self._print[part]) for part in (_IS_CODE, ~_IS_CODE))
        off = np.abs(_coarsen((seen - self._print)[None])[0])
        misread = int((off[_IS_CODE_CELL] > MISREAD).sum())
        return _Fit(shape, center, code, border, misread, float(contrast.min()), is_settled)

    def _fit_light(self, samples: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what explains samples (M,): columns (M, 6), logarithms without the print (M,), and contrast (M,)."""
        edge = int(self._explain(_coarsen(samples[None]))[2][0])
        if edge not in self._lights:
            shadow = _shade(POINTS, edge)[0]
            columns = (np.ones(len(samples)), POINTS, shadow, self._print, shadow * self._print)
            light = np.column_stack(columns)
            self._lights[edge] = light, _invert(light)
        light, solve = self._lights[edge]
        factors = solve @ samples
        return light, light[:, :4] @ factors[:4], factors[4] + factors[5] * light[:, 3]


@lru_cache(maxsize=64)
def _make_template(tag_id: int, steps: int) -> TagTemplate:
    return TagTemplate("36h11", tag_id, MIN_BLUR_CELLS * BLUR_RATIO**steps)


class TemplateDetector(NamedTuple):
    """A detector of one tag of 36h11, about a place in an image, px.

    corners: (4, 2) px, when it was seen a moment ago: its heading, size and slant; None: sought at all headings.
    """

    tag_id: int
    center: np.ndarray
    side_px: float
    corners: Optional[np.ndarray]

    def detect(self, gray: np.ndarray, origin: Tuple[int, int] = (0, 0)) -> List[TagCorners]:
        """Return the tag, if it is there, as AprilTagDetector.detect() does."""
        if not 0 <= self.tag_id < FAMILIES["36h11"].size:
            return []
        shape, turns = self.side_px / CELLS * np.eye(2), list(range(TURNS))
        if self.corners is not None:
            right, down = (self.corners - np.roll(self.corners, 1, axis=0))[1:3] / CELLS
            shape, turns = np.column_stack((right, down)), NEARBY_TURNS
        angles_rad = math.tau / TURNS * np.array(turns)
        cos, sin = np.cos(angles_rad), np.sin(angles_rad)
        shapes = shape @ np.moveaxis(np.array(((cos, -sin), (sin, cos))), 2, 0)
        blur_cells = CELLS * BLUR_PX / self.side_px
        template = _make_template(self.tag_id, max(0, round(math.log(blur_cells / MIN_BLUR_CELLS, BLUR_RATIO))))
        corners = template.find(gray, self.center - origin, shapes)
        return [] if corners is None else [TagCorners(self.tag_id, corners + origin)]


def _shade(places: np.ndarray, edge: Optional[int] = None) -> np.ndarray:
    """Return the shares, from -0.5 to 0.5, of shadows at places (N, 2) in cells: of one of _EDGES, or all, (E, N)."""
    edges = _EDGES if edge is None else _EDGES[edge : edge + 1]
    offsets = [places @ (math.cos(angle_rad), math.sin(angle_rad)) - place for angle_rad, place in edges]
    return np.clip(np.array(offsets) / EDGE_CELLS, -0.5, 0.5)


def _invert(columns: np.ndarray) -> np.ndarray:
    """Return what solves for the factors of columns (M, K) by least squares, (K, M)."""
    solve: np.ndarray = np.linalg.solve(columns.T @ columns + 1e-6 * np.eye(columns.shape[1]), columns.T)
    return solve


def _coarsen(samples: np.ndarray) -> np.ndarray:
    """Return the means of each cell (N, C * C) of samples (N, M)."""
    means: np.ndarray = samples.reshape(-1, SIDE, SAMPLES, SIDE, SAMPLES).mean(axis=(2, 4)).reshape(len(samples), -1)
    return means


def _sample(image: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the values (M, N) of an image (H, W), single precision, at places (M, N, 2), px."""
    return cv2.remap(image, places.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def _correlate(one: np.ndarray, other: np.ndarray) -> float:
    one, other = one - one.mean(), other - other.mean()
    return float(one @ other) / max(math.sqrt(float((one @ one) * (other @ other))), 1e-9)
