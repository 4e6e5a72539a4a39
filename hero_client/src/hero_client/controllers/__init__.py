"""Controllers: pure functions and classes that turn poses and ranges into velocities. They know no ROS."""

from .avoidance import WanderLaw, WanderMemory, shorten_for_body, wander
from .go_to_goal import DEFAULT_TOLERANCE_M, Goal, GoToGoalController
from .half_planes import FAR_LOOKAHEAD_M, LOOKAHEAD_M, MARGIN_M, NEIGHBORS, nearest_allowed, steer
from .heading_check import HeadingCheck, is_upside_down
from .lateness import Lateness
from .motion import DEFAULT_TIMEOUT_S, State
from .orca import AvoidanceLaw
from .swarm_go_to import SwarmGoToController
from .unicycle import FollowLaw, follow, go_to_pose
