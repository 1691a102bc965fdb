"""A machine at machine zero, drawn as SVG: from above, from the front, and in space; or as lines for a browser."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from xml.sax.saxutils import escape

import numpy as np

from compd.arrays import FloatArray
from compd.model import MachineModel
from compd.model.kinematics import ACTUATOR_KINDS
from compd.report.axis_colours import AXIS_COLOURS
from compd.rotation import to_outer

PANEL_PX, MARGIN_PX, TITLE_PX = 380, 46, 40
# Below the views, for the axes and the bar of the scale.
FOOT_PX = 40
# Directions of the views: where x, y and z of {M} point on the page, to the right and up.
VIEWS = {
    "from above": np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "from the front": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "in space": np.array(
        [[math.cos(0.6), math.sin(0.6), 0.0], [-math.sin(0.6) * 0.35, math.cos(0.6) * 0.35, math.sqrt(1 - 0.35**2)]]
    ),
}
COLOURS = {"rod": "#1f5fa8", "base": "#444444", "platform": "#b3541e", "actuator": "#2d8a4e", "hinge": "#8a2d7c"}


def machine_svg(model: MachineModel, name: str) -> str:
    """The drawing as text of an SVG file, lengths in mm: joints, rods with their numbers, what moves them, hinges, the
    tool and the axes of {M}."""
    parts = _Parts(model)
    width = PANEL_PX * len(VIEWS)
    height = PANEL_PX + TITLE_PX + FOOT_PX + 34
    body: list[str] = [
        f'<text x="14" y="26" font-size="17" font-weight="600">{escape(name)} at machine zero: {model.links} rods, '
        f"{model.scales} actuators, {6 - model.links} hinges</text>"
    ]
    for k, (title, view) in enumerate(VIEWS.items()):
        body += _panel(parts, title, view, k * PANEL_PX, numbered=k == 0)
    body += _legend(parts, height - 14)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">\n'
        '<rect width="100%" height="100%" fill="white"/>\n' + "\n".join(body) + "\n</svg>\n"
    )


def machine_lines(model: MachineModel) -> list[dict[str, object]]:
    """Lines of a machine at machine zero, as plain data: `part`, `points` ((P, 3) mm in {M}) and whether `closed`."""
    parts = _Parts(model)
    rods = [np.array(ends) for ends in zip(parts.base, parts.platform, strict=True)]
    lines = [
        *(("actuator", line, False) for line in (*parts.circles, *parts.rails, *parts.cranks)),
        ("base", _round(parts.base), True),
        ("platform", _round(parts.platform), True),
        *(("rod", rod, False) for rod in rods),
        *(("hinge", hinge, False) for hinge in parts.hinges),
        ("tool", np.array([parts.origin, parts.tip]), False),
    ]
    return [{"part": part, "points": points.round(4).tolist(), "closed": closed} for part, points, closed in lines]


class _Parts:
    """Points (mm, in {M}) and lines of a machine at machine zero."""

    def __init__(self, model: MachineModel) -> None:
        zero, actuators = model.zero, model.actuators
        self.model = model
        self.base = zero.base_joints_M_mm
        self.platform = to_outer(zero.rotation_M_P, zero.platform_origin_M_mm, model.platform_joints_P_mm)
        self.origin = zero.platform_origin_M_mm
        self.tip = zero.contact.tip_M_mm
        self.size_mm = float(np.ptp(np.concatenate([self.base, self.platform]), axis=0).max())
        self.rails: list[FloatArray] = []
        self.cranks: list[FloatArray] = []
        self.circles: list[FloatArray] = []
        for i, actuator in enumerate(actuators.of_link):
            kind = ACTUATOR_KINDS[actuators.kinds[actuator]]
            if kind == "slides":
                half = 0.35 * self.size_mm * actuators.cosine_M[actuator]
                self.rails.append(np.array([self.base[i] - half, self.base[i] + half]))
            if kind == "turns":
                centre, radius = model.base_joints_at_0_M_mm[i], actuators.radius_mm[actuator]
                angles = np.linspace(0.0, 2 * np.pi, 49)[:, None]
                way = np.cos(angles) * actuators.cosine_M[actuator] + np.sin(angles) * actuators.sine_M[actuator]
                self.cranks.append(np.array([centre, self.base[i]]))
                self.circles.append(centre + radius * way)
        self.hinges = [self._hinge(h) for h in range(len(model.hinges))]

    def _hinge(self, h: int) -> FloatArray:
        """A short line along the axis of a hinge, at its joint."""
        link, on_base = self.model.hinges[h]
        axis, at = self.model.revolute_axes_P[h], self.base[link] if on_base else self.platform[link]
        if not on_base:
            axis = to_outer(self.model.zero.rotation_M_P, np.zeros(3), axis)
        half = 0.06 * self.size_mm * axis
        return np.array([at - half, at + half])

    @property
    def points(self) -> FloatArray:
        """(P, 3) every point that must be on the page."""
        lines = [*self.rails, *self.cranks, *self.circles, *self.hinges]
        return np.concatenate([self.base, self.platform, [self.tip, self.origin], *lines])


def _panel(parts: _Parts, title: str, view: FloatArray, left_px: int, numbered: bool) -> list[str]:
    flat = parts.points @ view.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    px_per_mm = (PANEL_PX - 2 * MARGIN_PX) / max(float((high - low).max()), 1e-9)
    middle = (low + high) / 2

    def place(point_mm: FloatArray) -> tuple[float, float]:
        right, up = (view @ point_mm - middle) * px_per_mm
        return left_px + PANEL_PX / 2 + right, TITLE_PX + PANEL_PX / 2 - up

    body = [f'<text x="{left_px + 14}" y="{TITLE_PX + 18}" fill="#555">{title}</text>']
    body += [_path(circle, place, COLOURS["actuator"], 1.0, dashed=True) for circle in parts.circles]
    body += [_path(rail, place, COLOURS["actuator"], 3.0) for rail in parts.rails]
    body += [_path(crank, place, COLOURS["actuator"], 4.0) for crank in parts.cranks]
    body.append(_path(_round(parts.base), place, COLOURS["base"], 1.0, closed=True, dashed=True))
    body.append(_path(_round(parts.platform), place, COLOURS["platform"], 2.0, closed=True))
    body += [
        _path(np.array([base, joint]), place, COLOURS["rod"], 3.0)
        for base, joint in zip(parts.base, parts.platform, strict=True)
    ]
    body += [_path(hinge, place, COLOURS["hinge"], 5.0) for hinge in parts.hinges]
    body += [_dot(joint, place, COLOURS["base"]) for joint in parts.base]
    body += [_dot(joint, place, COLOURS["platform"]) for joint in parts.platform]
    body.append(_path(np.array([parts.origin, parts.tip]), place, "#222222", 2.0))
    body.append(_dot(parts.tip, place, "#222222"))
    outward = parts.base - parts.base.mean(axis=0)
    for i, (joint, away) in enumerate(zip(parts.base, outward, strict=True), start=1):
        if numbered:
            right, down = place(joint + 0.06 * parts.size_mm * away / max(float(np.linalg.norm(away)), 1e-9))
            body.append(f'<text x="{right:.1f}" y="{down + 4:.1f}" text-anchor="middle">{i}</text>')
    body += _axes(view, left_px)
    return [*body, *_scale_bar(px_per_mm, left_px)]


def _axes(view: FloatArray, left_px: int) -> list[str]:
    """The axes of {M} in the lower left corner."""
    x0, y0, size = left_px + 40.0, TITLE_PX + PANEL_PX + FOOT_PX - 34.0, 26.0
    body = []
    for name, unit in zip("xyz", np.eye(3), strict=True):
        right, up = size * (view @ unit)
        if math.hypot(right, up) > 1.0:
            body.append(
                f'<line x1="{x0}" y1="{y0}" x2="{x0 + right:.1f}" y2="{y0 - up:.1f}" stroke="{AXIS_COLOURS[name]}" '
                f'stroke-width="2"/><text x="{x0 + 1.35 * right:.1f}" y="{y0 - 1.35 * up + 4:.1f}" '
                f'text-anchor="middle" fill="{AXIS_COLOURS[name]}">{name}</text>'
            )
    return body


def _scale_bar(px_per_mm: float, left_px: int) -> list[str]:
    """A bar of 1, 2 or 5 times a power of ten mm, about a fifth of the panel."""
    about = 0.2 * PANEL_PX / px_per_mm
    power = 10.0 ** math.floor(math.log10(about))
    length = max(step * power for step in (1, 2, 5) if step * power <= about)
    x1, y = left_px + PANEL_PX - 24.0, TITLE_PX + PANEL_PX + FOOT_PX - 20.0
    x0 = x1 - length * px_per_mm
    return [
        f'<line x1="{x0:.1f}" y1="{y}" x2="{x1}" y2="{y}" stroke="#222" stroke-width="2"/>',
        f'<text x="{(x0 + x1) / 2:.1f}" y="{y - 6}" text-anchor="middle">{length:g} mm</text>',
    ]


def _legend(parts: _Parts, y: float) -> Iterable[str]:
    entries = [("rod", "rods"), ("base", "base joints"), ("platform", "platform")]
    if parts.rails:
        entries.append(("actuator", "rails"))
    if parts.cranks:
        entries.append(("actuator", "cranks and their circles"))
    if parts.hinges:
        entries.append(("hinge", "axes of hinges"))
    x = 14
    for colour, text in entries:
        yield f'<rect x="{x}" y="{y - 10}" width="14" height="10" fill="{COLOURS[colour]}"/>'
        yield f'<text x="{x + 20}" y="{y}">{text}</text>'
        x += 44 + 7 * len(text)


def _round(points: FloatArray) -> FloatArray:
    """Points in the order of their angle about z from the centroid, so that an outline does not cross itself."""
    offset = points - points.mean(axis=0)
    return points[np.argsort(np.arctan2(offset[:, 1], offset[:, 0]))]


def _path(
    points: FloatArray,
    place: Callable[[FloatArray], tuple[float, float]],
    colour: str,
    width: float,
    closed: bool = False,
    dashed: bool = False,
) -> str:
    places = " L".join(f"{right:.1f} {down:.1f}" for right, down in map(place, points))
    dash = ' stroke-dasharray="4 4"' if dashed else ""
    return (
        f'<path d="M{places}{" Z" if closed else ""}" fill="none" stroke="{colour}" stroke-width="{width}" '
        f'stroke-linecap="round"{dash}/>'
    )


def _dot(point: FloatArray, place: Callable[[FloatArray], tuple[float, float]], colour: str) -> str:
    right, down = place(point)
    return f'<circle cx="{right:.1f}" cy="{down:.1f}" r="4" fill="{colour}"/>'
