"""Fixed tendons, whose length is a sum of coordinates.

A tendon that has forces or limits of its own, or that an actuator pulls at, is a joint: a slide
without mass whose coordinate is the tendon's length (m, or rad where it is a sum of angles), with
the tendon's name, tied to the joints by a `JointCoupling`. Its stiffness, damping, dry friction,
armature and limits are the tendon's, and its force is the tendon's force.

A spatial tendon has a length that is not a sum of coordinates: one with forces is refused, and one
in an equality that is not straight between two sites; another is not read.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.io.mjcf.tree import MjcfTree

#: MuJoCo's mjWRAP_SITE.
_SITE = 3
#: Arrays of MuJoCo's model with what makes a force, by the attributes that give them.
FORCES = ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "frictionloss", "armature")


class Tendons:
    """The tendons of a file.

    Attributes
    ----------
    names : dict of int to str
        Names of the joints that stand for tendons, by MuJoCo's numbers.
    couplings : list of JointCoupling
        That tie them to the joints of the tree.
    """

    def __init__(self, tree: MjcfTree, driven: Collection[int], asked: Collection[str]) -> None:
        self._tree, self._source = tree, tree.source
        self.names: dict[int, str] = {}
        self.couplings: list[JointCoupling] = []
        m = self._source.model
        limited = not (self._source.disabled("limit") or self._source.disabled("constraint"))
        for number in range(m.ntendon):
            forces = [n for n in FORCES if np.any(self._source.read(f"tendon_{n}", number))]
            if self._source.is_fixed(number):
                wanted = forces or (m.tendon_limited[number] and limited) or number in driven
                if wanted or (m.tendon(number).name in {*asked} - {*tree.joints}):
                    self.joint(number)
            elif forces:
                self._source.refuse("tendons", number, f"has {forces[0]}, which is not read")
            elif m.tendon_limited[number] and limited:
                self._source.tell("tendons", number, "a range of a spatial tendon is not read")

    def rod(self, number: int) -> list[int] | None:
        """Return the two sites between which a spatial tendon is straight, or None."""
        m, first = self._source.model, int(self._source.model.tendon_adr[number])
        if self._source.is_fixed(number) or int(m.tendon_num[number]) != 2:
            return None
        ends = range(first, first + 2)
        if any(m.wrap_type[end] != _SITE for end in ends):
            return None
        return [int(m.wrap_objid[end]) for end in ends]

    def coefficients(self, number: int) -> Array:
        """Return the coefficients of a fixed tendon's length by qpos, shape (nq,)."""
        m, found = self._source.model, np.zeros(self._source.model.nq)
        first = int(m.tendon_adr[number])
        for wrap in range(first, first + int(m.tendon_num[number])):
            found[m.jnt_qposadr[m.wrap_objid[wrap]]] += m.wrap_prm[wrap]
        return found

    def joint(self, number: int) -> str:
        """Return the name of the joint that stands for a fixed tendon, which is made if needed."""
        if number not in self.names:
            coefficients = self.coefficients(number)
            given = self._source.model.tendon(number).name or f"tendon_{number + 1}"
            name = self.names[number] = self._tree.add_length(given, coefficients)
            self.couplings.append(
                JointCoupling(name, self.by_joint(coefficients), name=f"{name}:length")
            )
        return self.names[number]

    def by_joint(self, coefficients: Array) -> dict[str, float]:
        """Return coefficients by qpos that are not zero, by names of joints."""
        m = self._source.model
        places = {int(place): i for i, place in enumerate(m.jnt_qposadr)}
        return {
            self._tree.joints[places[k]]: float(coefficients[k])
            for k in map(int, np.flatnonzero(coefficients))
        }
