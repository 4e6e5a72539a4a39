"""The arena and the bodies in it: wheels, poses, collisions and infrared light, in steps of simulated time."""

from .arena import BARE_GRAY, Area, Arena, Segments, build_default, is_free, measure_clearance, place_robots
from .arena_file import SHIPPED, load_arena, locate_arena
from .compiled import compile_loops
from .kinematics import join_wheels, split_to_wheels
from .pushing.shapes import PushedBody, list_outlines
from .range_sensors import ALPHA_COUNTS_M2, BETA_COUNTS, NOISE_COUNTS, Sight
from .robot_errors import KINDS, MAX_WHEEL_M_S, SERVO_GAIN_M_S_US, RobotErrors, draw_errors, read_known
from .world import STEP_MS, World
