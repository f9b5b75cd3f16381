"""Random MJCF texts of everything that a tree can have: joints, bodies, shapes, frames, classes."""

from __future__ import annotations

import numpy as np

from tests.closed_loop.io.mjcf.twin import mujoco_file


class RandomFile:
    """Text of a tree with fixed tendons, actuators and equalities, from a seed."""

    def __init__(self, seed: int, bodies: int = 6) -> None:
        self.rng = np.random.default_rng(seed)
        self.left = bodies
        self.count = 0
        self.simple: list[str] = []
        self.bodies: list[str] = []
        self.sites: list[str] = []
        self.degrees = bool(self.rng.integers(2))
        world = self.body(top=True)
        while self.left > 0:
            world += self.body(top=True)
        replicated = (
            f'<replicate count="2" offset="0 0.5 0" euler="0 0 0.3"><body name="twice" '
            f"{self.pose()}>{self.joint(None)}{self.geom()}</body></replicate>"
        )
        self.text = mujoco_file(
            world + replicated,
            f'<compiler angle="{"degree" if self.degrees else "radian"}" '
            f'eulerseq="{self.choice("xyz", "zYx", "XZX")}"/>',
            f'<option gravity="{self.numbers(3)}"/>',
            '<default><default class="heavy"><joint armature="0.3" damping="0.2"/>'
            '<geom density="500"/></default></default>',
            '<asset><mesh name="stone" vertex="0 0 0  0.1 0 0  0 0.12 0  0 0 0.1  0.1 0.1 0.2"/>'
            "</asset>",
            self.tendons(),
            self.actuators(),
        )

    def choice(self, *options: str) -> str:
        return options[self.rng.integers(len(options))]

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def numbers(self, count: int, scale: float = 1.0) -> str:
        return " ".join(f"{x:.17g}" for x in scale * self.rng.normal(size=count))

    def positive(self, count: int = 1) -> str:
        return " ".join(f"{x:.17g}" for x in self.rng.uniform(0.05, 0.2, count))

    def angle(self) -> float:
        return float(self.rng.normal() * (60 if self.degrees else 1))

    def name(self, what: str) -> str:
        self.count += 1
        return f"{what}_{self.count}_"  # MuJoCo takes "a1" for "a" of a replicate

    def pose(self) -> str:
        turn = self.choice(
            "",
            f'quat="{self.numbers(4)}"',
            f'euler="{self.angle()} {self.angle()} {self.angle()}"',
            f'axisangle="{self.numbers(3)} {self.angle()}"',
            f'xyaxes="{self.numbers(6)}"',
            f'zaxis="{self.numbers(3)}"',
        )
        return f'pos="{self.numbers(3, 0.3)}" {turn}'

    def joint(self, name: str | None) -> str:
        kind = self.choice("hinge", "hinge", "slide", "ball") if name else "hinge"
        if name and kind != "ball":
            self.simple.append(name)
        text = f'<joint type="{kind}" pos="{self.numbers(3, 0.1)}" '
        text += f'name="{name}" ' if name else ""
        if kind != "ball":
            axis = self.choice("1 0 0", "0 1 0", "0 0 1", "0 -1 0", self.numbers(3))
            text += f'axis="{axis}" '
            if self.chance(0.5):
                text += f'ref="{self.angle()}" range="-1 2" '
            if self.chance(0.4):
                text += f'stiffness="{self.positive()}" springref="{self.angle()}" '
        for option in ("armature", "damping", "frictionloss"):
            if self.chance(0.4):
                text += f'{option}="{self.positive()}" '
        return text + ('class="heavy" />' if self.chance(0.2) else "/>")

    def geom(self) -> str:
        shapes = {
            "sphere": self.positive(),
            "box": self.positive(3),
            "cylinder": self.positive(2),
            "ellipsoid": self.positive(3),
        }
        kind = self.choice(*shapes, "capsule", "mesh")
        if kind == "mesh":
            return f'<geom type="mesh" mesh="stone" {self.pose()} contype="0" conaffinity="0"/>'
        if kind == "capsule":
            return f'<geom type="capsule" size="0.05" fromto="{self.numbers(6, 0.2)}"/>'
        mass = f'mass="{self.positive()}"' if self.chance(0.5) else ""
        return f'<geom type="{kind}" size="{shapes[kind]}" {self.pose()} {mass}/>'

    def inertia(self) -> str:
        if self.chance(0.5):
            return self.geom() + (self.geom() if self.chance(0.3) else "")
        a, b, c = self.rng.uniform(0.01, 0.03, 3)
        return (
            f'<inertial mass="{self.rng.uniform(0.5, 2):.17g}" {self.pose()} '
            f'diaginertia="{a + b:.17g} {b + c:.17g} {a + c:.17g}"/>'
        )

    def body(self, top: bool = False) -> str:
        self.left -= 1
        name = self.name("body")
        self.bodies.append(name)
        inside = ""
        free = top and self.chance(0.25)
        moving = True
        if free:
            # MuJoCo's rotors on free joints are in axes of the world.
            rotor = self.choice("", f'armature="{self.positive()}"', 'damping="0.3"')
            inside += f'<joint type="free" name="{self.name("free")}" {rotor}/>'
        elif self.chance(0.15):
            moving = not top  # a pedestal without mass, or a part of the body before
        else:
            joints = [self.joint(self.name("joint")) for _ in range(1 + self.rng.integers(3))]
            joints = [j for j in joints if "ball" not in j] + [j for j in joints if "ball" in j][:1]
            inside += "".join(joints)
        inside += self.inertia() if moving else ""
        site = self.name("site")
        self.sites.append(site)
        inside += f'<site name="{site}" {self.pose()}/>'
        while self.left > 0 and self.chance(0.6):
            child = self.body()
            framed = self.chance(0.4)
            inside += f"<frame {self.pose()}>{child}</frame>" if framed else child
        return f'<body name="{name}" {self.pose()}>{inside}</body>'

    def tendons(self) -> str:
        """Fixed tendons: for actuators, with forces; MuJoCo's armature of one is for one branch."""
        text = ""
        for k in range(3):
            if len(self.simple) < 2:
                break
            names = self.rng.choice(self.simple, 2, replace=False)
            own = self.choice(
                "",
                f'stiffness="{self.positive()}"',
                f'stiffness="{self.positive()}" springlength="0.2" damping="{self.positive()}"',
                'limited="true" range="-3 3"',
                f'frictionloss="{self.positive()}"',
            )
            joints = "".join(f'<joint joint="{n}" coef="{self.numbers(1)}"/>' for n in names)
            text += f'<fixed name="tendon_{k}" {own}>{joints}</fixed>'
        return f"<tendon>{text}</tendon>"

    def actuators(self) -> str:
        text = ""
        for name in self.simple[:3]:
            rotor = self.choice("", f'armature="{self.positive()}"', f'damping="{self.positive()}"')
            kind = self.choice("motor", "general", 'position kp="3" kv="2"')
            text += f'<{kind} joint="{name}" gear="{self.numbers(1)}" {rotor}/>'
        if len(self.simple) >= 2:
            text += f'<motor tendon="tendon_1" gear="2" damping="{self.positive()}"/>'
        return f"<actuator>{text}</actuator>"
