"""Arrays of boxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orchestration.foundation.basics.simulator import Floats

ALL = 1.001
"""Bound of every coordinate of a y with |y| ≤ 1, rounding included."""


@dataclass(frozen=True, kw_only=True)
class Boxes:
    """Boxes by centre and radius, both of shape (coordinates, boxes)."""

    centre: Floats
    radius: Floats

    def __len__(self) -> int:
        return int(self.centre.shape[1])

    def __getitem__(self, which: object) -> Boxes:
        return Boxes(centre=self.centre[:, which], radius=self.radius[:, which])  # type: ignore[index]

    def joined_with(self, *others: Boxes) -> Boxes:
        """These boxes and all others."""
        every = (self, *others)
        centre, radius = ([getattr(each, name) for each in every] for name in ("centre", "radius"))
        return Boxes(centre=np.concatenate(centre, axis=1), radius=np.concatenate(radius, axis=1))

    def halved(self, along: Floats) -> tuple[Boxes, Boxes]:
        """Both halves of each box, along one coordinate for each."""
        which = (along, np.arange(len(self)))
        radius, below, above = self.radius.copy(), self.centre.copy(), self.centre.copy()
        radius[which] /= 2
        below[which] -= radius[which]
        above[which] += radius[which]
        return Boxes(centre=below, radius=radius), Boxes(centre=above, radius=radius)


def outside(inner: float, size: int) -> Boxes:
    """Boxes that cover the |y| ≤ 1 with a first coordinate above 0 and some coordinate above `inner`."""
    layers, edge = [Boxes(centre=np.zeros((size, 0)), radius=np.zeros((size, 0)))], ALL
    while edge > inner:
        radius = edge / 4
        steps = [np.array([1.0, 3.0]), *[np.array([-3.0, -1.0, 1.0, 3.0])] * (size - 1)]
        centre = radius * np.stack(np.meshgrid(*steps, indexing="ij")).reshape(size, -1)
        centre = centre[:, np.abs(centre).max(axis=0) > edge / 2]
        layers.append(Boxes(centre=centre, radius=np.full_like(centre, radius)))
        edge /= 2
    return layers[-1].joined_with(*layers[-2::-1])
