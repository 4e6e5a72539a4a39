"""Loops over bodies that move and press on each other.

Pure: numbers, and rows of numbers in lists or arrays. numba compiles this file where it is installed (compiled.py) and
looks for changes in it alone, so what the loops call is here. No operation depends on the machine.

Coulomb friction acts where bodies touch, and wheels and things have limited traction. A step is what bodies take at
once, one or two steps of their wheels (see World). Its inputs: the contacts (where a body was taken to by its wheels
alone, its free twist, they overlap by -gap, and slide by so much) and what holds each body to the floor. Nothing has
inertia: a robot stops within a step.

- A body that is moved slips over the floor. Its wheels, the caster of a robot, and the whole of a thing (limit surface:
  see PushedBody) resist with friction times load, whatever the speed. This is linear for given slips, force = load *
  friction / slip * motion; slips are those of the step before, or better ones of this step (_ROUNDS). Up to a small
  speed (CREEP_M_S) the force grows with the speed: what presses less hard than a wheel can hold makes it creep.
- A contact presses only (pressure >= 0, gap >= 0) and resists sliding by up to friction times pressure. Contacts are
  solved one after the other, in a fixed order, until they change little (projected Gauss-Seidel, warm
  start; E. Catto, Iterative Dynamics with Temporal Coherence, 2005): in each world first pairs of robots, then things,
  then robots at walls; one whose bodies were not moved since is left out. Contacts of the same two bodies are solved at
  once: a symmetric start stays symmetric.

A body's motion for a force f and a moment m is a f + u s, and its turn s = h (u . f + m): the floor holds it at a point
beside its center, which u stands for. The world without bodies, the last one, is not moved by any force.
"""

import math
from typing import Any, Tuple

import numpy as np

GRAVITY_M_S2 = 9.81

CASTER_M = -0.0165
"""The caster of a robot, ahead of its center (assumption: behind the wheels, inside of the body)."""

CREEP_M_S = 0.005
"""A wheel that slips slower than this does not resist in full (assumption; rubber creeps)."""

THING_CREEP_M_S = 0.0001
"""A thing that would be moved slower than this stays."""

TOUCH_M = 1e-9
"""Bodies that overlap by less do not touch."""

SHIFT_M = 0.006
"""Farthest that a robot moves in a step, or is moved while the step's contacts are solved."""

IDLE, STARTS, CONTINUES = 0, 1, 2
"""States of a contact: it does not matter in this step, is the first one of its two bodies, or is behind it."""

X, Y, THETA, COSINE, SINE, LEFT, RIGHT, REAR = range(8)
STEP_X, STEP_Y, TURN, HALF, WHEEL_N, CASTER_N, CREEP, RADIUS, ON_ROBOT, ON_WALL = range(8, 18)
MOVED_X, MOVED_Y, TURNED = range(18, 21)
KEPT_ROWS, MOVING_ROWS, BODY_ROWS = 8, 11, 21
"""Rows of bodies, lengths in m: pose and heading; slips of wheels and caster in the last step. Free twist in this step;
distance of a wheel from the center, largest forces of a wheel and the caster (N), slip in a step below which they are
not reached, radius, and friction on robots and on walls. What contacts move it by."""

TOUCHING, FRICTION, ARM_1, LEVER_1, ARM_2, LEVER_2, SHARE, PRESSURE, DRAG, GIVE = range(10)
GAP, SLIDE, NORMAL_X, NORMAL_Y = range(10, 14)
CONTACT_ROWS = 14
"""Rows of contacts, lengths in m: distance of the centers that touch, friction, moment arms of a pressure and a drag
about each body's center, and how many contacts the two bodies have; forces (N) and give (m/N), with which the next step
starts; what was found in this step."""

IS_COMPILED = False
"""True in loops that numba compiles: a branch that is hard to predict costs a processor more than what it skips."""

START_X, START_Y, ALONG_X, ALONG_Y, LENGTH2, THICKNESS = range(6)
"""Rows of obstacles: segments (see Segments) with a radius."""

_WALL_PASSES = 50

_FAR_M = 1e6

_SETTLED_M = 1e-4, 1e-7
_PASSES = 100, 400
_ROUNDS = 3, 60
_SAME_SLIP = 2.0, 1.02
"""Limits for a world where robots alone touch, and for one with things, whose many contacts share a force.

A contact that changes by less than the first moves no other one. A round is the last one if slips change by less than
the last, a factor: the next step continues with them.
"""


def shape_arc(travel_m: Any, turn_rad: Any) -> Tuple[Any, Any, Any]:
    """Return the shape of an arc by its length and turn, less than 0.5 rad: three numbers for follow_arc()."""
    square = turn_rad * turn_rad
    # Taylor series of tan(turn / 2) / turn.
    ratio = ((17.0 / 40320.0 * square + 1.0 / 240.0) * square + 1.0 / 24.0) * square + 0.5
    half_tangent = turn_rad * ratio
    shorten = 2.0 / (1.0 + half_tangent * half_tangent)
    return half_tangent, half_tangent * shorten, travel_m * ratio * shorten


def follow_arc(cosine: Any, sine: Any, half_tangent: Any, bend: Any, length_m: Any) -> Tuple[Any, Any, Any, Any]:
    """Return the displacement (x and y in m) along an arc, and the heading behind it, which stays of length 1."""
    # The direction of the chord, 1 / cos(turn / 2) long.
    chord_x, chord_y = cosine - half_tangent * sine, sine + half_tangent * cosine
    return chord_x * length_m, chord_y * length_m, cosine - bend * chord_y, sine + bend * chord_x


def follow_wheels(moved_ticks: Any, tick_m: Any, separation_m: Any, poses: Any, headings: Any) -> None:
    """Move odometry, poses (3, R) and headings (2, R), on by the ticks (2, R) that both wheels have moved.

    tick_m, separation_m (R,): travel per tick, and distance of the wheels. Does what TickOdometryRows does.
    """
    for robot in range(len(tick_m)):
        left_m, right_m = moved_ticks[0, robot] * tick_m[robot], moved_ticks[1, robot] * tick_m[robot]
        turn_rad = (right_m - left_m) / separation_m[robot]
        arc = shape_arc((left_m + right_m) / 2.0, turn_rad)
        x_m, y_m, headings[0, robot], headings[1, robot] = follow_arc(headings[0, robot], headings[1, robot], *arc)
        yaw_rad = poses[2, robot] + turn_rad
        poses[0, robot] += x_m
        poses[1, robot] += y_m
        poses[2, robot] = yaw_rad - np.rint(yaw_rad / (2.0 * math.pi)) * (2.0 * math.pi)


def find_contacts(
    pairs: int, count: int, first: Any, second: Any, obstacle: Any, state: Any, contacts: Any, bodies: Any,
    obstacles: Any, active: Any,
) -> Tuple[bool, float, int]:  # fmt: skip
    """Find the contacts that matter in this step: their states, gaps, slides and normals, in place.

    Of the count contacts, those behind the pairs of robots are of a robot, the second, with an obstacle. Return whether
    bodies touch, how far all may move until something could touch, and how many contacts are active, which are listed.
    """
    x, y, step_x, step_y, turns = bodies[X], bodies[Y], bodies[STEP_X], bodies[STEP_Y], bodies[TURN]
    start_x, start_y, length2 = obstacles[START_X], obstacles[START_Y], obstacles[LENGTH2]
    along_x, along_y = obstacles[ALONG_X], obstacles[ALONG_Y]
    touching, pressure, gap, slide = contacts[TOUCHING], contacts[PRESSURE], contacts[GAP], contacts[SLIDE]
    normal_x, normal_y, lever_1, lever_2 = contacts[NORMAL_X], contacts[NORMAL_Y], contacts[LEVER_1], contacts[LEVER_2]
    touches, least, found = False, _FAR_M, 0
    for k in range(count):
        i, j = first[k], second[k]
        if k < pairs:
            away_x, away_y = x[j] - x[i], y[j] - y[i]
            nearest = 0.5
        else:
            o = obstacle[k]
            to_x, to_y = x[j] - start_x[o], y[j] - start_y[o]
            along = min(max((to_x * along_x[o] + to_y * along_y[o]) / length2[o], 0.0), 1.0)
            away_x, away_y = to_x - along * along_x[o], to_y - along * along_y[o]
            nearest = 1.0
        distance = math.sqrt(away_x * away_x + away_y * away_y)
        between = distance - touching[k]
        share = between * nearest
        if share < least:  # in lists twice as fast as min()
            least = share
        if share >= SHIFT_M and pressure[k] == 0.0:
            state[k] = IDLE
            continue
        touches = touches or between < -TOUCH_M or pressure[k] != 0.0
        state[k] = STARTS
        active[found] = k
        found += 1
        # Robots that were placed into each other come apart step by step, never through a wall.
        gap[k] = max(between, -2.0 * SHIFT_M) if k < pairs else between
        n_x, n_y = (away_x / distance, away_y / distance) if distance > TOUCH_M else (1.0, 0.0)
        normal_x[k], normal_y[k] = n_x, n_y
        slid = n_x * (step_y[j] - step_y[i]) - n_y * (step_x[j] - step_x[i])
        slide[k] = slid + lever_2[k] * turns[j] - lever_1[k] * turns[i]
    return touches, least, found


def leave_walls(
    pairs: int, active: Any, second: Any, obstacle: Any, contacts: Any, bodies: Any, obstacles: Any
) -> None:  # fmt: skip
    """Put robots that are left in a wall out of it: whatever presses, walls are never entered."""
    x, y, touching = bodies[X], bodies[Y], contacts[TOUCHING]
    start_x, start_y, length2 = obstacles[START_X], obstacles[START_Y], obstacles[LENGTH2]
    along_x, along_y = obstacles[ALONG_X], obstacles[ALONG_Y]
    for _ in range(_WALL_PASSES):
        is_inside = False
        for k in active:
            if k < pairs:
                continue
            i, o = second[k], obstacle[k]
            to_x, to_y = x[i] - start_x[o], y[i] - start_y[o]
            along = min(max((to_x * along_x[o] + to_y * along_y[o]) / length2[o], 0.0), 1.0)
            away_x, away_y = to_x - along * along_x[o], to_y - along * along_y[o]
            distance = max(math.sqrt(away_x * away_x + away_y * away_y), TOUCH_M)
            if distance < touching[k] - TOUCH_M:
                is_inside = True
                share = (touching[k] - distance) / distance
                x[i] += away_x * share
                y[i] += away_y * share
        if not is_inside:
            break


def solve_contacts(
    active: Any, first: Any, second: Any, state: Any, contacts: Any, bodies: Any, solution: Any, robots: int,
    has_things: bool,
) -> Tuple[float, bool]:  # fmt: skip
    """Solve the active contacts of one world, and move its bodies, in place.

    Contact k pushes the bodies first[k] and second[k] apart; its normal points from the first to the second. The first
    bodies are robots. solution: a Solution of contacts.py. Return how far a body is moved at most, along x or y, and
    whether a contact presses.
    """
    places, presses, moving, members = solution
    cosine, sine, left, right, rear = bodies[COSINE], bodies[SINE], bodies[LEFT], bodies[RIGHT], bodies[REAR]
    half, wheel_n, caster_n, creep = bodies[HALF], bodies[WHEEL_N], bodies[CASTER_N], bodies[CREEP]
    step_x, step_y, share = bodies[STEP_X], bodies[STEP_Y], contacts[SHARE]
    normal_x, normal_y, gap, slide = contacts[NORMAL_X], contacts[NORMAL_Y], contacts[GAP], contacts[SLIDE]
    arm_1, lever_1, arm_2, lever_2 = contacts[ARM_1], contacts[LEVER_1], contacts[ARM_2], contacts[LEVER_2]
    pressure, drag, give, friction = contacts[PRESSURE], contacts[DRAG], contacts[GIVE], contacts[FRICTION]
    kind, static, active_count = 1 if has_things else 0, len(half) - 1, len(active)
    enough, same = _SETTLED_M[kind], _SAME_SLIP[kind]
    fixed, count, farthest = moving[static], 0, 0.0
    fixed.a = fixed.h = fixed.u_x = fixed.u_y = fixed.x = fixed.y = fixed.turn = 0.0
    for n in range(active_count):
        k = active[n]
        place, press = places[n], presses[n]
        place.first, place.second, place.starts = first[k], second[k], state[k] == STARTS
        for i in (first[k], second[k]):
            if moving[i].stamp == 0 and i != static:
                moving[i].stamp = 1
                members[count] = i
                count += 1
                farthest = max(farthest, math.sqrt(step_x[i] * step_x[i] + step_y[i] * step_y[i]))
        press.normal_x, press.normal_y, press.gap, press.slide = normal_x[k], normal_y[k], gap[k], slide[k]
        press.arm_1, press.lever_1, press.arm_2, press.lever_2 = arm_1[k], lever_1[k], arm_2[k], lever_2[k]
        press.friction, press.share, press.pressure, press.drag = friction[k], share[k], pressure[k], drag[k]
        press.give = give[k]
    for m in range(count):
        i = members[m]
        if left[i] < TOUCH_M and right[i] < TOUCH_M:
            # In a new contact, most of what a robot rolls becomes slip; one that stands, stands. A thing is moved.
            rolled = math.sqrt(step_x[i] * step_x[i] + step_y[i] * step_y[i]) if i < robots else farthest
            left[i] = right[i] = rear[i] = rolled
    apart_x = apart_y = turned_1 = turned_2 = 0.0
    for _ in range(_ROUNDS[kind]):
        for m in range(count):
            i = members[m]
            body = moving[i]
            left_n_m = wheel_n[i] / max(left[i], creep[i])
            right_n_m = wheel_n[i] / max(right[i], creep[i])
            rear_n_m = caster_n[i] / max(rear[i], creep[i])
            all_n_m = left_n_m + right_n_m + rear_n_m
            ahead, aside = half[i] * (left_n_m - right_n_m) / all_n_m, -CASTER_M * rear_n_m / all_n_m
            turning = half[i] * half[i] * (left_n_m + right_n_m) + CASTER_M * CASTER_M * rear_n_m
            body.a = 1.0 / all_n_m
            body.h = 1.0 / (turning - (ahead * ahead + aside * aside) * all_n_m)
            body.u_x = cosine[i] * ahead - sine[i] * aside
            body.u_y = sine[i] * ahead + cosine[i] * aside
            body.x = body.y = body.turn = 0.0
            body.stamp = 1
        for n in range(active_count):
            place, press = places[n], presses[n]
            one, two, n_x, n_y = moving[place.first], moving[place.second], press.normal_x, press.normal_y
            a_1, h_1, x_1, y_1 = one.a, one.h, one.u_x, one.u_y
            a_2, h_2, x_2, y_2 = two.a, two.h, two.u_x, two.u_y
            n_1, n_2 = x_1 * n_x + y_1 * n_y + press.arm_1, x_2 * n_x + y_2 * n_y + press.arm_2
            t_1, t_2 = y_1 * n_x - x_1 * n_y + press.lever_1, y_2 * n_x - x_2 * n_y + press.lever_2
            both = a_1 + a_2
            give_m = press.share * (both + h_1 * n_1 * n_1 + h_2 * n_2 * n_2)
            press.drag_give = press.share * (both + h_1 * t_1 * t_1 + h_2 * t_2 * t_2)
            press.stiffness, press.drag_stiffness, place.seen = 1.0 / give_m, 1.0 / press.drag_give, 0
            turn = -h_1 * n_1
            press.pressed_x_1, press.pressed_y_1 = x_1 * turn - a_1 * n_x, y_1 * turn - a_1 * n_y
            press.pressed_turn_1 = turn
            turn = -h_1 * t_1
            press.dragged_x_1, press.dragged_y_1 = x_1 * turn + a_1 * n_y, y_1 * turn - a_1 * n_x
            press.dragged_turn_1 = turn
            turn = h_2 * n_2
            press.pressed_x_2, press.pressed_y_2 = x_2 * turn + a_2 * n_x, y_2 * turn + a_2 * n_y
            press.pressed_turn_2 = turn
            turn = h_2 * t_2
            press.dragged_x_2, press.dragged_y_2 = x_2 * turn - a_2 * n_y, y_2 * turn + a_2 * n_x
            press.dragged_turn_2 = turn
            if press.pressure != 0.0:
                # The motion is kept rather than the force: it is what the contacts ask for.
                scale = press.give * press.stiffness
                more, more_drag = press.pressure * scale, press.drag * scale
                press.pressure, press.drag = more, more_drag
                one.x += more * press.pressed_x_1 + more_drag * press.dragged_x_1
                one.y += more * press.pressed_y_1 + more_drag * press.dragged_y_1
                one.turn += more * press.pressed_turn_1 + more_drag * press.dragged_turn_1
                two.x += more * press.pressed_x_2 + more_drag * press.dragged_x_2
                two.y += more * press.pressed_y_2 + more_drag * press.dragged_y_2
                two.turn += more * press.pressed_turn_2 + more_drag * press.dragged_turn_2
            press.give = give_m
        clock = 1
        for _ in range(_PASSES[kind]):
            is_settled, skips = True, False
            for n in range(active_count):
                place = places[n]
                one, two = moving[place.first], moving[place.second]
                if not has_things or place.starts:
                    skips = one.stamp <= place.seen and two.stamp <= place.seen
                    apart_x, apart_y = two.x - one.x, two.y - one.y
                    turned_1, turned_2 = one.turn, two.turn
                if skips:
                    continue
                clock += 2
                place.seen = clock
                press = presses[n]
                n_x, n_y, old, old_drag = press.normal_x, press.normal_y, press.pressure, press.drag
                left_m = (press.gap + n_x * apart_x) + (
                    n_y * apart_y + (press.arm_2 * turned_2 - press.arm_1 * turned_1)
                )
                if not IS_COMPILED and left_m >= 0.0 and old == 0.0:
                    continue
                pressed = max(old - left_m * press.stiffness, 0.0)
                most = press.friction * pressed
                slid_m = (press.slide + n_x * apart_y) - (
                    n_y * apart_x - (press.lever_2 * turned_2 - press.lever_1 * turned_1)
                )
                dragged = min(max(old_drag - slid_m * press.drag_stiffness, -most), most)
                more, more_drag = pressed - old, dragged - old_drag
                press.pressure, press.drag = pressed, dragged
                one.x += more * press.pressed_x_1 + more_drag * press.dragged_x_1
                one.y += more * press.pressed_y_1 + more_drag * press.dragged_y_1
                one.turn += more * press.pressed_turn_1 + more_drag * press.dragged_turn_1
                two.x += more * press.pressed_x_2 + more_drag * press.dragged_x_2
                two.y += more * press.pressed_y_2 + more_drag * press.dragged_y_2
                two.turn += more * press.pressed_turn_2 + more_drag * press.dragged_turn_2
                moves = abs(more) * press.give + abs(more_drag) * press.drag_give > enough
                if IS_COMPILED or moves:  # compiled, the branch costs more than what it skips
                    is_settled &= not moves
                    # Pressure and drag depend on each other: this contact, too, is looked at again.
                    stamp = (clock + (most > 0.0)) * moves
                    one.stamp, two.stamp = max(one.stamp, stamp), max(two.stamp, stamp)
                    fixed.stamp = 0
            if is_settled:
                break
        is_same = True
        for m in range(count):
            i = members[m]
            body = moving[i]
            ahead = cosine[i] * body.x + sine[i] * body.y
            aside = cosine[i] * body.y - sine[i] * body.x
            turn = half[i] * body.turn
            if i < robots:
                slip_left = math.sqrt((ahead - turn) * (ahead - turn) + aside * aside)
                slip_right = math.sqrt((ahead + turn) * (ahead + turn) + aside * aside)
                aside += CASTER_M * body.turn
                slip_rear = math.sqrt(ahead * ahead + aside * aside)
            else:
                slip_left = slip_right = slip_rear = math.sqrt(ahead * ahead + aside * aside + turn * turn)
            if slip_left + slip_right > 0.0:  # of one that nothing presses on, the stiffness does not matter
                least, most = max(left[i], creep[i]), max(slip_left, creep[i])
                if most > same * least or least > same * most:
                    is_same = False
                least, most = max(right[i], creep[i]), max(slip_right, creep[i])
                if most > same * least or least > same * most:
                    is_same = False
            left[i], right[i], rear[i] = slip_left, slip_right, slip_rear
        if is_same:
            break
    x, y, theta, is_pressing, most = bodies[X], bodies[Y], bodies[THETA], False, 0.0
    moved_x, moved_y, turned = bodies[MOVED_X], bodies[MOVED_Y], bodies[TURNED]
    for n in range(active_count):
        k, press = active[n], presses[n]
        pressure[k], drag[k], give[k] = press.pressure, press.drag, press.give
        is_pressing = is_pressing or press.pressure != 0.0
    for m in range(count):
        i = members[m]
        body = moving[i]
        moved_x[i], moved_y[i], turned[i] = body.x, body.y, body.turn
        body.stamp, turn = 0, body.turn
        most = max(most, abs(body.x), abs(body.y))
        if i >= robots:
            continue
        x[i] += body.x
        y[i] += body.y
        theta[i] += turn
        half_tangent = turn * (0.5 + turn * turn / 24.0)
        scale = 1.0 / (1.0 + half_tangent * half_tangent)
        turn_cosine, turn_sine = (1.0 - half_tangent * half_tangent) * scale, 2.0 * half_tangent * scale
        cosine[i], sine[i] = (
            cosine[i] * turn_cosine - sine[i] * turn_sine,
            cosine[i] * turn_sine + sine[i] * turn_cosine,
        )
    return most, is_pressing


def list_near(
    begin: int, end: int, near_m: float, ends: Any, first: Any, second: Any, obstacle: Any, contacts: Any, bodies: Any,
    obstacles: Any, spare: Any, spare_forces: Any,
) -> bool:  # fmt: skip
    """List the contacts that the robots begin to end may come to have; return False, and change nothing, without room.

    near_m: how far each of two robots may move until then. ends: numbers of pairs, and of pairs and obstacles. spare,
    spare_forces: room for as many contacts.
    """
    x, y, radius = bodies[X], bodies[Y], bodies[RADIUS]
    forces = contacts[PRESSURE : GIVE + 1]
    static, room, found = len(x) - 1, len(first), 0
    for i in range(begin, end):
        for j in range(i + 1, end):
            away_x, away_y, reach_m = x[j] - x[i], y[j] - y[i], radius[i] + radius[j] + 2.0 * near_m
            if away_x * away_x + away_y * away_y < reach_m * reach_m:
                if found == room:
                    return False
                spare[0, found], spare[1, found], spare[2, found] = i, j, -1
                found += 1
    new_pairs = found
    for i in range(begin, end):
        for o in range(obstacles.shape[1]):
            to_x, to_y = x[i] - obstacles[START_X, o], y[i] - obstacles[START_Y, o]
            along_x, along_y = obstacles[ALONG_X, o], obstacles[ALONG_Y, o]
            along = min(max((to_x * along_x + to_y * along_y) / obstacles[LENGTH2, o], 0.0), 1.0)
            away_x, away_y = to_x - along * along_x, to_y - along * along_y
            reach_m = radius[i] + obstacles[THICKNESS, o] + near_m
            if away_x * away_x + away_y * away_y < reach_m * reach_m:
                if found == room:
                    return False
                spare[0, found], spare[1, found], spare[2, found] = static, i, o
                found += 1
    old = 0
    for k in range(found):  # both lists are in the same order
        key = (spare[0, k], spare[1, k], spare[2, k])
        while old < ends[1] and (first[old], second[old], obstacle[old]) < key:
            old += 1
        if old < ends[1] and (first[old], second[old], obstacle[old]) == key:
            spare_forces[:, k] = forces[:, old]
        else:
            spare_forces[:, k] = 0.0
    for k in range(found):
        i, j, o = spare[0, k], spare[1, k], spare[2, k]
        first[k], second[k], obstacle[k] = i, j, o
        forces[:, k] = spare_forces[:, k]
        contacts[LEVER_2, k] = -radius[j]
        if k < new_pairs:
            contacts[TOUCHING, k], contacts[LEVER_1, k] = radius[i] + radius[j], radius[i]
            contacts[FRICTION, k] = math.sqrt(bodies[ON_ROBOT, i] * bodies[ON_ROBOT, j])
        else:
            contacts[TOUCHING, k], contacts[LEVER_1, k] = radius[j] + obstacles[THICKNESS, o], 0.0
            contacts[FRICTION, k] = bodies[ON_WALL, j]
    ends[0], ends[1] = new_pairs, found
    return True


def move_worlds(
    ground_m: Any, separations_m: Any, margin_m: float, begun: Any, reach_m: Any, gap_m: Any, ends: Any, numbers: Any,
    contacts: Any, bodies: Any, obstacles: Any, solution: Any, spare: Any, spare_forces: Any,
) -> bool:  # fmt: skip
    """Move the robots of all worlds by the steps of their wheels over the ground (K, 2, R); return False without room.

    begun (W,): the steps that were taken; they continue there. reach_m, gap_m (W,): how far a world's robots may move
    until lists are incomplete, and until something could touch. ends (W, 2), numbers (W, 4, room), contacts (W, rows,
    room): first and second bodies, obstacles and states; see list_near().
    """
    steps, _, rows = ground_m.shape
    robots = rows // len(begun) if rows else 0
    x, y, theta, cosine, sine = bodies[X], bodies[Y], bodies[THETA], bodies[COSINE], bodies[SINE]
    step_x, step_y, turns = bodies[STEP_X], bodies[STEP_Y], bodies[TURN]
    active = np.empty(numbers.shape[2], dtype=np.int64)
    for world in range(len(begun)):
        first, second, obstacle, state = numbers[world, 0], numbers[world, 1], numbers[world, 2], numbers[world, 3]
        begin, end, own = world * robots, (world + 1) * robots, contacts[world]
        while begun[world] < steps:
            ground = ground_m[begun[world]]
            fastest_m = 0.0
            for i in range(begin, end):
                fastest_m = max(fastest_m, abs((ground[0, i] + ground[1, i]) / 2.0))
            if gap_m[world] <= fastest_m and reach_m[world] < fastest_m:
                near_m = SHIFT_M + margin_m + fastest_m
                if not list_near(
                    begin, end, near_m, ends[world], first, second, obstacle, own, bodies, obstacles, spare,
                    spare_forces,
                ):  # fmt: skip
                    return False
                reach_m[world] = margin_m + fastest_m
            begun[world] += 1
            reach_m[world] -= fastest_m
            gap_m[world] -= fastest_m
            for i in range(begin, end):
                travel_m, turn = (ground[0, i] + ground[1, i]) / 2.0, (ground[1, i] - ground[0, i]) / separations_m[i]
                d_x, d_y, cosine[i], sine[i] = follow_arc(cosine[i], sine[i], *shape_arc(travel_m, turn))
                x[i] += d_x
                y[i] += d_y
                theta[i] += turn
                step_x[i], step_y[i], turns[i] = d_x, d_y, turn
            if gap_m[world] > 0.0:
                continue
            pairs = ends[world, 0]
            touches, least_m, count = find_contacts(
                pairs, ends[world, 1], first, second, obstacle, state, own, bodies, obstacles, active
            )
            gap_m[world] = min(least_m, reach_m[world])
            if touches:
                listed = active[:count]
                moved_m, presses = solve_contacts(listed, first, second, state, own, bodies, solution, rows, False)
                leave_walls(pairs, listed, second, obstacle, own, bodies, obstacles)
                moved_m *= math.sqrt(2.0)
                reach_m[world] -= moved_m
                gap_m[world] = 0.0 if presses else gap_m[world] - moved_m
    return True
