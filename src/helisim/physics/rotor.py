"""Thrust, inflow and power of a rotor: blade elements in uniform momentum inflow.

Coefficients are those of the field: CT = T / (rho A (Omega R)^2), CP likewise with the
third power; inflow and climb ratios are over Omega R, positive when air passes the disc
against the thrust, as in a climb.
"""

import math

from helisim.physics.kernel import kernel

_LAST_STEP = 3e-8
"""Newton converges quadratically: after a step this small the error is near rounding."""
_MAX_ITERATIONS = 60
_STALL_CORE = 0.7
"""Below this fraction of the stall limit the blades are untouched by it."""


@kernel()
def soft_limit(x, limit, core):
    """Return x itself while |x| <= core * limit, then approach the limit smoothly."""
    edge = core * limit
    rest = limit - edge
    if x > edge:
        return edge + rest * math.tanh((x - edge) / rest)
    if x < -edge:
        return -edge + rest * math.tanh((x + edge) / rest)
    return x


@kernel()
def blade_element_thrust(pitch, inflow, advance, solidity, lift_slope):
    """Return CT of untwisted, unstalled blades (Padfield, Helicopter Flight Dynamics, ch. 3).

    Args:
        pitch: collective pitch, rad.
        inflow: total inflow ratio lambda.
        advance: advance ratio mu.
        solidity: sigma = blades x chord / (pi R).
        lift_slope: effective lift slope, 1/rad.
    """
    return 0.5 * lift_slope * solidity * (pitch / 3.0 * (1.0 + 1.5 * advance**2) - 0.5 * inflow)


@kernel()
def mass_flow(inflow, advance, floor):
    """Return the mass-flow ratio sqrt(mu^2 + lambda^2) and its derivative by the inflow.

    For |lambda| < floor the modulus is rounded off (twice continuously differentiable), so
    that thrust passes smoothly through the vortex ring, where momentum theory has no solution.
    Hover and climb stay untouched; forward flight to (floor / mu)^2 / 2. Beyond a descent of
    about twice the hover's induced velocity the balance has several roots and the solution
    found is one of them: outside the model's validity.
    """
    if abs(inflow) >= floor:
        axial = abs(inflow)
        slope = math.copysign(1.0, inflow)
    else:
        s = inflow / floor
        axial = floor * (0.375 + 0.75 * s**2 - 0.125 * s**4)
        slope = 1.5 * s - 0.5 * s**3
    flow = math.sqrt(advance**2 + axial**2)
    if flow == 0.0:
        return 0.0, 0.0
    return flow, slope * axial / flow


@kernel()
def axial_inflow(pitch, climb, solidity, lift_slope):
    """Return the inflow ratio of hover and axial flight, where the balance is quadratic.

    2 (lambda - climb) lambda = CT(lambda) for lambda > 0; the start of the general solution.
    """
    half = 0.25 * (0.25 * lift_slope * solidity - 2.0 * climb)
    loading = lift_slope * solidity * pitch / 12.0
    return -half + math.sqrt(max(0.0, half * half + loading))


@kernel()
def ground_share(nearness, induced, advance):
    """Return the share of thrust that drives the inflow near the ground, and its derivative.

    Cheeseman and Bennett (R&M 3021): at one induced power the thrust is T_inf / k with
    k = 1 - (R / 4z)^2 / (1 + (mu / lambda_i)^2). Momentum theory has T lambda_i and
    lambda_i^2 proportional to share x T, so the share is k^3.

    Args:
        nearness: (R / 4z)^2.
        induced: lambda_i.
        advance: mu.
    """
    square = induced**2 + advance**2
    if nearness == 0.0 or square == 0.0:
        return (1.0 - nearness) ** 3, 0.0
    k = 1.0 - nearness * induced**2 / square
    return k**3, -6.0 * k**2 * nearness * induced * (advance / square) ** 2


@kernel()
def inflow_and_thrust(pitch, climb, advance, solidity, lift_slope, stall, floor, nearness=0.0):
    """Solve Glauert's momentum balance: 2 (lambda - climb) sqrt(mu^2 + lambda^2) = CT.

    Near the ground only a share of CT stands on the right.

    Newton's method inside a bracket that always holds the root, to rounding.

    Args:
        pitch: collective pitch, rad.
        climb: climb ratio along the thrust.
        advance: advance ratio mu.
        solidity: sigma.
        lift_slope: 1/rad.
        stall: greatest |CT| / sigma that the blades carry.
        floor: inflow ratio below which the mass flow is rounded off.
        nearness: (R / 4z)^2 of the ground, 0 far from it.

    Returns:
        Total inflow ratio lambda, and CT.
    """
    reach = 1.0 + abs(pitch) + abs(climb)
    low, high = climb - reach, climb + reach
    inflow = axial_inflow(pitch, climb, solidity, lift_slope)
    limit = stall * solidity
    edge = _STALL_CORE * limit
    for _ in range(_MAX_ITERATIONS):
        flow, flow_slope = mass_flow(inflow, advance, floor)
        linear = blade_element_thrust(pitch, inflow, advance, solidity, lift_slope)
        thrust = soft_limit(linear, limit, _STALL_CORE)
        fade = 1.0
        if abs(linear) > edge:
            fade = 1.0 - ((abs(thrust) - edge) / (limit - edge)) ** 2
        share, share_slope = ground_share(nearness, inflow - climb, advance)
        residual = 2.0 * (inflow - climb) * flow - share * thrust
        slope = 2.0 * flow + 2.0 * (inflow - climb) * flow_slope
        slope += share * 0.25 * lift_slope * solidity * fade - share_slope * thrust
        if residual > 0.0:
            high = inflow
        else:
            low = inflow
        step = residual / slope if slope > 0.0 else math.inf
        if abs(step) <= _LAST_STEP:
            inflow -= step
            break
        inflow -= step
        if not low < inflow < high:
            inflow = 0.5 * (low + high)
    thrust = blade_element_thrust(pitch, inflow, advance, solidity, lift_slope)
    return inflow, soft_limit(thrust, limit, _STALL_CORE)


@kernel()
def power(thrust, inflow, climb, advance, solidity, induced_factor, profile_drag):
    """Return CP: induced, climb and profile power.

    Leishman, Principles of Helicopter Aerodynamics, chapter 5.

    Args:
        thrust: CT.
        inflow: total inflow ratio.
        climb: climb ratio.
        advance: advance ratio.
        solidity: sigma.
        induced_factor: kappa, ratio of induced power to that of uniform inflow.
        profile_drag: c_d0 of the blades.
    """
    induced = induced_factor * (inflow - climb) * thrust
    profile = 0.125 * solidity * profile_drag * (1.0 + 4.65 * advance**2)
    return induced + climb * thrust + profile
