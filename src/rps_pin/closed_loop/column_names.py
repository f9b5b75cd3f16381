"""Names for the entries of q and v."""

from __future__ import annotations

import pinocchio as pin


def column_names(model: pin.Model) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return a name for each coordinate and each velocity: the joint's, numbered from 0 if many."""
    of_q, of_v = [""] * model.nq, [""] * model.nv
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        for names, start, size in ((of_q, joint.idx_q, joint.nq), (of_v, joint.idx_v, joint.nv)):
            of_joint = [name] if size == 1 else [f"{name}_{i}" for i in range(size)]
            names[start : start + size] = of_joint
    return tuple(of_q), tuple(of_v)
