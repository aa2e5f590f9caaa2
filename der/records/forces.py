"""Forces and moments that the grips exert, and those in the arms at the grips; free of kernels.

The internal force F and moment m at an arc length s are those that the part with larger s exerts on
the part with smaller s: F' = 0 and m' + r' x F = 0. Vectors have components along E1, E2, E3; the
twisting axis is E3. The first arm runs from the first grip to the second, the other one back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np

from der.records.entries import Checked, Entry
from der.utils.checks import Array, checked_array

ABOUT_E2 = np.array([-1.0, 1.0, -1.0])  # half-turns
ABOUT_E3 = np.array([-1.0, -1.0, 1.0])

Pairs = Annotated[
    Array, Entry(lambda name, values: checked_array(name, values, ("n", 2, 3)), np.ndarray.tolist)
]


@dataclass(frozen=True, eq=False)
class Forces(Checked):
    """Forces [GJ/a^2] and moments [GJ/a] at every state, (n, 2, 3) each.

    Values on N edges: they are not extrapolated, and have no error bars.
    """

    grip_force: Pairs  # that the first and the second grip exert on the ring
    grip_moment: Pairs  # likewise, about the middle of the gripped edge
    arm_force: Pairs  # F in the first arm and in the second: constant along each
    arm_moment: Pairs  # m where each arm begins, at the first grip and at the second

    @classmethod
    def of_arms(cls, force: Array, begin: Array, end: Array) -> Self:
        """Return the record of both arms.

        Parameters
        ----------
        force : (n, 2, 3) F in each arm. begin, end : (n, 2, 3) m where each arm begins and ends.

        Notes
        -----
        A grip balances the arm that ends there and the one that begins there: for the force P of
        the first grip, P + F_1 - F_2 = 0, and likewise for its moment.
        """
        onward, back = force[:, 0], force[:, 1]
        return cls(
            grip_force=np.stack([back - onward, onward - back], axis=1),
            grip_moment=end[:, ::-1] - begin,
            arm_force=force + 0.0,  # without -0
            arm_moment=begin + 0.0,
        )

    @classmethod
    def of_sector(cls, force: Array, begin: Array, end: Array, copies: int) -> Self:
        """Return the same of a ring that is made of a sector by half-turns.

        Parameters
        ----------
        force, begin, end : (n, 3) F, and m at both ends of the sector, which ends at the second
            grip.
        copies : 2, the sector is an arm; 4, the second half of one.

        Notes
        -----
        A half-turn R maps a ring on itself with its sense reversed: F becomes -R F, m becomes -R m.
        """
        if copies == 4:
            begin = -ABOUT_E2 * end
        mirrored = -ABOUT_E3
        return cls.of_arms(
            np.stack([force, mirrored * force], axis=1),
            np.stack([begin, mirrored * end], axis=1),
            np.stack([end, mirrored * begin], axis=1),
        )
