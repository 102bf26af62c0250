"""What the bend of an interface adds to its curvature, for particles without end: the table BEND of the tension kernels.

    python scripts/curvature_error.py [--kernel wendland_c2 ...]

A circle, a cylinder and a sphere of radius R are taken through the stages of `kernels/riemann/interface.py` with integrals
in place of sums: share of the phase, its gradient, divergence of the unit normals, both means across the interface. Unit
normals are radial, so the divergence is 1/r (2/r) at every distance r from the axis, and what is left are three things
of the order (h/R)^2: the divergence smooths 1/r (not 2/r, which is harmonic), the mean is taken over a band, and the band
lies askew, since a circle's share is smoothed inwards. A Gaussian that is not cut has 2 v, 2 v and 5/2 v, v its variance.

Printed: kernel, variance, and for the three forms (kappa R - 1) (R/h)^2 after the first mean and after both.
"""

from __future__ import annotations

import argparse
import functools

import numpy as np
import warp as wp
from scipy.interpolate import CubicSpline

from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.riemann.interface import FAINTEST, NARROW, sharpness

FORMS = ("circle", "cylinder", "sphere")
RADIUS = 30.0  # of the interface, in h: the next order is a thousandth of the one that is measured


@functools.cache
def tabulated(kernel: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return q, w(q) and w'(q)/q at 801 places of the support."""
    shape, slope = make_smoothing(kernel, "float64")
    q = np.linspace(0, KERNELS[kernel].support, 801)
    places = [wp.float64(value) for value in q]
    return q, np.array([float(shape(value)) for value in places]), np.array([float(slope(value)) for value in places])


class Interface:
    """The stages at a distance r from the middle of a circle, cylinder or sphere; lengths in h, x_ij = -d."""

    def __init__(self, kernel: str, form: str, radius: float = RADIUS, points: int = 40) -> None:
        self.radius, self.form = radius, form
        self.dimension = 2 if form == "circle" else 3
        self.support = KERNELS[kernel].support
        self.sharper = sharpness(kernel, self.dimension)
        alpha = KERNELS[kernel].alpha[self.dimension - 1]
        self.d, weights = self.places(points)
        length = np.linalg.norm(self.d, axis=1)
        q, w, slope = tabulated(kernel)
        self.w = alpha * np.interp(length, q, w) * weights
        self.slope = alpha * np.interp(length, q, slope) * weights
        self.volume = weights
        self.fraction = self.shares(lambda s: alpha * np.interp(s, q, w))

    def places(self, points: int) -> tuple[np.ndarray, np.ndarray]:
        """Return offsets d (n, 3) in the support, x across the interface, z along the axis, and their volumes (n,)."""
        gauss, share = np.polynomial.legendre.leggauss(points)
        s, ds = (gauss + 1) * self.support / 2, share * self.support / 2
        turns = 4 * points
        angle = (np.arange(turns) + 0.5) * 2 * np.pi / turns
        if self.dimension == 2:
            s, turn = np.meshgrid(s, angle, indexing="ij")
            d = np.stack([s * np.cos(turn), s * np.sin(turn), 0 * s], axis=-1)
            volume = ds[:, None] * s * (2 * np.pi / turns)
        else:
            s, cosine, turn = np.meshgrid(s, gauss, angle[::4], indexing="ij")
            sine = np.sqrt(1 - cosine**2)
            d = s[..., None] * np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=-1)
            volume = (ds * s[:, 0, 0] ** 2)[:, None, None] * share[:, None] * np.full_like(turn, 2 * np.pi / points)
        return d.reshape(-1, 3), volume.ravel()

    def shares(self, w) -> CubicSpline:
        """Return the share of the inside in the support of r, from the part of each circle or sphere about r within it."""
        s = np.linspace(1e-6, self.support, 4001)
        if self.form == "circle":
            density = 2 * np.pi * s * w(s)
        elif self.form == "sphere":
            density = 4 * np.pi * s**2 * w(s)
        else:  # summed along the axis
            z = np.linspace(-self.support, self.support, 2001)
            density = np.array([2 * np.pi * x * np.trapezoid(w(np.minimum(np.hypot(x, z), self.support)), z) for x in s])
        at = np.linspace(self.radius - 3.2 * self.support, self.radius + 3.2 * self.support, 641)

        def share(r: float) -> float:
            cosine = np.clip((self.radius**2 - r**2 - s**2) / (2 * r * s), -1, 1)
            inside = (1 + cosine) / 2 if self.form == "sphere" else 1 - np.arccos(cosine) / np.pi
            return float(np.trapezoid(density * inside, s))

        return CubicSpline(at, [share(r) for r in at])

    def seen(self, r: float) -> tuple[np.ndarray, np.ndarray]:
        """Return distances (n,) from the middle and outward unit normals (n, 3) of the neighbours of a particle at r."""
        radial = self.d + [r, 0.0, 0.0]
        if self.form != "sphere":
            radial = radial * [1.0, 1.0, 0.0]
        distance = np.linalg.norm(radial, axis=1)
        return distance, radial / distance[:, None]

    def field(self, reach: float, count: int, value) -> CubicSpline:
        """Return a stage as a function of r, within `reach` supports of the interface."""
        at = np.linspace(self.radius - reach * self.support, self.radius + reach * self.support, count)
        return CubicSpline(at, [value(r) for r in at])

    def strength(self, r: float) -> float:
        """Return |n| h."""
        return float(-(self.slope * (self.fraction(self.seen(r)[0]) - self.fraction(r)) * self.d[:, 0]).sum())

    def curvatures(self) -> tuple[float, float]:
        """Return (kappa R - 1)(R/h)^2 at the interface: after the first mean, and as sharp as it should be."""
        normal = self.field(2.1, 241, self.strength)

        def strengths(distance: np.ndarray) -> np.ndarray:
            n = np.where(np.abs(distance - self.radius) < 2.1 * self.support, np.abs(normal(distance)), 0.0)
            return np.where(n < FAINTEST, 0.0, n)

        def divergence(r: float) -> float:
            distance, unit = self.seen(r)
            f = -self.slope * (strengths(distance) > 0)
            moment = np.einsum("n,ni,nj->ij", f, self.d, self.d)
            spread = np.einsum("n,ni,nj->ij", f, self.d, unit - [1.0, 0.0, 0.0])
            return float(np.trace(np.linalg.lstsq(moment, spread, rcond=1e-9)[0]))

        def mean(of: CubicSpline, r: float) -> float:
            distance, unit = self.seen(r)
            along2 = (self.d[:, 1:] ** 2).sum(axis=1)
            near = np.abs(distance - self.radius) < 1.05 * self.support
            weight = self.volume * near * strengths(distance) ** 4 * np.maximum(unit[:, 0], 0) * np.exp(-NARROW * along2)
            return float((weight * of(distance)).sum() / weight.sum())

        raw = self.field(1.05, 81, divergence)
        first = self.field(1.05, 81, lambda r: mean(raw, r))
        at = self.radius
        one = float(first(at))
        both = one + self.sharper * (one - mean(first, at))
        exact = (2 if self.form == "sphere" else 1) / at
        return (one / exact - 1) * at**2, (both / exact - 1) * at**2


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kernel", nargs="*", default=list(KERNELS), choices=list(KERNELS))
    for kernel in parser.parse_args().kernel:
        found = [Interface(kernel, form).curvatures() for form in FORMS]
        variance = KERNELS[kernel].variance[1]
        values = (f"  {form} {one:.3f}, {both:.3f}" for form, (one, both) in zip(FORMS, found, strict=True))
        print(f"{kernel:12} v = {variance:.4f} (2-D)", *values)


if __name__ == "__main__":
    main()
