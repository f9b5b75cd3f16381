"""Plan a swing of least energy of a five-bar, by direct collocation with IPOPT, and check it.

    OPENBLAS_NUM_THREADS=1 python examples/plan_swing.py

The five-bar swings from rest on its left to rest on its right in a given time, under torque limits
below what it would take to hold the first pose. Its motors lose tau' tau / k^2 as heat; that is the
energy, since all other work from rest to rest is the difference of the two poses' weight energy.

Loops, in CasADi functions from `mechanism.to_casadi()`: only the two driven angles p and their
speeds u are integrated (Hermite-Simpson, cubic pieces). At each knot and midpoint all coordinates
q are variables, and the loops are closed there by the equation ``closing_step(q) = 0``, which has
one row for each dependent velocity, also where rows of the closures are redundant as here. So

    p' = u,    u' = w,    0 = closing_step(q),    tau = inverse_dynamics(q, T u, T w + a_0),

a differential-algebraic equation of index 1 (coordinate partitioning: Wehage and Haug, 1982). The
loops are closed at every node to the solver's tolerance and need neither multipliers nor
stabilisation. Its limit: T ends where the driven joints no longer determine the motion. Methods
that integrate all coordinates pass such poses, but must add terms that keep the pieces on the
closed configurations (Posa, Kuindersma and Tedrake, ICRA 2016; Bordalba, Schoels, Ros, Porta and
Diehl, IEEE T-RO 39, 2023). Torques from inverse dynamics leave all defects linear (Ferrolho et al.,
ICRA 2021).

Prints IPOPT's statistics, the energy against a minimum-jerk motion of the driven joints, the
largest gap, and what a simulation under the planned torques reaches, in the Pinocchio engine and
in generated code. Writes swing.png and swing.svg. Needs the extra `compile`.

Exit status: 0 done; 1 IPOPT found no plan; 2 wrong usage.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel
from rps_pin.errors import RPSPinError
from rps_pin.plots import COLOURS, LEG_STYLES, PAGE, save_figure, styled

Array = NDArray[np.float64]

MECHANISM = Path(__file__).parent.parent / "urdf" / "five_bar.yaml"
#: Left and right crank, rad; the arms are guesses, from where the loop is closed.
START = {"left_joint": -3.4, "left_arm_joint": 2.3, "right_joint": -1.75, "right_arm_joint": -1.3}
GOAL = {"left_joint": -1.3, "left_arm_joint": 1.3, "right_joint": 0.45, "right_arm_joint": -2.4}
MOTOR_CONSTANT = 0.5  # k, N m / sqrt(W): torque over the square root of the heat it costs
SUBSTEPS = 20  # of the simulation in each piece


class Motion(NamedTuple):
    """A motion of n = 2 N + 1 nodes: the ends of N pieces, and their midpoints."""

    time: Array
    """s, shape (n,)."""
    q: Array
    """Shape (n, nq)."""
    u: Array
    """Speeds of the driven joints, rad/s, shape (n, m)."""
    w: Array
    """Their accelerations, rad/s^2, shape (n, m)."""
    tau: Array
    """N m, shape (n, m)."""

    def energy(self) -> float:
        """Heat of the motors, J."""
        return float(weights(self.time) @ (self.tau**2).sum(axis=1)) / MOTOR_CONSTANT**2


def main() -> int:
    """Plan, compare, check and draw; return the exit status."""
    args = arguments()
    robot = ClosedLoopModel.load(MECHANISM)
    start, goal = closed(robot, START), closed(robot, GOAL)
    nodes = np.linspace(0.0, args.duration, 2 * args.intervals + 1)
    plain = minimum_jerk(robot, start, goal, nodes)
    clock = time.perf_counter()
    plan, stats = planned(robot, plain, args.limit)
    seconds = time.perf_counter() - clock
    print(
        f"IPOPT: {stats['return_status']}, {stats['iter_count']} iterations, {seconds:.2f} s "
        "with making the expressions"
    )
    if not stats["success"]:
        print("no plan: try a longer duration or a higher limit", file=sys.stderr)
        return 1
    saved = 1 - plan.energy() / plain.energy()
    print(f"energy: {plan.energy():.4g} J; minimum jerk {plain.energy():.4g} J: {saved:.1%} saved")
    print(f"largest torque: {largest(plan.tau)} N m; minimum jerk {largest(plain.tau)} N m")
    print(f"largest gap at the nodes: {max(map(robot.loop_gap, plan.q)):.1e} m")
    for engine, name in ((robot, "Pinocchio"), (robot.compile(), "generated code")):
        clock = time.perf_counter()
        simulation = simulated(engine, plan)
        seconds = time.perf_counter() - clock
        print(
            f"simulation, {name}: error at the end {abs(simulation.q[-1] - goal).max():.1e} rad, "
            f"{abs(simulation.v[-1]).max():.1e} rad/s; largest gap {simulation.gap.max():.1e} m; "
            f"{seconds:.2f} s"
        )
    args.output.mkdir(parents=True, exist_ok=True)
    for path in save_figure(drawn(robot, plan, plain, args.limit), args.output, "swing"):
        print(f"written: {path}")
    return 0


def arguments() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description="Plan a swing of least energy of a five-bar.")
    parser.add_argument("--duration", type=float, default=1.0, help="of the swing, s (default 1)")
    parser.add_argument("--limit", type=float, default=2.0, help="of each torque, N m (default 2)")
    parser.add_argument("--intervals", type=int, default=60, help="pieces (default 60)")
    parser.add_argument("--output", type=Path, default=Path(), help="folder of the figure")
    args = parser.parse_args()
    if not 0 < args.duration < np.inf:
        parser.error(f"--duration {args.duration}: it must be a positive time, in s")
    if not args.limit > 0:
        parser.error(f"--limit {args.limit}: it must be a positive torque, in N m")
    if args.intervals < 1:
        parser.error(f"--intervals {args.intervals}: it must be at least 1")
    return args


# Motions ------------------------------------------------------------------------------------------


def closed(robot: ClosedLoopModel, joints: dict[str, float]) -> Array:
    """Return the closed configuration with given cranks, shape (nq,)."""
    guess = np.array([joints[name] for name in list(robot.model.names)[1:]])
    return robot.complete({name: joints[name] for name in robot.actuated}, guess)


def minimum_jerk(robot: ClosedLoopModel, start: Array, goal: Array, nodes: Array) -> Motion:
    """Return the motion of least jerk of the driven joints, its torques by inverse dynamics."""
    driven, duration, q = robot.actuated_indices, nodes[-1], start
    s, way = nodes / duration, (goal - start)[robot.actuated_indices]
    place = start[driven] + np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, way)
    u = np.outer(30 * s**2 - 60 * s**3 + 30 * s**4, way) / duration
    w = np.outer(60 * s - 180 * s**2 + 120 * s**3, way) / duration**2
    configurations, torques = [], []
    for p_k, u_k, w_k in zip(place, u, w, strict=True):
        q = robot.complete(p_k, q)
        v = robot.velocity(q, u_k)
        configurations.append(q)
        torques.append(robot.inverse_dynamics(q, v, robot.acceleration(q, v, w_k)).tau)
    return Motion(nodes, np.array(configurations), u, w, np.array(torques))


def weights(nodes: Array) -> Array:
    """Return Simpson's weights of the nodes, shape (n,), s."""
    step = nodes[2] - nodes[0]
    result = np.full(len(nodes), step / 3)
    result[1::2], result[0], result[-1] = 2 * step / 3, step / 6, step / 6
    return result


# The plan -----------------------------------------------------------------------------------------


def planned(robot: ClosedLoopModel, guess: Motion, limit: float) -> tuple[Motion, dict[str, Any]]:
    """Return the motion of least energy between the ends of a guess, and IPOPT's statistics."""
    functions = robot.to_casadi()
    driven, (n, m) = functions.independent.tolist(), guess.u.shape
    at_nodes = node(functions).map(n)
    q, u, w = ca.MX.sym("q", guess.q.shape[1], n), ca.MX.sym("u", m, n), ca.MX.sym("w", m, n)
    closing, tau = at_nodes(q, u, w)
    step = guess.time[2] - guess.time[0]
    equations = [*hermite_simpson(q[driven, :], u, step), *hermite_simpson(u, w, step), closing]
    zero = ca.veccat(*equations)
    energy = ca.dot(ca.sum1(tau**2), ca.DM(weights(guess.time)).T) / MOTOR_CONSTANT**2

    shapes = [guess.q.shape, guess.u.shape, guess.w.shape]
    fixed = [np.zeros(shape, dtype=bool) for shape in shapes]
    fixed[0][np.ix_([0, -1], driven)] = fixed[1][[0, -1]] = True  # the ends, at rest
    first = np.concatenate([guess.q.ravel(), guess.u.ravel(), guess.w.ravel()])
    held = np.concatenate([mask.ravel() for mask in fixed])
    bound = np.r_[np.zeros(zero.numel()), np.full(tau.numel(), limit)]
    options = {
        "ipopt": {"max_iter": 300, "constr_viol_tol": 1e-11, "print_level": 0, "sb": "yes"},
        "print_time": False,
    }
    problem = {"x": ca.veccat(q, u, w), "f": energy, "g": ca.veccat(zero, tau)}
    solver = ca.nlpsol("swing", "ipopt", problem, options)
    found = solver(
        x0=first,
        lbx=np.where(held, first, -np.inf),
        ubx=np.where(held, first, np.inf),
        lbg=-bound,
        ubg=bound,
    )
    parts = np.split(found["x"].full().ravel(), np.cumsum([mask.size for mask in fixed])[:2])
    motion = [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]
    torques = at_nodes(*(part.T for part in motion))[1].full().T
    return Motion(guess.time, *motion, torques), solver.stats()


def node(functions: Any) -> Any:
    """Return the function of q, u, w that gives the closing step and the torques of one node."""
    q = ca.SX.sym("q", functions.velocity.size1_in("q"))
    u, w = (ca.SX.sym(name, functions.independent.size) for name in "uw")
    v = functions.velocity(q, u)
    a = functions.acceleration(q, v, w)
    tau = functions.inverse_dynamics(q=q, v=v, a=a)["tau"]
    closing = functions.closing_step(q=q)["step"][functions.dependent.tolist()]
    # One expression for all: what they have in common is computed once.
    return ca.Function("node", [q, u, w], ca.cse([closing, tau]))


def hermite_simpson(x: Any, rate: Any, step: float) -> tuple[Any, Any]:
    """Return what is zero if x (m, n) is cubic on each piece and has its rate at the nodes."""
    (x_0, x_c, x_1), (r_0, r_c, r_1) = ((y[:, :-2:2], y[:, 1::2], y[:, 2::2]) for y in (x, rate))
    end = x_1 - x_0 - step / 6 * (r_0 + 4 * r_c + r_1)
    midpoint = x_c - (x_0 + x_1) / 2 - step / 8 * (r_0 - r_1)
    return end, midpoint


# The check ----------------------------------------------------------------------------------------


def simulated(engine: Any, plan: Motion) -> Any:
    """Return the simulation, from the plan's start, under its torques: a parabola on each piece.

    Between two calls of the controller the torque is constant, the parabola's mean.
    """
    step = plan.time[2] - plan.time[0]
    h = step / SUBSTEPS

    def torque(now: float, q: Array, v: Array) -> Array:
        k = min(int(now / step + 1e-9), len(plan.time) // 2 - 1)
        first, middle, last = plan.tau[2 * k : 2 * k + 3]
        s = (now + h / 2) / step - k
        slope, curve = 4 * middle - 3 * first - last, 2 * (first - 2 * middle + last)
        mean: Array = first + slope * s + curve * (s * s + (h / step) ** 2 / 12)
        return mean

    return engine.simulate(plan.q[0], duration=plan.time[-1], step=h, controller=torque)


# The figure ---------------------------------------------------------------------------------------


@styled
def drawn(robot: ClosedLoopModel, plan: Motion, plain: Motion, limit: float) -> Figure:
    """Return a figure of both motions: links and paths of the tip, torques, speeds."""
    figure = Figure(figsize=(PAGE, 3.3), layout="constrained")
    axes = figure.subplot_mosaic([["swing", "torque"], ["swing", "speed"]])
    draw_swing(axes["swing"], robot, plan, plain)
    for motion, style in ((plan, LEG_STYLES[0]), (plain, LEG_STYLES[1])):
        for joint, name in enumerate(("left", "right")):
            label = f"{name}, {'least energy' if motion is plan else 'minimum jerk'}"
            look: Any = {"color": COLOURS[joint], "linestyle": style, "label": label}
            axes["torque"].plot(motion.time, motion.tau[:, joint], **look)
            axes["speed"].plot(motion.time, motion.u[:, joint], **look)
    for bound in (-limit, limit):
        axes["torque"].axhline(bound, color=COLOURS[-1], linewidth=0.8, linestyle=":")
    axes["torque"].plot([], [], ":", color=COLOURS[-1], linewidth=0.8, label="limit of torque")
    axes["torque"].set_ylabel("torque (N m)")
    axes["torque"].tick_params(labelbottom=False)
    axes["speed"].set(xlabel="time (s)", ylabel="speed (rad/s)")
    handles, labels = axes["torque"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def draw_swing(axes: Axes, robot: ClosedLoopModel, plan: Motion, plain: Motion) -> None:
    """Draw the links at eleven times, and both paths of the tip."""
    shown = np.linspace(0, len(plan.time) - 1, 11).astype(int)
    for k, shade in zip(shown, np.linspace(0.25, 1.0, len(shown)), strict=True):
        for arm, colour in zip(("left", "right"), COLOURS, strict=False):
            x, z = np.array([at(robot, plan.q[k], frame) for frame in frames(arm)]).T
            axes.plot(x, z, "-o", color=colour, alpha=shade, markersize=2.0, linewidth=1.0)
    for motion, style in ((plan, LEG_STYLES[0]), (plain, LEG_STYLES[1])):
        x, z = np.array([at(robot, q, "left_tip") for q in motion.q]).T
        axes.plot(x, z, color=COLOURS[-1], linestyle=style, linewidth=1.0)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("z (m)")


def frames(arm: str) -> tuple[str, str, str]:
    """Return the frames at a crank's ends and at the tip."""
    return f"{arm}_joint", f"{arm}_arm_joint", f"{arm}_tip"


def at(robot: ClosedLoopModel, q: Array, frame: str) -> Array:
    """Return x and z of a frame, m."""
    return robot.frame_placement(q, frame)[[0, 2], 3]


def largest(torques: Array) -> str:
    """Return the largest torque of each motor in words."""
    return " and ".join(f"{torque:.3g}" for torque in abs(torques).max(axis=0))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except RPSPinError as error:
        sys.exit(f"error: {error}")
