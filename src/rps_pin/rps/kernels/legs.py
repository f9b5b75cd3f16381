"""One leg: length, direction, rates, and the axis of its spherical joint.

A leg moves in the vertical plane through its radial direction e. With its tip at (rho, z_i) in that
plane (Eq. 7),

    d cos(phi) = g - rho,     d sin(phi) = z_i,

and with s = (-cos(phi), sin(phi)) along the leg and t = (sin(phi), cos(phi)) across it, the slopes
of length and angle are K = s . d(rho, z_i)/dx and N = t . d(rho, z_i)/dx / d. Numbers are those of
one leg; arrays may hold all three.
"""

from __future__ import annotations

from collections.abc import Sequence

from rps_pin.numerics.elementary import Number, sqrt
from rps_pin.rps.kernels.platform import Vector
from rps_pin.rps.kernels.tilt_functions import TiltFunctions

#: Of a tip, radial and up.
Pair = Sequence[Number]


def leg_geometry(radial: Number, height: Number, g: Number) -> Vector:
    """Return length d (m), cos(phi) and sin(phi) of a leg; d must not vanish."""
    inwards = g - radial
    d = sqrt(inwards * inwards + height * height)
    return d, inwards / d, height / d


def along_leg(cosine: Number, sine: Number, radial: Number, height: Number) -> Number:
    """Return s . (radial, height): of the tip's slopes, K; of its velocity, d'."""
    return sine * height - cosine * radial


def across_leg(cosine: Number, sine: Number, radial: Number, height: Number) -> Number:
    """Return t . (radial, height): of the tip's slopes, d N; of its velocity, d phi'."""
    return sine * radial + cosine * height


def leg_acceleration(
    speed: Number, angle_rate: Number, d: Number, along: Number, across: Number
) -> tuple[Number, Number]:
    """Return d'' and phi'' from the tip's acceleration along and across the leg."""
    return (
        along + d * (angle_rate * angle_rate),
        (across - 2.0 * speed * angle_rate) / d,
    )


def leg_motion(
    cosine: Number, sine: Number, d: Number, velocity: Pair, acceleration: Pair
) -> tuple[Number, Number, Number, Number]:
    """Return d', phi', d'' and phi'' for a tip's velocity and acceleration, radial and up."""
    speed = along_leg(cosine, sine, velocity[0], velocity[1])
    angle_rate = across_leg(cosine, sine, velocity[0], velocity[1]) / d
    along = along_leg(cosine, sine, acceleration[0], acceleration[1])
    across = across_leg(cosine, sine, acceleration[0], acceleration[1])
    push, turn = leg_acceleration(speed, angle_rate, d, along, across)
    return speed, angle_rate, push, turn


def rest_axis(e: Number, t: Number, tilt: TiltFunctions, cos_r: Number, sin_r: Number) -> Vector:
    """Return the rest axis of a leg's spherical joint along e, across its plane, and up.

    It is R (cos(r) z - sin(r) e); e and t are the tilt's components along e and across.
    """
    a, b, c = tilt[0], tilt[1], tilt[2]
    at = a * t
    return (
        cos_r * at - sin_r * (c + b * e * e),
        -cos_r * a * e - sin_r * b * e * t,
        cos_r * c + sin_r * at,
    )


def rest_axis_rate(
    e: Number,
    t: Number,
    de: Number,
    dt: Number,
    tilt: TiltFunctions,
    cos_r: Number,
    sin_r: Number,
) -> tuple[Number, Number]:
    """Return the time derivatives of the rest axis' components along e and up."""
    a, b, a_s, b_s = tilt[0], tilt[1], tilt[4], tilt[5]
    ds = 2.0 * (e * de + t * dt)
    dat, dc = a_s * ds * t + a * dt, -0.5 * a * ds
    return (
        cos_r * dat - sin_r * (dc + b_s * ds * e * e + 2.0 * b * e * de),
        cos_r * dc + sin_r * dat,
    )


def cone_cosine(cosine: Number, sine: Number, axis_out: Number, axis_up: Number) -> Number:
    """Return the cosine of the angle between a leg and its joint's rest axis."""
    return sine * axis_up - cosine * axis_out


def cone_sine(
    cosine: Number, sine: Number, axis_out: Number, axis_across: Number, axis_up: Number
) -> Number:
    """Return the sine of that angle: sharp where the angle is small."""
    bend = sine * axis_out + cosine * axis_up
    return sqrt(axis_across * axis_across + bend * bend)
