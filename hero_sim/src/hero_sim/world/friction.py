"""Bodies that press on each other: Coulomb friction where they touch, and wheels and things with limited traction.

Inputs of a step, all pure numbers: the contacts (where a body was taken to by its wheels alone, its free twist, they
overlap by -gap, and slide by so much) and what holds each body to the floor. Outputs: the forces in the contacts, and
how far each body is moved from where its free twist took it. Nothing has inertia: a robot stops within a step.

- A body that is moved slips over the floor. Its wheels, the caster of a robot, and the whole of a thing (limit surface:
  see PushedBody) resist with friction times load, whatever the speed. This is linear for given slips, force = load *
  friction / slip * motion; slips are those of the step before, or better ones of this step (_ROUNDS). Up to a small
  speed (CREEP_M_S) the force grows with the speed: what presses less hard than a wheel can hold makes it creep.
- A contact presses only (pressure >= 0, gap >= 0) and resists sliding by up to friction times pressure. Contacts are
  solved one after the other, in a fixed order, until they change little (projected Gauss-Seidel, warm
  start; E. Catto, Iterative Dynamics with Temporal Coherence, 2005): in each world first pairs of robots, then things,
  then robots at walls. Contacts of the same two bodies are solved at once: a symmetric start stays symmetric.

A body's motion for a force f and a moment m is a f + u s, and its turn s = h (u . f + m): the floor holds it at a point
beside its center, which u stands for. The world without bodies is one that is far too heavy to be moved.
"""

import math
from typing import Any

GRAVITY_M_S2 = 9.81

CASTER_M = -0.0165
"""The caster of a robot, ahead of its center (assumption: behind the wheels, inside of the body)."""

CREEP_M_S = 0.005
"""A wheel that slips slower than this does not resist in full (assumption; rubber creeps)."""

THING_CREEP_M_S = 0.0001
"""A thing that would be moved slower than this stays."""

TOUCH_M = 1e-9
"""Bodies that overlap by less do not touch."""

IDLE, STARTS, CONTINUES = 0, 1, 2
"""States of a contact."""

HELD_N = 1e30
"""Holds what cannot be moved."""

_SETTLED_M = 2e-5, 1e-7
_PASSES = 100, 400
_ROUNDS = 10, 60
_SAME_SLIP = 2.0, 1.02
"""Limits for a world where robots alone touch, and for one with things, whose many contacts share a force.

A pass is the last one if it moves bodies by less than the first (few need more than five), a round if slips change by
less than the last, a factor: the next step continues with them.
"""


def solve_contacts(
    first: Any, second: Any, normal_x: Any, normal_y: Any, first_arm: Any, first_lever: Any, second_arm: Any,
    second_lever: Any, gap: Any, slide: Any, friction: Any, state: Any, share: Any, pressure: Any, drag: Any, give: Any,
    pair_ends: Any, thing_ends: Any, wall_ends: Any, robots: int, cosine: Any,
    sine: Any, half: Any, wheel_n: Any, caster_n: Any, creep: Any, rolled: Any, left: Any, right: Any, rear: Any,
    moved_x: Any, moved_y: Any, turned: Any,
) -> None:  # fmt: skip
    """Solve the contacts of each world, in place. A loop for compile_loops().

    Contact k pushes the bodies first[k] and second[k] apart; its normal points from the first to the second. arm,
    lever: moment arms (m) of a pressure and a drag about each body's center. state: IDLE for one that does not matter
    in this step, STARTS for the first one of n of the same two bodies, CONTINUES for those behind it; share: n.
    pressure, drag (N), and give (m/N) also are the start. The ends of each kind of contacts are counted from the first
    contact of all.

    Bodies: the first ones are robots. half: distance of a wheel from the center (m); wheel_n, caster_n: the largest
    forces (N); creep: below this slip (m) in a step they are not reached; rolled: free travel (m) in this step; left,
    right, rear: slips in the last step (m). cosine, sine: headings, which are turned. moved_x, moved_y (m), turned
    (rad): results.
    """
    bodies = len(half)
    a, u_x, u_y, h = [0.0] * bodies, [0.0] * bodies, [0.0] * bodies, [0.0] * bodies
    apart_x = apart_y = turned_1 = turned_2 = 0.0
    listed = [-1] * bodies
    for world in range(1, len(pair_ends)):
        active = [k for k in range(pair_ends[world - 1], pair_ends[world]) if state[k] != IDLE]
        active += [k for k in range(thing_ends[world - 1], thing_ends[world]) if state[k] != IDLE]
        active += [k for k in range(wall_ends[world - 1], wall_ends[world]) if state[k] != IDLE]
        presses = False
        for k in active:
            if pressure[k] != 0.0 or gap[k] < -TOUCH_M:
                presses = True
        if not presses:
            continue
        kind = 0 if thing_ends[world - 1] == thing_ends[world] else 1
        enough, same = _SETTLED_M[kind], _SAME_SLIP[kind]
        farthest = 0.0
        members = [0 for _ in range(0)]
        for k in active:
            if listed[first[k]] != world:
                listed[first[k]] = world
                members.append(first[k])
            if listed[second[k]] != world:
                listed[second[k]] = world
                members.append(second[k])
        for i in members:
            farthest = max(farthest, rolled[i])
        for i in members:
            if left[i] < TOUCH_M and right[i] < TOUCH_M:
                # In a new contact, most of what a robot rolls becomes slip; one that stands, stands. A thing is moved.
                left[i] = right[i] = rear[i] = rolled[i] if i < robots else farthest
        for _ in range(_ROUNDS[kind]):
            for i in members:
                left_n_m = wheel_n[i] / max(left[i], creep[i])
                right_n_m = wheel_n[i] / max(right[i], creep[i])
                rear_n_m = caster_n[i] / max(rear[i], creep[i])
                all_n_m = left_n_m + right_n_m + rear_n_m
                ahead, aside = half[i] * (left_n_m - right_n_m) / all_n_m, -CASTER_M * rear_n_m / all_n_m
                turning = half[i] * half[i] * (left_n_m + right_n_m) + CASTER_M * CASTER_M * rear_n_m
                a[i] = 1.0 / all_n_m
                h[i] = 1.0 / (turning - (ahead * ahead + aside * aside) * all_n_m)
                u_x[i] = cosine[i] * ahead - sine[i] * aside
                u_y[i] = sine[i] * ahead + cosine[i] * aside
                moved_x[i] = moved_y[i] = turned[i] = 0.0
            table = [  # empty, of types that numba knows
                (0, False, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                for _ in range(0)
            ]
            for k in active:
                i, j, n_x, n_y = first[k], second[k], normal_x[k], normal_y[k]
                n_1, n_2 = u_x[i] * n_x + u_y[i] * n_y + first_arm[k], u_x[j] * n_x + u_y[j] * n_y + second_arm[k]
                t_1, t_2 = u_y[i] * n_x - u_x[i] * n_y + first_lever[k], u_y[j] * n_x - u_x[j] * n_y + second_lever[k]
                both = a[i] + a[j]
                give_m = share[k] * (both + h[i] * n_1 * n_1 + h[j] * n_2 * n_2)
                drag_give_m = share[k] * (both + h[i] * t_1 * t_1 + h[j] * t_2 * t_2)
                table.append((
                    k, state[k] == STARTS, i, j, n_x, n_y, gap[k], slide[k], friction[k], give_m, drag_give_m,
                    first_arm[k], second_arm[k], first_lever[k], second_lever[k], n_1, t_1, n_2, t_2,
                ))  # fmt: skip
                if pressure[k] != 0.0:
                    # The motion is kept rather than the force: it is what the contacts ask for.
                    scale = give[k] / give_m
                    pressure[k] *= scale
                    drag[k] *= scale
                    force_x, force_y = pressure[k] * n_x - drag[k] * n_y, pressure[k] * n_y + drag[k] * n_x
                    turn = h[j] * (pressure[k] * n_2 + drag[k] * t_2)
                    moved_x[j] += a[j] * force_x + u_x[j] * turn
                    moved_y[j] += a[j] * force_y + u_y[j] * turn
                    turned[j] += turn
                    turn = h[i] * (pressure[k] * n_1 + drag[k] * t_1)
                    moved_x[i] -= a[i] * force_x + u_x[i] * turn
                    moved_y[i] -= a[i] * force_y + u_y[i] * turn
                    turned[i] -= turn
                give[k] = give_m
            for _ in range(_PASSES[kind]):
                changed = 0.0
                for (
                    k, starts, i, j, n_x, n_y, gap_m, slide_m, cone, give_m, drag_give_m,
                    arm_1, arm_2, lever_1, lever_2, n_1, t_1, n_2, t_2,
                ) in table:  # fmt: skip
                    if starts:
                        apart_x, apart_y = moved_x[j] - moved_x[i], moved_y[j] - moved_y[i]
                        turned_1, turned_2 = turned[i], turned[j]
                    left_m = gap_m + n_x * apart_x + n_y * apart_y + arm_2 * turned_2 - arm_1 * turned_1
                    old = pressure[k]
                    if left_m >= 0.0 and old == 0.0:
                        continue
                    pressed = old - left_m / give_m
                    if pressed < 0.0:
                        pressed = 0.0
                    more = pressed - old
                    slid_m = slide_m + n_x * apart_y - n_y * apart_x + lever_2 * turned_2 - lever_1 * turned_1
                    old_drag, most = drag[k], cone * pressed
                    dragged = old_drag - slid_m / drag_give_m
                    if dragged > most:
                        dragged = most
                    elif dragged < -most:
                        dragged = -most
                    more_drag = dragged - old_drag
                    pressure[k], drag[k] = pressed, dragged
                    force_x, force_y = more * n_x - more_drag * n_y, more * n_y + more_drag * n_x
                    turn = h[j] * (more * n_2 + more_drag * t_2)
                    moved_x[j] += a[j] * force_x + u_x[j] * turn
                    moved_y[j] += a[j] * force_y + u_y[j] * turn
                    turned[j] += turn
                    turn = h[i] * (more * n_1 + more_drag * t_1)
                    moved_x[i] -= a[i] * force_x + u_x[i] * turn
                    moved_y[i] -= a[i] * force_y + u_y[i] * turn
                    turned[i] -= turn
                    change = abs(more) * give_m
                    if change > changed:
                        changed = change
                if changed < enough:
                    break
            is_same = True
            for i in members:
                ahead = cosine[i] * moved_x[i] + sine[i] * moved_y[i]
                aside = cosine[i] * moved_y[i] - sine[i] * moved_x[i]
                turn = half[i] * turned[i]
                if i < robots:
                    slip_left = math.sqrt((ahead - turn) * (ahead - turn) + aside * aside)
                    slip_right = math.sqrt((ahead + turn) * (ahead + turn) + aside * aside)
                    aside += CASTER_M * turned[i]
                    slip_rear = math.sqrt(ahead * ahead + aside * aside)
                else:
                    slip_left = slip_right = slip_rear = math.sqrt(ahead * ahead + aside * aside + turn * turn)
                least, most = max(left[i], creep[i]), max(slip_left, creep[i])
                if most > same * least or least > same * most:
                    is_same = False
                least, most = max(right[i], creep[i]), max(slip_right, creep[i])
                if most > same * least or least > same * most:
                    is_same = False
                left[i], right[i], rear[i] = slip_left, slip_right, slip_rear
            if is_same:
                break
        for i in members:
            turn = turned[i]
            half_tangent = turn * (0.5 + turn * turn / 24.0)
            scale = 1.0 / (1.0 + half_tangent * half_tangent)
            turn_cosine, turn_sine = (1.0 - half_tangent * half_tangent) * scale, 2.0 * half_tangent * scale
            old_cosine, old_sine = cosine[i], sine[i]
            cosine[i] = old_cosine * turn_cosine - old_sine * turn_sine
            sine[i] = old_cosine * turn_sine + old_sine * turn_cosine
