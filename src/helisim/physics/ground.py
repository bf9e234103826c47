"""The ground under a rotor: planes and boxes that vehicles can land on, moving ones too.

Cheeseman and Bennett (R&M 3021) put a source in the hub and its image below the ground. The image
of a hub at a distance d from a plane pushes along the plane's normal, so the shaft sees the cosine
of the angle between the two: (R / 4d)^2 cos, level or sloping. Of a plate with edges, such as a
deck, it is as much as there is of the disc above it.
"""

import math

import mujoco

from helisim.physics import frames, rotor
from helisim.physics.body import rotation
from helisim.physics.kernel import kernel
from helisim.physics.memory import buffer, doubles_from, ints, long
from helisim.physics.params import PARAM

_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
_BOX = int(mujoco.mjtGeom.mjGEOM_BOX)
_DEEPEST = 0.4
"""Limit of (R / 4d)^2, reached within half a radius of the ground, where no rotor gets."""
_CORE = 0.625
"""Up to this part of the limit, at d = R/2, Cheeseman and Bennett's formula holds exactly."""
_MOST = 4
"""Surfaces that count, the nearest of a scene's."""
_NUMBERS = 2 * _MOST


@kernel()
def nearness(view):
    """Return (R / 4d)^2 of the ground under a vehicle's hub, kept finite at any distance.

    The ground is every plane and box of the scene that something can touch, but the vehicle's own;
    without any it is level, at height 0. The nearest counts first; what is farther has what is
    left of the disc. Nothing lifts from above: a rotor that is turned over feels no ground.
    """
    par, matrix = view.par, rotation(view)
    if par[PARAM.ground_effect] == 0.0:
        return 0.0
    m, d, offsets = view.m, view.d, view.offsets
    origin = doubles_from(d, offsets.xpos, 3 * view.body)
    cosine, sine = par[PARAM.shaft_cosine], par[PARAM.shaft_sine]
    ahead = par[PARAM.hub_x] * cosine - par[PARAM.hub_z] * sine
    below = par[PARAM.hub_z] * cosine + par[PARAM.hub_x] * sine
    x, y, z = frames.to_world(matrix, ahead, 0.0, below)
    hub = (origin[0] + x, origin[1] + y, origin[2] + z)
    shaft = (matrix[2], matrix[5], matrix[8])
    roots, bodies = ints(m, offsets.body_rootid), ints(m, offsets.geom_bodyid)
    shapes, near, count = ints(m, offsets.geom_type), buffer(_NUMBERS), 0
    grounded = False
    for geom in range(long(m, offsets.ngeom)):
        if shapes[geom] != _PLANE and shapes[geom] != _BOX:
            continue
        touched = ints(m, offsets.geom_contype)[geom] | ints(m, offsets.geom_conaffinity)[geom]
        if touched == 0 or roots[bodies[geom]] == roots[view.body]:
            continue
        grounded = True
        one, share = _surface(view, geom, shapes[geom], hub, shaft)
        if share > 0.0:
            count = _insert(near, count, one, share)
    if not grounded:
        return _nearness(par, hub[2], shaft[2])
    left, total = 1.0, 0.0
    for k in range(count):
        covered = min(left, near[2 * k + 1])
        total += covered * near[2 * k]
        left -= covered
    return total


@kernel()
def _surface(view, geom, shape, hub, shaft):
    """Return the nearness of a geom's surface below a hub, and its share of the disc."""
    centre = doubles_from(view.d, view.offsets.geom_xpos, 3 * geom)
    axes = doubles_from(view.d, view.offsets.geom_xmat, 9 * geom)
    size = doubles_from(view.m, view.offsets.geom_size, 3 * geom)
    x, y, z = hub[0] - centre[0], hub[1] - centre[1], hub[2] - centre[2]
    up = 2
    if shape == _BOX:  # the face that looks up
        for k in range(2):
            if abs(axes[6 + k]) > abs(axes[6 + up]):
                up = k
    side = 1.0 if shape == _PLANE or axes[6 + up] >= 0.0 else -1.0
    height = side * (axes[up] * x + axes[3 + up] * y + axes[6 + up] * z)
    cosine = side * (axes[up] * shaft[0] + axes[3 + up] * shaft[1] + axes[6 + up] * shaft[2])
    if shape == _PLANE:
        return _nearness(view.par, height, cosine), 1.0
    height -= size[up]
    if height <= 0.0:
        return 0.0, 0.0
    i, j = (up + 1) % 3, (up + 2) % 3
    radius = view.par[PARAM.main_radius]
    share = disc_share(
        (axes[i] * x + axes[3 + i] * y + axes[6 + i] * z) / radius,
        (axes[j] * x + axes[3 + j] * y + axes[6 + j] * z) / radius,
        size[i] / radius,
        size[j] / radius,
    )
    return _nearness(view.par, height, cosine), share


@kernel()
def _nearness(par, height, cosine):
    """Return (R / 4d)^2 of one surface, for a distance of the hub and the shaft's lean to it."""
    if cosine <= 0.0:
        return 0.0
    far = max(4.0 * height / par[PARAM.main_radius], 1e-3)  # at most a thousand radii inside
    return rotor.soft_limit(par[PARAM.ground_effect] * cosine / far**2, _DEEPEST, _CORE)


@kernel()
def _insert(near, count, one, share):
    """Put a surface where it belongs among the nearest, the nearest first; return how many."""
    k = count
    while k > 0 and near[2 * k - 2] < one:
        if k < _MOST:
            near[2 * k], near[2 * k + 1] = near[2 * k - 2], near[2 * k - 1]
        k -= 1
    if k < _MOST:
        near[2 * k], near[2 * k + 1] = one, share
    return min(count + 1, _MOST)


@kernel()
def disc_share(x, y, a, b):
    """Return how much of a disc of radius 1 around (x, y) lies over a rectangle |x| < a, |y| < b.

    As a share of the disc's area, 0 to 1.
    """
    right, left, top, bottom = a - x, -a - x, b - y, -b - y
    if right >= 1.0 and left <= -1.0 and top >= 1.0 and bottom <= -1.0:
        return 1.0
    if right <= -1.0 or left >= 1.0 or top <= -1.0 or bottom >= 1.0:
        return 0.0
    area = _corner(right, top) - _corner(left, top) - _corner(right, bottom) + _corner(left, bottom)
    return max(0.0, area / math.pi)


@kernel()
def _corner(a, b):
    """Return the area of the unit disc where x < a and y < b."""
    a, b = min(1.0, max(-1.0, a)), min(1.0, max(-1.0, b))
    below = 0.5 * (a * math.sqrt(1.0 - a * a) + math.asin(a))
    beside = 0.5 * (b * math.sqrt(1.0 - b * b) + math.asin(b))
    if a * a + b * b < 1.0:
        return a * b + below + beside + 0.25 * math.pi
    if a <= 0.0 and b <= 0.0:
        return 0.0
    if a > 0.0 and b > 0.0:
        return 2.0 * (below + beside)
    return 0.5 * math.pi + 2.0 * (below if a <= 0.0 else beside)


@kernel()
def wash_left(par, nearness, z):
    """Return the share of the main rotor's wake that is left at a place above the ground.

    The ground stops it: source and image of Cheeseman and Bennett's, of which the image is the
    farther by twice the place's height. Between the hub, at d above the ground, and a place at h
    that is 1 - ((d - h) / (d + h))^2.

    Args:
        par: parameters.
        nearness: (R / 4d)^2 of the ground.
        z: of the place, body axes, m.
    """
    drop = max(0.0, z - par[PARAM.hub_z])
    below = 4.0 * math.sqrt(nearness) * drop / par[PARAM.main_radius]  # over d
    if below >= 1.0:
        return 0.0
    return 1.0 - (below / (2.0 - below)) ** 2
